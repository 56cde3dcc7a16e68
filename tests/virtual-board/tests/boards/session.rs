//! Functions for all scenarios: they start a board and its streams, pick messages from its frames,
//! and assert at the end that it worked without faults.

use link::{AckResult, Start, Streams, ToDevice};
use virtual_board::{BoardError, Frame, Kind, Setup, VirtualBoard};

use crate::images::Subject;

/// Time limit from power-on until the converters run, in us. The firmware waits 1 s after power-on
/// and 0.15 s for the reference, then writes the registers; a missing external clock adds a timeout
/// of 0.5 s.
const UP_US: u64 = 2_000_000;

/// Powers on a board with the settings `setup` and the image of `subject`.
pub(crate) fn power_on(subject: Subject, setup: &Setup) -> VirtualBoard {
    VirtualBoard::power_on(subject.model, &subject.image(), setup)
}

/// Powers on a healthy board and runs it until its converters run.
pub(crate) fn running(subject: Subject) -> Result<VirtualBoard, BoardError> {
    running_with(subject, &subject.setup())
}

/// Powers on a board with the settings `setup` and runs it until its converters run.
pub(crate) fn running_with(subject: Subject, setup: &Setup) -> Result<VirtualBoard, BoardError> {
    let mut board = power_on(subject, setup);
    run_up(&mut board)?;
    Ok(board)
}

/// Runs a board that has just started until its converters run.
pub(crate) fn run_up(board: &mut VirtualBoard) -> Result<(), BoardError> {
    board.run_until("converters run", UP_US, |frames| converters(frames) == Some(""))
}

/// Powers on a healthy board, waits until its converters run, and starts `streams`.
pub(crate) fn streaming(subject: Subject, streams: Streams) -> Result<VirtualBoard, BoardError> {
    let mut board = running(subject)?;
    start(&mut board, streams)?;
    Ok(board)
}

/// Commands the device to start `streams`, and returns its answer.
pub(crate) fn start(board: &mut VirtualBoard, streams: Streams) -> Result<AckResult, BoardError> {
    let start = Start { streams, mains_hz: 0 };
    answer(board, &ToDevice::Start(start))
}

/// Sends a command, and returns the result in its acknowledgement.
pub(crate) fn answer(
    board: &mut VirtualBoard,
    command: &ToDevice<'_>,
) -> Result<AckResult, BoardError> {
    let before = acks(board.inbox().frames());
    board.send(command);
    board.run_until("an answer", 100_000, |frames| acks(frames) > before)?;
    let result = |kind: &Kind| match kind {
        Kind::Ack(ack) => Some(ack.result),
        _ => None,
    };
    let newest = pick(board.inbox().frames(), result).next_back();
    Ok(newest.expect("an answer"))
}

/// Asserts that the board has lost nothing and that no processing stage has missed its deadline.
/// Returns the newest report of the stages' execution times.
pub(crate) fn in_time(board: &VirtualBoard) -> link::Timing {
    let mut newest = None;
    for frame in board.inbox().frames() {
        match &frame.kind {
            Kind::Stats(stats) => {
                let lost =
                    [stats.frames_dropped, stats.overruns, stats.adc_status_bad, stats.input_bad];
                assert_eq!(lost, [0; 4], "dropped, overruns, bad status, bad input");
            }
            Kind::Timing(timing) => {
                for stage in &timing.stages {
                    let late = stage.histogram.last().copied();
                    assert_eq!(late, Some(0), "{} is late: {stage:?}", stage.stage);
                }
                newest = Some(link::Timing::clone(timing));
            }
            _ => {}
        }
    }
    newest.expect("a report each second")
}

/// Returns the largest ratio of a stage's longest time to the stage's deadline.
pub(crate) fn worst_path(timing: &link::Timing) -> f64 {
    let worst =
        timing.stages.iter().map(|stage| f64::from(stage.worst_ns) / f64::from(stage.deadline_ns));
    worst.fold(0.0, f64::max)
}

/// Returns, in order, what `select` picks from the messages in `frames`.
pub(crate) fn pick<'f, T>(
    frames: &'f [Frame],
    select: fn(&'f Kind) -> Option<T>,
) -> impl DoubleEndedIterator<Item = T> {
    frames.iter().filter_map(move |frame| select(&frame.kind))
}

