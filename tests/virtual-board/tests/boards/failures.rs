//! Restarts: after failures of the firmware, and on command of the host.

use link::{ResetCause, ResetInto, Streams, ToDevice};
use virtual_board::{BoardError, Injection, VirtualBoard};

use crate::images::Subject;
use crate::session::{
    acks, assert_no_findings_but, assert_sound, greetings, run_codes, run_up, running, start,
    streaming,
};

/// Longest time from a failure to the next `Hello`, in us: the watchdog's 200 ms, the tolerance of
/// its oscillator, and the start.
const LONGEST_US: u64 = 600_000;

/// Longest time from a command to the restarted firmware or the boot loader, in us. It covers 100
/// ms for the acknowledgement, the start of the clocks, and USB enumeration.
const RESET_US: u64 = 1_000_000;

/// Failures in the encoder's task, each with the cause and a part of the fault that `Hello` reports
/// after the restart, and the name of its figure. A hang leaves no fault to report.
const FAILURES: [(Injection, ResetCause, &str, &str); 5] = [
    (Injection::Hang, ResetCause::Watchdog, "", "hang"),
    (
        Injection::Panic,
        ResetCause::Fault,
        "injected.rs:7:3",
        "panic",
    ),
    (
        Injection::HardFault,
        ResetCause::Fault,
        "hard fault at 0x5fffff",
        "fault",
    ),
    (
        Injection::WildStack,
        ResetCause::Fault,
        "outside the stack",
        "wild_stack",
    ),
    (
        Injection::StackOverflow,
        ResetCause::Fault,
        "stack overflow",
        "overflow",
    ),
];

/// After each failure of the encoder's task the chip is reset, the next `Hello` reports what has
/// happened, and the device streams again. The watchdog ends a hang.
pub(crate) fn failures_are_reported_after_the_restart(subject: Subject) -> Result<(), BoardError> {
    let mut board = streaming(subject, Streams::CODES)?;
    // The watchdog starts once every task has made progress.
    run_codes(&mut board, 4)?;
    for (injection, cause, named, key) in FAILURES {
        let before = greetings(board.inbox().frames()).len();
        let at_us = board.now_us();
        // The encode task runs in the interrupt SAI1.
        board.inject_at("SAI1", injection)?;
        board.run_until("Hello after a failure", LONGEST_US, |frames| {
            greetings(frames).len() > before
        })?;
        let took_us = board.now_us() - at_us;
        println!("{subject}: {injection:?}, Hello after {took_us} us");
        let fault = assert_streams_after(&mut board, cause)?;
        assert!(fault.contains(named), "Hello reports {fault:?}");
        assert_eq!(
            fault.is_empty(),
            named.is_empty(),
            "Hello reports {fault:?}"
        );
        if injection == Injection::StackOverflow {
            assert!(fault.starts_with(named), "Hello reports {fault:?}");
        }
        subject.record(&format!("reset_cause_{key}"), true);
    }
    // The injected stack overflow accesses addresses just below the RAM.
    assert_no_findings_but(&mut board, |access| access.starts_with("0x1fffff"))
}

/// Asserts that the newest `Hello` reports `cause` and that the device streams again. Returns the
/// fault that `Hello` reports.
fn assert_streams_after(board: &mut VirtualBoard, cause: ResetCause) -> Result<String, BoardError> {
    let (reported, fault) = greetings(board.inbox().frames()).pop().expect("a Hello");
    assert_eq!(reported, cause, "Hello reports {fault:?}");
    run_up(board)?;
    start(board, Streams::CODES)?;
    run_codes(board, 4)?;
    Ok(fault)
}

/// The device acknowledges `Reset`, restarts, reports the cause, and streams again.
pub(crate) fn restarts_on_command(subject: Subject) -> Result<(), BoardError> {
    let mut board = streaming(subject, Streams::CODES)?;
    run_codes(&mut board, 4)?;
    board.send(&ToDevice::Reset(ResetInto::Firmware));
    board.run_until("Hello after a Reset", RESET_US, |frames| {
        greetings(frames).len() == 2
    })?;
    let fault = assert_streams_after(&mut board, ResetCause::Software)?;
    assert_eq!(fault, "");
    assert_sound(&mut board)
}

/// The device acknowledges `Reset` into the boot loader. The boot loader then runs with the clocks
/// of the reset state.
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
