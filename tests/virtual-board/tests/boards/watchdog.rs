//! The watchdog over the whole range of the oscillator that it counts.

use link::{ResetCause, Streams};
use virtual_board::{Injection, Model, Setup, Trouble};

use crate::figures::record;
use crate::images::Subject;
use crate::session::{UP_US, assert_sound, converters, greetings, power_on, start};

/// Slowest and fastest oscillator, Hz (DS12110 and DS10693, LSI characteristics).
const fn range(model: Model) -> [u64; 2] {
    match model {
        Model::H743 => [29_400, 33_600],
        Model::F446 => [17_000, 47_000],
    }
}

/// The watchdog's time at a rate of its oscillator, us: 200 ms at 32 kHz.
const fn watchdog_us(hz: u64) -> u64 {
    200_000 * 32_000 / hz
}

/// How long the tasks may have fed the watchdog after the encoder hangs, us: their progress is looked at every
/// 62.5 ms.
const FED_US: u64 = 62_500;

/// Longest start, with a USB host that enumerates, us.
const START_US: u64 = 500_000;

/// With the fastest oscillator a board that is well is not reset; a hang ends within the watchdog's time at
/// either end of the range, and not before it.
pub(crate) fn watchdog_suits_its_oscillator(subject: Subject) -> Result<(), Trouble> {
    for hz in range(subject.model) {
        let setup = Setup {
            lsi_hz: Some(hz),
            ..subject.setup()
        };
        let mut board = power_on(subject, &setup)?;
        board.run_until("converters run", UP_US, |frames| {
            converters(frames) == Some("")
        })?;
        start(&mut board, Streams::CODES)?;
        board.run_for_us(2_000_000)?;
        assert_eq!(greetings(board.inbox().frames()).len(), 1, "it was reset");
        assert_sound(&mut board)?;

        let at_us = board.now_us();
        board.inject_at("SAI1", Injection::Hang)?;
        let longest_us = watchdog_us(hz) + FED_US + START_US;
        board.run_until("Hello after a hang", longest_us, |frames| {
            greetings(frames).len() == 2
        })?;
        let (cause, _) = greetings(board.inbox().frames()).remove(1);
        assert_eq!(cause, ResetCause::Watchdog);
        let resets = board.findings()?.resets;
        let reset_us = resets.last().expect("it was reset").0;
        // Fed for the last time up to one look before the hang.
        let range_us = watchdog_us(hz).saturating_sub(2 * FED_US)..watchdog_us(hz) + 2 * FED_US;
        let took_us = reset_us - at_us;
        assert!(
            range_us.contains(&took_us),
            "{took_us} us at {hz} Hz, {range_us:?} expected"
        );
        record(subject, &format!("hang_to_reset_us_at_{hz}_hz"), took_us);
    }
    Ok(())
}
