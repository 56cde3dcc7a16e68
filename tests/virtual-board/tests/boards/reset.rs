//! Restarts that the host asks for.

use link::{ResetCause, ResetInto, Streams, ToDevice};

use virtual_board::Trouble;

use crate::images::Subject;
use crate::session::{acks, assert_sound, greetings, run_codes, running, start, streaming};

/// Longest time from the command to the next `Hello`, us: a tenth of a second for the answer, clocks, and a
/// USB host that enumerates.
const LONGEST_US: u64 = 1_000_000;

/// The device answers, restarts, says why, and streams again.
pub(crate) fn restarts_on_command(subject: Subject) -> Result<(), Trouble> {
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

/// The device answers, restarts, and runs the chip's own loader, with the clocks that a reset leaves.
pub(crate) fn restarts_into_the_loader(subject: Subject) -> Result<(), Trouble> {
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
