//! Scenario for the watchdog at both ends of its oscillator's frequency range.

use link::{ResetCause, Streams};
use virtual_board::{BoardError, Injection, Model, Setup};

use crate::images::Subject;
use crate::session::{assert_sound, greetings, running_with, start};

/// Returns the lowest and the highest frequency of the watchdog's oscillator in Hz (DS12110 and
/// DS10693, LSI characteristics).
const fn range(model: Model) -> [u64; 2] {
    match model {
        Model::H743 => [29_400, 33_600],
        Model::F446 | Model::Ironbci => [17_000, 47_000],
    }
}

/// Returns the watchdog's timeout in us with its oscillator at `hz`; it is 200 ms at 32 kHz.
const fn watchdog_us(hz: u64) -> u64 {
    200_000 * 32_000 / hz
}

/// Time in us between two checks of the tasks' progress; each check reloads the watchdog.
const FED_US: u64 = 62_500;

/// Time limit from a reset to `Hello` in us, which includes the enumeration of USB.
const START_US: u64 = 500_000;

/// Scenario: at both ends of the oscillator's frequency range, the watchdog does not reset a
/// healthy board, and it resets a hung board after its timeout.
pub(crate) fn watchdog_works_over_the_oscillator_range(subject: Subject) -> Result<(), BoardError> {
    for hz in range(subject.model) {
        let setup = Setup { lsi_hz: Some(hz), ..subject.setup() };
        let mut board = running_with(subject, &setup)?;
        start(&mut board, Streams::CODES)?;
        // Run for one second, several times the watchdog's timeout. The board has already run for
        // about a second since power-on.
        board.run_for_us(1_000_000)?;
        assert_eq!(greetings(board.inbox().frames()).len(), 1, "resets of a healthy board");
        assert_sound(&mut board)?;

        let at_us = board.now_us();
        board.inject_at("I2C3_EV", Injection::Hang)?;
        let longest_us = watchdog_us(hz) + FED_US + START_US;
        board.run_until("Hello after a hang", longest_us, |frames| greetings(frames).len() == 2)?;
        let (cause, _) = greetings(board.inbox().frames()).remove(1);
        assert_eq!(cause, ResetCause::Watchdog);
        let resets = board.findings()?.resets;
        let reset_us = resets.last().expect("a reset").0;
        // The firmware reloads the watchdog for the last time at most one check interval before or
        // after the hang; the range allows two.
        let range_us = watchdog_us(hz).saturating_sub(2 * FED_US)..watchdog_us(hz) + 2 * FED_US;
        let took_us = reset_us - at_us;
        assert!(range_us.contains(&took_us), "{took_us} us at {hz} Hz, {range_us:?} expected");
        subject.record(&format!("hang_to_reset_us_at_{hz}_hz"), took_us);
    }
    Ok(())
}
