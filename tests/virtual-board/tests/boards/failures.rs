//! Failures of the firmware, and their report after the restart.

use link::{ResetCause, Streams};
use virtual_board::{BoardError, Injection, VirtualBoard};

use crate::figures::record;
use crate::images::Subject;
use crate::session::{assert_no_findings_but, greetings, run_codes, start, streaming};

/// Longest time from a failure to the next `Hello`, in us: the watchdog's 200 ms, the tolerance of
/// its oscillator, and the start.
const LONGEST_US: u64 = 600_000;

/// Injects a failure into the encoder's task while codes stream. Returns the reset cause and the fault that the
/// device reports after the restart.
fn fail(
    subject: Subject,
    injection: Injection,
) -> Result<(VirtualBoard, ResetCause, String), BoardError> {
    let mut board = streaming(subject, Streams::CODES)?;
    run_codes(&mut board, 4)?;
    let at_us = board.now_us();
    // The encode task runs in the interrupt SAI1.
    board.inject_at("SAI1", injection)?;
    board.run_until("Hello after a failure", LONGEST_US, |frames| {
        greetings(frames).len() == 2
    })?;
    println!(
        "{subject}: {injection:?}, Hello after {} us",
        board.now_us() - at_us
    );
    let (cause, fault) = greetings(board.inbox().frames()).remove(1);
    Ok((board, cause, fault))
}

/// Asserts that the device streams again after its restart.
fn assert_streams(mut board: VirtualBoard) -> Result<(), BoardError> {
    board.run_for_us(2_000_000)?;
    start(&mut board, Streams::CODES)?;
    run_codes(&mut board, 4)?;
    // The injected stack overflow accesses addresses just below the RAM.
    assert_no_findings_but(&mut board, |access| access.starts_with("0x1fffff"))
}

/// If the encoder hangs, the watchdog resets the chip, and `Hello` reports this cause.
pub(crate) fn a_hang_is_ended_by_the_watchdog(subject: Subject) -> Result<(), BoardError> {
    let (board, cause, fault) = fail(subject, Injection::Hang)?;
    assert_eq!((cause, fault.as_str()), (ResetCause::Watchdog, ""));
    assert_streams(board)?;
    record(subject, "reset_cause_hang", true);
    Ok(())
}

/// After a panic, `Hello` contains the location of the panic.
pub(crate) fn a_panic_is_reported_after_the_restart(subject: Subject) -> Result<(), BoardError> {
    let (board, cause, fault) = fail(subject, Injection::Panic)?;
    assert_eq!(cause, ResetCause::Fault);
    assert!(fault.contains("injected.rs:7:3"), "Hello reports {fault:?}");
    assert_streams(board)?;
    record(subject, "reset_cause_panic", true);
    Ok(())
}

/// After a jump to an unmapped address, `Hello` reports a hard fault at that address.
pub(crate) fn a_hard_fault_is_reported_after_the_restart(
    subject: Subject,
) -> Result<(), BoardError> {
    let (board, cause, fault) = fail(subject, Injection::HardFault)?;
    assert_eq!(cause, ResetCause::Fault);
    assert!(
        fault.contains("hard fault at 0x5fffff"),
        "Hello reports {fault:?}"
    );
    assert_streams(board)?;
    record(subject, "reset_cause_fault", true);
    Ok(())
}

/// After a fault with a stack pointer outside the stack, `Hello` reports the stray stack pointer.
pub(crate) fn a_stray_stack_pointer_is_reported_after_the_restart(
    subject: Subject,
) -> Result<(), BoardError> {
    let (board, cause, fault) = fail(subject, Injection::WildStack)?;
    assert_eq!(cause, ResetCause::Fault);
    assert!(
        fault.contains("outside the stack"),
        "Hello reports {fault:?}"
    );
    assert_streams(board)?;
    record(subject, "reset_cause_wild_stack", true);
    Ok(())
}

/// After a stack overflow, `Hello` reports the overflow.
pub(crate) fn a_stack_overflow_is_reported_after_the_restart(
    subject: Subject,
) -> Result<(), BoardError> {
    let (board, cause, fault) = fail(subject, Injection::StackOverflow)?;
    assert_eq!(cause, ResetCause::Fault);
    assert!(
        fault.starts_with("stack overflow"),
        "Hello reports {fault:?}"
    );
    assert_streams(board)?;
    record(subject, "reset_cause_overflow", true);
    Ok(())
}
