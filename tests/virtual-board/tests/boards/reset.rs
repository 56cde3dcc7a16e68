//! Restarts on command of the host.

use link::{ResetCause, ResetInto, Streams, ToDevice};

use virtual_board::BoardError;

use crate::images::Subject;
use crate::session::{acks, assert_sound, greetings, run_codes, running, start, streaming};

/// Longest time from the command to the next `Hello`, in us. It covers 100 ms for the acknowledgement, the
/// start of the clocks, and USB enumeration.
const LONGEST_US: u64 = 1_000_000;

/// The device acknowledges `Reset`, restarts, reports the cause, and streams again.
pub(crate) fn restarts_on_command(subject: Subject) -> Result<(), BoardError> {
    let mut board = streaming(subject, Streams::CODES)?;
    run_codes(&mut board, 4)?;
    board.send(&ToDevice::Reset(ResetInto::Firmware));
    board.run_until("Hello after a Reset", LONGEST_US, |frames| {
        greetings(frames).len() == 2
    })?;
    let (cause, fault) = greetings(board.inbox().frames()).remove(1);
    assert_eq!((cause, fault.as_str()), (ResetCause::Software, ""));
    board.run_for_us(2_000_000)?;
    start(&mut board, Streams::CODES)?;
    run_codes(&mut board, 4)?;
    assert_sound(&mut board)?;
    Ok(())
}

/// The device acknowledges `Reset` into the boot loader. The boot loader then runs with the clocks of the
/// reset state.
pub(crate) fn restarts_into_the_loader(subject: Subject) -> Result<(), BoardError> {
    let mut board = running(subject)?;
    let before = acks(board.inbox().frames());
    board.send(&ToDevice::Reset(ResetInto::Bootloader));
    board.run_for_us(LONGEST_US)?;
    assert_eq!(acks(board.inbox().frames()), before + 1);
    assert!(board.is_in_loader(), "{}", board.diagnosis());
    let hz = board.core_hz()?;
    assert_eq!(hz, subject.model.reset_hz());
    assert_sound(&mut board)?;
    Ok(())
}
