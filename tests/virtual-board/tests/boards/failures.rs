//! Scenarios with restarts of the device: after failures of the firmware, and on command.

use link::{ResetCause, ResetInto, Streams, ToDevice};
use virtual_board::{BoardError, Frame, Injection, Kind, ReceivedCode, VirtualBoard};

use crate::codes::received;
use crate::images::Subject;
use crate::session::{
    acks, assert_no_findings_but, assert_sound, greetings, pick, run_codes, run_up, running,
    streaming,
};
use crate::simulation::{HOP, Repeatable};

/// Time limit from a failure to the next `Hello`, in us. It covers the watchdog's 200 ms, the
/// tolerance of its oscillator, and the start.
const LONGEST_US: u64 = 600_000;

/// Time limit from a command to the start of firmware or boot loader, in us. It covers 100 ms for
/// the acknowledgement, the start of the clocks, and the enumeration of USB.
const RESET_US: u64 = 1_000_000;

/// Failures to cause in the encode task. Each has the reset cause and a part of the fault that the
/// next `Hello` must report, and its name in the recorded figures. A hang leaves no fault.
const FAILURES: [(Injection, ResetCause, &str, &str); 5] = [
    (Injection::Hang, ResetCause::Watchdog, "", "hang"),
    (Injection::Panic, ResetCause::Fault, "injected.rs:7:3", "panic"),
    (Injection::HardFault, ResetCause::Fault, "hard fault at 0x5fffff", "fault"),
    (Injection::WildStack, ResetCause::Fault, "outside the stack", "wild_stack"),
    (Injection::StackOverflow, ResetCause::Fault, "stack overflow", "overflow"),
];

/// Scenario: each failure of the encode task resets the chip (after a hang, the watchdog does), the
/// next `Hello` reports the failure, and the device streams again.
pub(crate) fn failures_are_reported_after_the_restart(subject: Subject) -> Result<(), BoardError> {
    let mut board = streaming(subject, Streams::CODES)?;
    // Run until every task has made progress, because only then does the watchdog start.
    run_codes(&mut board, 4)?;
    for (injection, cause, named, key) in FAILURES {
        let before = greetings(board.inbox().frames()).len();
        let at_us = board.now_us();
        // The encode task runs in the handler of the interrupt I2C3_EV, which serves no other
        // purpose.
        board.inject_at("I2C3_EV", injection)?;
        board.run_until("Hello after a failure", LONGEST_US, |frames| {
            greetings(frames).len() > before
        })?;
        let took_us = board.now_us() - at_us;
        println!("{subject}: {injection:?}, Hello after {took_us} us");
        let fault = assert_streams_after(&mut board, subject, cause)?;
        assert!(fault.contains(named), "Hello reports {fault:?}");
        assert_eq!(fault.is_empty(), named.is_empty(), "Hello reports {fault:?}");
        if injection == Injection::StackOverflow {
            assert!(fault.starts_with(named), "Hello reports {fault:?}");
        }
        subject.record(&format!("reset_cause_{key}"), true);
    }
    // Allow accesses to addresses just below the RAM, which the stack overflow makes.
    assert_no_findings_but(&mut board, |access| access.starts_with("0x1fffff"))
}

/// Asserts that the newest `Hello` reports the reset cause `cause` and that the device streams
/// codes again, which equal host-sim's if the model is the built-in one. Returns the fault that
/// this `Hello` reports.
fn assert_streams_after(
    board: &mut VirtualBoard,
    subject: Subject,
    cause: ResetCause,
) -> Result<String, BoardError> {
    let (reported, fault) = greetings(board.inbox().frames()).pop().expect("a Hello");
    assert_eq!(reported, cause, "Hello reports {fault:?}");
    run_up(board)?;
    let run = Repeatable::start(board, Streams::CODES, &[])?;
    run_codes(board, 4)?;
    if subject.model_folder().is_none() {
        run.assert_equal(board, HOP, received_since_hello);
    }
    Ok(fault)
}

fn received_since_hello(frames: &[Frame]) -> Vec<ReceivedCode> {
    let is_hello = |frame: &Frame| matches!(frame.kind, Kind::Hello { .. });
    let started = frames.iter().rposition(is_hello).unwrap_or(0);
    received(&frames[started..])
}

/// Scenario: the device restarts on `Reset`, reports this as the cause, and streams again. Its
/// session id changes, so that a host recognises the restart.
pub(crate) fn restarts_on_command(subject: Subject) -> Result<(), BoardError> {
    let mut board = streaming(subject, Streams::CODES)?;
    run_codes(&mut board, 4)?;
    board.send(&ToDevice::Reset(ResetInto::Firmware));
    board.run_until("Hello after a Reset", RESET_US, |frames| greetings(frames).len() == 2)?;
    let fault = assert_streams_after(&mut board, subject, ResetCause::Software)?;
    assert_eq!(fault, "");
    let session = |kind: &Kind| match kind {
        Kind::Hello { session_id, .. } => Some(*session_id),
        _ => None,
    };
    let sessions: Vec<u32> = pick(board.inbox().frames(), session).collect();
    assert!(matches!(sessions[..], [first, second] if first != second));
    assert_sound(&mut board)
}

/// Scenario: the device acknowledges the command to reset into the boot loader, which then runs
/// with the clocks that the chip has after a reset.
pub(crate) fn restarts_into_the_loader(subject: Subject) -> Result<(), BoardError> {
    let mut board = running(subject)?;
    let before = acks(board.inbox().frames());
    board.send(&ToDevice::Reset(ResetInto::Bootloader));
    board.run_for_us(RESET_US)?;
    assert_eq!(acks(board.inbox().frames()), before + 1);
    assert!(board.is_in_loader(), "{}", board.diagnosis());
    let hz = board.core_hz()?;
    assert_eq!(hz, subject.model.facts().reset_hz);
    assert_sound(&mut board)
}
