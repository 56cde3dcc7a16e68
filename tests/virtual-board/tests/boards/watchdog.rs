//! The watchdog over the whole range of the oscillator that it counts.

use link::Streams;
use virtual_board::{Injection, Model, Setup};

use crate::figures::record;
use crate::images::Subject;
use crate::session::{assert_sound, greetings, power_on, start};

/// Slowest and fastest oscillator, Hz (DS12110 and DS10693, LSI characteristics).
const fn range(model: Model) -> [u64; 2] {
    match model {
        Model::H743 => [29_400, 33_600],
        Model::F446 => [17_000, 47_000],
    }
}

/// From a hang to the next `Hello`, us: 200 ms at 32 kHz, stretched by the slowest oscillator, half of the
/// feeding's period before, and the start.
const fn longest_us(model: Model) -> u64 {
    let slowest = range(model)[0];
    200_000 * 32_000 / slowest + 62_500 + 500_000
}

/// With the fastest oscillator a board that is well is not reset; with the slowest a hang still ends.
pub(crate) fn watchdog_suits_its_oscillator(subject: Subject) {
    let [slowest, fastest] = range(subject.model);
    let setup = |hz| Setup {
        lsi_hz: Some(hz),
        ..subject.setup()
    };
    let mut board = power_on(subject, &setup(fastest));
    board
        .run_for_us(2_000_000)
        .unwrap_or_else(|trouble| panic!("{trouble}"));
    start(&mut board, Streams::CODES);
    board
        .run_for_us(3_000_000)
        .unwrap_or_else(|trouble| panic!("{trouble}"));
    assert_eq!(greetings(board.inbox().frames()).len(), 1, "it was reset");
    assert_sound(&mut board);

    let mut board = power_on(subject, &setup(slowest));
    board
        .run_for_us(2_000_000)
        .unwrap_or_else(|trouble| panic!("{trouble}"));
    start(&mut board, Streams::CODES);
    board
        .inject_at("SAI1", Injection::Hang)
        .unwrap_or_else(|trouble| panic!("{trouble}"));
    let at_us = board.now_us();
    let back = board.run_until("Hello after a hang", longest_us(subject.model), |frames| {
        greetings(frames).len() == 2
    });
    back.unwrap_or_else(|trouble| panic!("{trouble}"));
    record(
        subject,
        "hang_to_hello_us_slowest_lsi",
        board.now_us() - at_us,
    );
}
