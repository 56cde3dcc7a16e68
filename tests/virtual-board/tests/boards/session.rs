//! What every scenario begins and ends with.

use link::{Start, Streams, ToDevice};
use virtual_board::{Frame, Kind, Setup, Trouble, VirtualBoard, allowed};

use crate::images::Subject;

/// Longest time from power on until the converters run, us: the second that the firmware waits from cold,
/// 0.15 s for their reference, their registers, and half a second for a clock that does not come.
pub(crate) const UP_US: u64 = 2_000_000;

/// A board with power.
pub(crate) fn power_on(subject: Subject, setup: &Setup) -> Result<VirtualBoard, Trouble> {
    VirtualBoard::power_on(subject.model, &subject.image(), setup)
}

/// A board whose converters run.
pub(crate) fn running(subject: Subject) -> Result<VirtualBoard, Trouble> {
    let mut board = power_on(subject, &subject.setup())?;
    board.run_until("converters run", UP_US, |frames| {
        converters(frames) == Some("")
    })?;
    Ok(board)
}

/// A board that streams.
pub(crate) fn streaming(subject: Subject, streams: Streams) -> Result<VirtualBoard, Trouble> {
    let mut board = running(subject)?;
    start(&mut board, streams)?;
    Ok(board)
}

/// Starts streams and waits for the answer.
pub(crate) fn start(board: &mut VirtualBoard, streams: Streams) -> Result<(), Trouble> {
    let before = acks(board.inbox().frames());
    board.send(&ToDevice::Start(Start {
        streams,
        mains_hz: 0,
    }));
    board.run_until("an answer to Start", 100_000, |frames| {
        acks(frames) > before
    })?;
    Ok(())
}

/// Answers so far.
pub(crate) fn acks(frames: &[Frame]) -> usize {
    let is_ack = |frame: &&Frame| matches!(frame.kind, Kind::Ack(_));
    frames.iter().filter(is_ack).count()
}

/// Runs until `codes` more codes have come.
pub(crate) fn run_codes(board: &mut VirtualBoard, codes: usize) -> Result<(), Trouble> {
    let before = board.inbox().codes().count();
    let limit_us = codes as u64 * 62_500 + 300_000;
    board.run_until(&format!("{codes} codes"), limit_us, |frames| {
        let is_code = |frame: &&Frame| matches!(frame.kind, Kind::Code(_));
        frames.iter().filter(is_code).count() >= before + codes
    })
}

/// What the newest status of the converters says is wrong with them; none before the first.
pub(crate) fn converters(frames: &[Frame]) -> Option<&str> {
    frames.iter().rev().find_map(|frame| match &frame.kind {
        Kind::Converters(converters) => Some(converters.fault.as_str()),
        _ => None,
    })
}

/// The newest of the device's counts.
pub(crate) fn stats(frames: &[Frame]) -> Option<&link::Stats> {
    frames.iter().rev().find_map(|frame| match &frame.kind {
        Kind::Stats(stats) => Some(&**stats),
        _ => None,
    })
}

/// Greetings so far, as (reset cause, fault of the run before), in order.
pub(crate) fn greetings(frames: &[Frame]) -> Vec<(link::ResetCause, String)> {
    let hello = |frame: &Frame| match &frame.kind {
        Kind::Hello {
            reset_cause, fault, ..
        } => Some((*reset_cause, fault.clone())),
        _ => None,
    };
    frames.iter().filter_map(hello).collect()
}

/// What holds at the end of every scenario: [`assert_no_findings`], and no frame damaged.
pub(crate) fn assert_sound(board: &mut VirtualBoard) -> Result<(), Trouble> {
    assert_no_findings(board)?;
    assert_eq!(board.inbox().bad(), [""; 0], "frames that cannot be used");
    Ok(())
}

/// No address that nothing answers, no access refused, nothing that is not on the list of what is allowed,
/// no rule of the converters or of USB broken.
pub(crate) fn assert_no_findings(board: &mut VirtualBoard) -> Result<(), Trouble> {
    assert_no_findings_but(board, |_| false)
}

/// The same where the scenario itself has the core access an address that nothing answers.
pub(crate) fn assert_no_findings_but(
    board: &mut VirtualBoard,
    is_meant: fn(&str) -> bool,
) -> Result<(), Trouble> {
    let mut findings = board.findings()?;
    findings.unmapped.retain(|access| !is_meant(access));
    assert_eq!(findings.unmapped, [""; 0], "addresses that nothing answers");
    assert_eq!(findings.refused, [""; 0], "accesses that were refused");
    assert_eq!(findings.unrouted, [""; 0], "interrupts without a line");
    assert_eq!(allowed::surprises(board.model(), &findings), [""; 0]);
    assert_eq!(
        board.converters().violations(),
        0,
        "rules of the converters"
    );
    if let Some(host) = board.port().usb() {
        let violations: Vec<String> = host.violations().iter().map(ToString::to_string).collect();
        assert_eq!(violations, [""; 0], "rules of USB");
    }
    assert_eq!(board.odd_words(), 0, "words on SPI that are no bytes");
    Ok(())
}