/// Returns the number of acknowledgements in `frames`.
pub(crate) fn acks(frames: &[Frame]) -> usize {
    let is_ack = |kind: &Kind| matches!(kind, Kind::Ack(_)).then_some(());
    pick(frames, is_ack).count()
}

/// Runs until the device has sent `codes` more codes.
pub(crate) fn run_codes(board: &mut VirtualBoard, codes: usize) -> Result<(), BoardError> {
    let is_code = |kind: &Kind| matches!(kind, Kind::Code(_)).then_some(());
    let count = |frames: &[Frame]| pick(frames, is_code).count();
    let before = count(board.inbox().frames());
    run_frames(board, codes, 62_500, |frames| count(frames) - before)
}

/// Runs until `count` returns at least `frames` for the frames received so far. Fails after
/// `frames` intervals of `interval_us`, plus 300 ms.
pub(crate) fn run_frames(
    board: &mut VirtualBoard,
    frames: usize,
    interval_us: u64,
    count: impl Fn(&[Frame]) -> usize,
) -> Result<(), BoardError> {
    let limit_us = frames as u64 * interval_us + 300_000;
    let what = format!("{frames} frames");
    board.run_until(&what, limit_us, |received| count(received) >= frames)
}

/// Returns the fault in the newest status of the converters, which is empty if they run; `None` if
/// the device has sent no status since its last start.
pub(crate) fn converters(frames: &[Frame]) -> Option<&str> {
    let is_hello = |frame: &Frame| matches!(frame.kind, Kind::Hello { .. });
    let started = frames.iter().rposition(is_hello).unwrap_or(0);
    let mut faults = pick(&frames[started..], |kind| match kind {
        Kind::Converters(converters) => Some(converters.fault.as_str()),
        _ => None,
    });
    faults.next_back()
}

/// Returns the newest of the device's statistics in `frames`.
pub(crate) fn stats(frames: &[Frame]) -> Option<&link::Stats> {
    let mut stats = pick(frames, |kind| match kind {
        Kind::Stats(stats) => Some(&**stats),
        _ => None,
    });
    stats.next_back()
}

/// Returns the reset cause and the fault that each `Hello` in `frames` reports.
pub(crate) fn greetings(frames: &[Frame]) -> Vec<(link::ResetCause, String)> {
    let hello = |kind: &Kind| match kind {
        Kind::Hello { reset_cause, fault, .. } => Some((*reset_cause, fault.clone())),
        _ => None,
    };
    pick(frames, hello).collect()
}

/// Asserts that every received frame could be decoded, and what [`assert_no_findings`] asserts.
pub(crate) fn assert_sound(board: &mut VirtualBoard) -> Result<(), BoardError> {
    assert_no_findings(board)?;
    assert_eq!(board.inbox().decode_errors(), [""; 0], "frames that cannot be decoded");
    Ok(())
}

/// Asserts that the emulator has found only allowed problems, without any unmapped or refused
/// access, and that no rule of the converters or of USB was violated.
pub(crate) fn assert_no_findings(board: &mut VirtualBoard) -> Result<(), BoardError> {
    assert_no_findings_but(board, |_| false)
}

/// Asserts the same as [`assert_no_findings`], but allows accesses to unmapped addresses for which
/// `is_intended` returns true.
pub(crate) fn assert_no_findings_but(
    board: &mut VirtualBoard,
    is_intended: fn(&str) -> bool,
) -> Result<(), BoardError> {
    let mut findings = board.findings()?;
    findings.unmapped.retain(|access| !is_intended(access));
    assert_eq!(findings.unmapped, [""; 0], "accesses to unmapped addresses");
    assert_eq!(findings.refused, [""; 0], "refused accesses");
    assert_eq!(findings.unrouted, [""; 0], "interrupts that are not connected to the NVIC");
    assert_eq!(findings.unexpected(board.model()), [""; 0]);
    assert_eq!(board.converters().violations(), 0, "violations of the converters' rules");
    if let Some(host) = board.port().usb() {
        let violations: Vec<String> = host.violations().iter().map(ToString::to_string).collect();
        assert_eq!(violations, [""; 0], "violations of USB");
    }
    assert_eq!(board.non_byte_words(), 0, "SPI words that are not 8 bits wide");
    Ok(())
}
