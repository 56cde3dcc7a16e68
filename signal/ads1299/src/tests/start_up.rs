//! Bring-up of a chain: order, times and refusals.

use std::string::ToString;
use std::vec::Vec;

use crate::error::Error;
use crate::input::Input;
use crate::register::Register;
use crate::settings::Settings;
use crate::simulation::{Electrodes, Event, Fault, Options, Simulation, finish};

fn silent<const CHIPS: usize>(options: Options) -> Simulation<CHIPS> {
    Simulation::new(options, Electrodes::silent())
}

/// Returns the error of `power_up` with one broken chip.
fn error_with(chip: usize, fault: Fault) -> Error {
    let simulation = silent::<8>(Options::default());
    simulation.inject(chip, fault);
    let mut chain = simulation.chain();
    let result = finish(chain.power_up(&Settings::EEG)).expect("time is virtual");
    result.map(|_| ()).expect_err("a fault")
}

#[test]
fn order_and_times_follow_the_data_sheet() {
    let simulation = silent::<8>(Options::default());
    let mut chain = simulation.chain();
    let mut configured = finish(chain.power_up(&Settings::EEG)).unwrap().unwrap();
    finish(configured.start()).unwrap().unwrap();
    assert_eq!(simulation.violations(), 0);

    let events = simulation.events();
    let time_of = |wanted: Event| events.iter().find(|(_, event)| *event == wanted).unwrap().0;
    let command = |chip, opcode| Event::Command { chip, opcode };
    // 2^18 tCLK (125 ms) pass before the reset, and 18 tCLK (8584 ns) after it.
    let reset = time_of(Event::Reset);
    assert!(reset >= 125_000_000, "{reset}");
    assert!(events[1].0 - reset >= 8584, "{events:?}");
    // Each chip receives SDATAC, its ID is read, and CONFIG3 is written. 150 ms pass after the last
    // write of CONFIG3 before any other register is written.
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
        let order = [
            0x11, 0x20, 0x11, 0x43, 0x41, 0x49, 0x54, 0x20, 0x28, 0x30, 0x10,
        ];
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
    let simulation = silent::<3>(Options::default());
    let mut chain = simulation.chain();
    let mut configured = finish(chain.power_up(&Settings::EEG)).unwrap().unwrap();
    for input in Input::ALL {
        let settings = Settings::EEG.with_input(input);
        finish(configured.configure(&settings)).unwrap().unwrap();
        for (chip, back) in finish(configured.read_back())
            .unwrap()
            .unwrap()
            .iter()
            .enumerate()
        {
            assert_eq!(back.read, settings.image(chip));
            assert_eq!((back.differing, back.id_fits), (0, true));
        }
    }
    simulation.inject(1, Fault::Forgets(Register::LOFF));
    let mut settings = Settings::EEG;
    settings.lead_off.comparators = true;
    settings.lead_off.threshold = crate::lead_off::LeadOffThreshold::P80;
    assert!(finish(configured.configure(&settings)).unwrap().is_err());
    let back = finish(configured.read_back()).unwrap().unwrap();
    let differing = back.map(|chip| chip.first_differing());
    assert_eq!(differing, [None, Some(Register::LOFF), None]);
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
    let simulation = silent::<1>(Options::default());
    simulation.inject(0, Fault::WrongId(0x1E));
    assert!(
        finish(simulation.chain().power_up(&Settings::EEG))
            .unwrap()
            .is_ok()
    );
}

#[test]
fn a_dead_chip_answers_with_zeros() {
    let error = error_with(6, Fault::Dead);
    assert_eq!(error, Error::WrongId { chip: 6, read: 0 });
    let text = error.to_string();
    assert!(
        text.contains("ADS1299 6") && text.contains("all zeros"),
        "{text}"
    );
}

#[test]
fn a_chip_whose_dout_does_not_reach_miso_answers_with_ones() {
    let options = Options {
        read_back: false,
        ..Options::default()
    };
    let simulation = silent::<4>(options);
    let mut chain = simulation.chain();
    let error = finish(chain.power_up(&Settings::EEG)).unwrap().map(|_| ());
    let error = error.expect_err("only chip 0 can be read");
    assert_eq!(
        error,
        Error::WrongId {
            chip: 1,
            read: 0xFF
        }
    );
    let text = error.to_string();
    assert!(text.contains("nothing drives MISO"), "{text}");
}

#[test]
fn a_register_that_ignores_writes_is_named() {
    let error = error_with(3, Fault::Forgets(Register::CONFIG1));
    let expected = Error::NotKept {
        chip: 3,
        register: Register::CONFIG1,
        wrote: 0x95,
        read: 0x96,
    };
    assert_eq!(error, expected);
    let text = error.to_string();
    assert!(
        text.starts_with("CONFIG1 of ADS1299 3 holds 0x96, and 0x95 was written: "),
        "{text}"
    );
}

#[test]
fn commands_at_too_slow_a_master_clock_are_violations() {
    let options = Options {
        clock_hz: 1_000_000,
        ..Options::default()
    };
    let simulation = silent::<2>(options);
    let mut chain = simulation.chain();
    assert!(finish(chain.power_up(&Settings::EEG)).unwrap().is_err());
    assert!(simulation.violations() > 0);
}

#[test]
fn any_sclk_and_any_number_of_chips_work() {
    for sclk_hz in [100_000, 4_000_000, 20_000_000] {
        let options = Options {
            register_hz: sclk_hz,
            burst_hz: sclk_hz,
            ..Options::default()
        };
        let simulation = silent::<1>(options);
        assert!(
            finish(simulation.chain().power_up(&Settings::EEG))
                .unwrap()
                .is_ok()
        );
        let simulation = silent::<5>(options);
        assert!(
            finish(simulation.chain().power_up(&Settings::EEG))
                .unwrap()
                .is_ok()
        );
        assert_eq!(simulation.violations(), 0);
    }
}

#[test]
fn a_chain_can_be_brought_up_again_while_it_streams() {
    let simulation = silent::<2>(Options::default());
    let mut chain = simulation.chain();
    for _ in 0..3 {
        let mut configured = finish(chain.power_up(&Settings::EEG)).unwrap().unwrap();
        // The chain keeps converting: it is not stopped before the next bring-up.
        finish(configured.start()).unwrap().unwrap();
        simulation.pass_us(20_000);
    }
    assert_eq!(simulation.violations(), 0);
}
