//! Bring-up of a chain: order and times of the commands, and chips that it refuses.

use std::string::ToString;
use std::vec::Vec;

use super::{Bench, run};
use crate::decoder::frame_bytes;
use crate::error::Error;
use crate::register::Register;
use crate::settings::{Input, Settings};
use crate::simulation::{Electrodes, Event, Fault, Options, Simulation};

/// Creates a chain that has not been brought up.
fn stopped<const CHIPS: usize, const BYTES: usize>(options: Options) -> Bench<CHIPS, BYTES> {
    Bench::new(options, Electrodes::silent(), Settings::EEG)
}

/// Returns the error of a bring-up with one broken chip.
fn error_with(chip: usize, fault: Fault) -> Error {
    let mut bench = stopped::<8, { frame_bytes(8) }>(Options::default());
    bench.simulation.inject(chip, fault);
    bench.start().expect_err("a fault")
}

#[test]
fn order_and_times_follow_the_data_sheet() {
    let Bench { simulation, .. } = Bench::<8, { frame_bytes(8) }>::silent(Options::default());
    assert_eq!(simulation.violations(), 0);

    let events = simulation.events();
    let time_of = |wanted: Event| events.iter().find(|(_, event)| *event == wanted).unwrap().0;
    let command = |chip, opcode| Event::Command { chip, opcode };
    // 2^18 tCLK (125 ms) pass before the reset, and 18 tCLK (8584 ns) after it.
    let reset = time_of(Event::Reset);
    assert!(reset >= 125_000_000, "{reset}");
    assert!(events[1].0 - reset >= 8584, "{events:?}");
    // Each chip receives SDATAC, and CONFIG3 is written. 150 ms pass after the last write of
    // CONFIG3 before any other register is written. All registers are read back, from the ID on.
    for chip in 0..8 {
        let mut opcodes: Vec<u8> = Vec::new();
        for (_, event) in &events {
            if let Event::Command { chip: of, opcode } = event
                && *of == chip
                // Reads of CONFIG3 (0x23) and repeated opcodes are allowed at any time.
                && *opcode != 0x23
                && opcodes.last() != Some(opcode)
            {
                opcodes.push(*opcode);
            }
        }
        let order = [0x11, 0x43, 0x41, 0x49, 0x54, 0x20, 0x28, 0x30, 0x10];
        assert_eq!(opcodes, order, "chip {chip}");
        assert!(time_of(command(chip, 0x41)) - time_of(command(7, 0x43)) >= 150_000_000);
    }
    // RDATAC follows START within 100 us, long before the first sample ends.
    let start = time_of(Event::Start(true));
    let last = time_of(command(7, 0x10));
    assert!(start < last && last - start < 100_000);
}

#[test]
fn every_register_is_read_back() {
    let simulation = Simulation::<3>::new(Options::default(), Electrodes::silent());
    let mut chain = simulation.chain();
    run(chain.reset(Settings::EEG, &mut || ()));
    let mut set_up = |settings| run(chain.set_up(settings, &mut || ()));
    for input in [Input::Electrodes, Input::Shorted, Input::TestSignal] {
        let settings = Settings { input, ..Settings::EEG };
        for (chip, back) in set_up(settings).iter().enumerate() {
            assert_eq!(back.read, settings.image(chip));
            assert_eq!((back.differing, back.id_fits), (0, true));
        }
    }
    simulation.inject(1, Fault::Forgets(Register::CONFIG4));
    let settings = Settings { lead_off: true, ..Settings::EEG };
    let differing = set_up(settings).map(|chip| chip.first_differing());
    assert_eq!(differing, [None, Some(Register::CONFIG4), None]);
    assert_eq!(simulation.violations(), 0);
}

#[test]
fn a_wrong_id_names_the_chip_and_what_it_may_be() {
    for chip in 0..8 {
        let error = error_with(usize::from(chip), Fault::WrongId(0x92));
        assert_eq!(error, Error::WrongId { chip, read: 0x92 });
    }
    assert_eq!(
        error_with(5, Fault::WrongId(0x92)).to_string(),
        "ADS1299 5 of the chain answers with ID 0x92 instead of 0x3E: an ADS1294, 1296 or 1298, \
         whose registers differ"
    );
    let four = error_with(2, Fault::WrongId(0x3C)).to_string();
    assert!(four.contains("an ADS1299-4 or -6"), "{four}");
    // Other revisions of the same part are accepted.
    let mut bench = stopped::<1, { frame_bytes(1) }>(Options::default());
    bench.simulation.inject(0, Fault::WrongId(0x1E));
    assert_eq!(bench.start(), Ok(()));
}

#[test]
fn a_chip_without_answer_is_named_with_its_likely_cause() {
    // Without read-back resistors, only chip 0 drives MISO.
    let without_read_back = Options { read_back_ohms: None, ..Options::default() };
    let dead = error_with(6, Fault::Dead);
    let mut bench = stopped::<4, { frame_bytes(4) }>(without_read_back);
    let unread = bench.start().expect_err("only chip 0 can be read");
    for (error, chip, read, cause) in
        [(dead, 6, 0, "all zeros"), (unread, 1, 0xFF, "nothing drives MISO")]
    {
        assert_eq!(error, Error::WrongId { chip, read });
        assert!(error.to_string().contains(cause), "{error}");
    }
}

#[test]
fn a_register_that_ignores_writes_is_named() {
    let error = error_with(3, Fault::Forgets(Register::CONFIG1));
    let expected = Error::NotKept { chip: 3, register: Register::CONFIG1, wrote: 0x95, read: 0x96 };
    assert_eq!(error, expected);
    let text = error.to_string();
    assert!(text.starts_with("CONFIG1 of ADS1299 3 holds 0x96, and 0x95 was written: "), "{text}");
}

#[test]
fn commands_at_too_slow_a_master_clock_are_violations() {
    let options = Options { clock_hz: 1_000_000, ..Options::default() };
    let mut bench = stopped::<2, { frame_bytes(2) }>(options);
    assert!(bench.start().is_err());
    assert!(bench.simulation.violations() > 0);
}

#[test]
fn any_sclk_and_any_number_of_chips_work() {
    for sclk_hz in [100_000, 4_000_000, 20_000_000] {
        let options = Options { register_hz: sclk_hz, burst_hz: sclk_hz, ..Options::default() };
        let one = Bench::<1, { frame_bytes(1) }>::silent(options);
        // Read-back limits SCLK for the registers of a daisy chain.
        let five =
            Bench::<5, { frame_bytes(5) }>::silent(Options { register_hz: 100_000, ..options });
        assert_eq!(one.simulation.violations(), 0);
        assert_eq!(five.simulation.violations(), 0);
    }
}
