//! Scenarios in which converters have faults, which the device must report.

use ads1299::simulation::Fault;
use ads1299::{Alignment, Wiring};
use link::{Flags, Streams};
use virtual_board::{BoardError, Converters, Kind, Setup, VirtualBoard};

use crate::images::Subject;
use crate::session::{
    assert_sound, converters, pick, power_on, run_codes, running_with, start, streaming,
};

/// Returns the index of the chip that gets the fault. If the board has several chips, any but chip
/// 0 would do.
fn chip(subject: Subject) -> usize {
    subject.converters().chips * 2 / 3
}

/// Number of codes after which the device has sent the status of its converters; it sends the
/// status once each second.
const A_STATUS: usize = 20;

/// Returns the flags of all codes received so far.
fn flags(board: &VirtualBoard) -> Vec<Flags> {
    board.inbox().codes().map(|(_, code)| code.flags).collect()
}

/// Returns each chip's number of bad frames from the newest status of the converters.
fn frames_bad(board: &VirtualBoard) -> Vec<u32> {
    let bad = |kind: &Kind| match kind {
        Kind::Converters(converters) => Some(converters.frames_bad.to_vec()),
        _ => None,
    };
    let newest = pick(board.inbox().frames(), bad).next_back();
    newest.expect("a status each second")
}

/// Gives a chip a fault while codes stream. Returns the chips that the device reports as bad.
fn inject_fault(subject: Subject, fault: Fault) -> Result<Vec<usize>, BoardError> {
    let mut board = streaming(subject, Streams::CODES)?;
    run_codes(&mut board, 8)?;
    let bad = Flags::ADC_STATUS_BAD;
    assert!(flags(&board).iter().all(|flags| !flags.contains(bad)));
    board.converters().inject(chip(subject), fault);
    run_codes(&mut board, A_STATUS)?;
    // Every window that ends after the fault began contains bad samples, so the first code with the
    // flag must be code 8 or 9.
    let flags = flags(&board).into_iter();
    let flagged: Vec<bool> = flags.map(|flags| flags.contains(bad)).collect();
    let first = flagged.iter().position(|&bad| bad);
    assert!(first == Some(8) || first == Some(9), "the first flagged code is {first:?}");
    assert!(flagged[9..].iter().all(|&bad| bad), "{flagged:?}");
    let counts = frames_bad(&board);
    assert_sound(&mut board)?;
    Ok((0..counts.len()).filter(|&chip| counts[chip] > 0).collect())
}

/// Scenario: the device reports a chip without power, and in a daisy chain all chips that send
/// their data through it.
pub(crate) fn a_dead_chip_is_reported(subject: Subject) -> Result<(), BoardError> {
    let named = inject_fault(subject, Fault::Dead)?;
    let Converters { chips, wiring, .. } = subject.converters();
    let chip = chip(subject);
    let expected = match wiring {
        Wiring::Daisy => chip..chips,
        Wiring::Cascaded => chip..chip + 1,
    };
    assert_eq!(named, expected.collect::<Vec<_>>());
    subject.record("fault_dead_chip", true);
    Ok(())
}

/// Scenario: the device reports a chip that sends one bit late and so shifts other chips' data.
pub(crate) fn a_shifted_bit_is_reported(subject: Subject) -> Result<(), BoardError> {
    let named = inject_fault(subject, Fault::ShiftedBit)?;
    assert_eq!(named.first(), Some(&chip(subject)), "{named:?}");
    subject.record("fault_shifted_bit", true);
    Ok(())
}

/// Scenario: while DRDY is stuck, codes continue with the flag `ADC_STATUS_BAD`, and the device
/// counts bad frames of all chips. After DRDY works again, codes no longer have the flag.
pub(crate) fn a_silent_drdy_is_flagged(subject: Subject) -> Result<(), BoardError> {
    let mut board = streaming(subject, Streams::CODES)?;
    run_codes(&mut board, 8)?;
    board.hold_drdy(Some(true));
    run_codes(&mut board, A_STATUS)?;
    let flagged = flags(&board);
    let bad = Flags::ADC_STATUS_BAD;
    assert!(flagged[10..].iter().all(|flags| flags.contains(bad)), "{flagged:?}");
    assert!(frames_bad(&board).iter().all(|&frames| frames > 0));
    board.hold_drdy(None);
    run_codes(&mut board, 8)?;
    let last = flags(&board).pop().expect("at least one code");
    assert!(!last.contains(bad), "{last:?}");
    assert_sound(&mut board)?;
    subject.record("fault_silent_drdy", true);
    Ok(())
}

/// Scenario: the device decodes data of converters that send no don't-care bits between chips.
pub(crate) fn a_packed_chain_is_decoded(subject: Subject) -> Result<(), BoardError> {
    let setup = Setup { alignment: Alignment::Packed, ..subject.setup() };
    let mut board = running_with(subject, &setup)?;
    start(&mut board, Streams::CODES)?;
    run_codes(&mut board, 8)?;
    let bad = Flags::ADC_STATUS_BAD;
    assert!(flags(&board).iter().all(|flags| !flags.contains(bad)));
    assert_sound(&mut board)?;
    Ok(())
}

/// Scenario: if the converters get power seconds after the microcontroller, the device reports the
/// fault, tries again, and can stream without a restart.
pub(crate) fn converters_can_be_powered_late(subject: Subject) -> Result<(), BoardError> {
    let setup = Setup { converters_on: false, ..subject.setup() };
    let mut board = power_on(subject, &setup);
    board.run_until("a fault of the converters", 3_000_000, |frames| {
        converters(frames).is_some_and(|fault| !fault.is_empty())
    })?;
    let fault = converters(board.inbox().frames()).unwrap_or_default().to_owned();
    assert!(fault.contains("ADS1299 0"), "the status reports {fault:?}");
    board.converters().power_on();
    board.run_until("converters run", 10_000_000, |frames| converters(frames) == Some(""))?;
    start(&mut board, Streams::CODES)?;
    run_codes(&mut board, 8)?;
    let last = flags(&board).pop().expect("at least one code");
    assert!(!last.contains(Flags::ADC_STATUS_BAD), "{last:?}");
    assert_sound(&mut board)?;
    subject.record("fault_late_power", true);
    Ok(())
}
