//! Faults of the converters, as the host learns of them.

use ads1299::Alignment;
use ads1299::simulation::Fault;
use link::{Flags, Streams};
use virtual_board::{Kind, Setup, Trouble, VirtualBoard};

use crate::figures::record;
use crate::images::Subject;
use crate::session::{UP_US, assert_sound, converters, power_on, run_codes, running, start};

/// A chip that is not chip 0.
const CHIP: usize = 5;

/// Flags of the codes so far.
fn flags(board: &VirtualBoard) -> Vec<Flags> {
    board.inbox().codes().map(|(_, code)| code.flags).collect()
}

/// Frames of each chip that were not to be trusted, by the newest status.
fn frames_bad(board: &VirtualBoard) -> Vec<u32> {
    let mut frames = board.inbox().frames().iter().rev();
    let newest = frames.find_map(|frame| match &frame.kind {
        Kind::Converters(converters) => Some(converters.frames_bad.to_vec()),
        _ => None,
    });
    newest.expect("a status each second")
}

/// Breaks the chip while codes stream, and returns the chips that the device reports.
fn broken(board: &mut VirtualBoard, fault: Fault) -> Result<Vec<usize>, Trouble> {
    start(board, Streams::CODES)?;
    run_codes(board, 8)?;
    let bad = Flags::ADC_STATUS_BAD;
    assert!(flags(board).iter().all(|flags| !flags.contains(bad)));
    board.converters().inject(CHIP, fault);
    run_codes(board, 24)?;
    // The first window that ends after the fault holds it.
    let flagged: Vec<_> = flags(board)
        .iter()
        .map(|flags| flags.contains(bad))
        .collect();
    let first = flagged
        .iter()
        .position(|&bad| bad)
        .expect("no code is flagged");
    assert!(
        (8..=9).contains(&first),
        "code {first} is the first that is flagged"
    );
    assert!(flagged[first..].iter().all(|&bad| bad), "{flagged:?}");
    let counts = frames_bad(board);
    Ok((0..counts.len()).filter(|&chip| counts[chip] > 0).collect())
}

/// Nothing gets past a chip without power: it and the chips that send through it are named.
pub(crate) fn a_dead_chip_is_named(subject: Subject) -> Result<(), Trouble> {
    let mut board = running(subject)?;
    let named = broken(&mut board, Fault::Dead)?;
    assert_eq!(named, (CHIP..8).collect::<Vec<_>>());
    assert_sound(&mut board)?;
    record(subject, "fault_dead_chip", true);
    Ok(())
}

/// A chip that sends a bit late shifts the chips that send through it.
pub(crate) fn a_shifted_bit_is_named(subject: Subject) -> Result<(), Trouble> {
    let mut board = running(subject)?;
    let named = broken(&mut board, Fault::ShiftedBit)?;
    assert_eq!(named.first(), Some(&CHIP), "{named:?}");
    assert_sound(&mut board)?;
    record(subject, "fault_shifted_bit", true);
    Ok(())
}

/// DRDY does not move any more: codes go on, flagged, and all chips are counted as bad; when it moves
/// again, so do the codes.
pub(crate) fn a_silent_chain_is_flagged(subject: Subject) -> Result<(), Trouble> {
    let mut board = running(subject)?;
    start(&mut board, Streams::CODES)?;
    run_codes(&mut board, 8)?;
    board.hold_ready(Some(true));
    run_codes(&mut board, 24)?;
    let flagged = flags(&board);
    let bad = Flags::ADC_STATUS_BAD;
    assert!(
        flagged[10..].iter().all(|flags| flags.contains(bad)),
        "{flagged:?}"
    );
    assert!(frames_bad(&board).iter().all(|&frames| frames > 0));
    board.hold_ready(None);
    run_codes(&mut board, 8)?;
    let last = flags(&board).pop().expect("codes");
    assert!(!last.contains(bad), "{last:?}");
    assert_sound(&mut board)?;
    record(subject, "fault_silent_drdy", true);
    Ok(())
}

/// A chain that puts no don't-care bit between two chips is understood as well.
pub(crate) fn a_packed_chain_is_understood(subject: Subject) -> Result<(), Trouble> {
    let setup = Setup {
        alignment: Alignment::Packed,
        ..subject.setup()
    };
    let mut board = power_on(subject, &setup)?;
    board.run_until("converters run", UP_US, |frames| {
        converters(frames) == Some("")
    })?;
    start(&mut board, Streams::CODES)?;
    run_codes(&mut board, 8)?;
    let bad = Flags::ADC_STATUS_BAD;
    assert!(flags(&board).iter().all(|flags| !flags.contains(bad)));
    assert_sound(&mut board)?;
    Ok(())
}

/// The converters' board gets its power seconds after the microcontroller: the firmware says what is
/// wrong, tries again, and streams without anybody's help.
pub(crate) fn converters_may_be_powered_late(subject: Subject) -> Result<(), Trouble> {
    let setup = Setup {
        converters_on: false,
        ..subject.setup()
    };
    let mut board = power_on(subject, &setup)?;
    board.run_until("a fault of the converters", 3_000_000, |frames| {
        converters(frames).is_some_and(|fault| !fault.is_empty())
    })?;
    let fault = converters(board.inbox().frames())
        .unwrap_or_default()
        .to_owned();
    assert!(fault.contains("ADS1299 0"), "it says {fault:?}");
    board.converters().power_on();
    board.run_until("converters run", 10_000_000, |frames| {
        converters(frames) == Some("")
    })?;
    start(&mut board, Streams::CODES)?;
    run_codes(&mut board, 8)?;
    let last = flags(&board).pop().expect("codes");
    assert!(!last.contains(Flags::ADC_STATUS_BAD), "{last:?}");
    assert_sound(&mut board)?;
    record(subject, "fault_late_power", true);
    Ok(())
}
