//! Failures, and what the next start reports of them.

use link::{ResetCause, Streams};
use virtual_board::{Injection, Trouble, VirtualBoard};

use crate::figures::record;
use crate::images::Subject;
use crate::session::{assert_no_findings_but, greetings, run_codes, start, streaming};

/// Longest time from a failure to the next `Hello`, us: the watchdog's 200 ms with an oscillator that is
/// slow, and the start.
const LONGEST_US: u64 = 600_000;

/// Lets a failure happen in the encoder's task while codes stream, and returns what the device says of it
/// after its restart.
fn fail(
    subject: Subject,
    injection: Injection,
) -> Result<(VirtualBoard, ResetCause, String), Trouble> {
    let mut board = streaming(subject, Streams::CODES)?;
    run_codes(&mut board, 4)?;
    let at_us = board.now_us();
    // The interrupt in which the encoder runs.
    board.inject_at("SAI1", injection)?;
    board.run_until("Hello after a failure", LONGEST_US, |frames| {
        greetings(frames).len() == 2
    })?;
    println!(
        "{subject}: {injection:?}, back after {} us",
        board.now_us() - at_us
    );
    let (cause, fault) = greetings(board.inbox().frames()).remove(1);
    Ok((board, cause, fault))
}

/// The device streams again after its restart.
fn assert_streams(mut board: VirtualBoard) -> Result<(), Trouble> {
    board.run_for_us(2_000_000)?;
    start(&mut board, Streams::CODES)?;
    run_codes(&mut board, 4)?;
    // A stack that overflows ends below the RAM.
    assert_no_findings_but(&mut board, |access| access.starts_with("0x1fffff"))
}

/// An encoder that does not return: the watchdog resets the chip, and `Hello` says that it did.
pub(crate) fn a_hang_is_ended_by_the_watchdog(subject: Subject) -> Result<(), Trouble> {
    let (board, cause, fault) = fail(subject, Injection::Hang)?;
    assert_eq!((cause, fault.as_str()), (ResetCause::Watchdog, ""));
    assert_streams(board)?;
    record(subject, "reset_cause_hang", true);
    Ok(())
}

/// A panic: `Hello` has its message.
pub(crate) fn a_panic_is_reported_after_the_restart(subject: Subject) -> Result<(), Trouble> {
    let (board, cause, fault) = fail(subject, Injection::Panic)?;
    assert_eq!(cause, ResetCause::Fault);
    assert!(fault.contains("injected.rs:7:3"), "it says {fault:?}");
    assert_streams(board)?;
    record(subject, "reset_cause_panic", true);
    Ok(())
}

/// A jump to where there is no memory: `Hello` has the fault's registers.
pub(crate) fn a_hard_fault_is_reported_after_the_restart(subject: Subject) -> Result<(), Trouble> {
    let (board, cause, fault) = fail(subject, Injection::HardFault)?;
    assert_eq!(cause, ResetCause::Fault);
    assert!(
        fault.contains("hard fault at 0x5fffff"),
        "it says {fault:?}"
    );
    assert_streams(board)?;
    record(subject, "reset_cause_fault", true);
    Ok(())
}

/// A stack pointer among the variables: `Hello` says that it was outside the stack.
pub(crate) fn a_wild_stack_is_reported_after_the_restart(subject: Subject) -> Result<(), Trouble> {
    let (board, cause, fault) = fail(subject, Injection::WildStack)?;
    assert_eq!(cause, ResetCause::Fault);
    assert!(fault.contains("outside the stack"), "it says {fault:?}");
    assert_streams(board)?;
    record(subject, "reset_cause_wild_stack", true);
    Ok(())
}

/// A stack that is used up: `Hello` says so.
pub(crate) fn a_stack_overflow_is_reported_after_the_restart(
    subject: Subject,
) -> Result<(), Trouble> {
    let (board, cause, fault) = fail(subject, Injection::StackOverflow)?;
    assert_eq!(cause, ResetCause::Fault);
    assert!(fault.starts_with("stack overflow"), "it says {fault:?}");
    assert_streams(board)?;
    record(subject, "reset_cause_overflow", true);
    Ok(())
}
