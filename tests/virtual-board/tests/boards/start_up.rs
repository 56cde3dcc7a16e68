//! The start: from power-on until the converters run.

use link::ResetCause;
use virtual_board::{BoardError, Kind, Setup};

use crate::figures::record;
use crate::images::Subject;
use crate::session::{
    UP_US, assert_no_findings, assert_sound, converters, greetings, power_on, running,
};

/// Longest time from power-on to `Hello`, in us of device time. It covers the start of the clocks and the
/// initialisation of the encoder's memory. If the time driver counted a half period that has not passed,
/// the time would be 65,536 us longer.
const HELLO_US: u64 = 20_000;

/// Clocks, port and converters start without violations, and the first frames are complete.
pub(crate) fn starts_up(subject: Subject) -> Result<(), BoardError> {
    let mut board = running(subject)?;
    let frames = board.inbox().frames();
    let hello = &frames[0];
    let Kind::Hello {
        board: name,
        reset_cause,
        fault,
        ..
    } = &hello.kind
    else {
        panic!("the first frame is {hello:?}");
    };
    assert_eq!(
        (name.as_str(), *reset_cause, fault.as_str()),
        (subject.model.name(), ResetCause::PowerOn, "")
    );
    assert!(
        hello.device_us < HELLO_US,
        "Hello at {} us",
        hello.device_us
    );
    let capabilities = frames
        .iter()
        .filter(|frame| frame.kind == Kind::Capabilities);
    assert_eq!(
        capabilities.count(),
        1,
        "Capabilities has 1,074 bytes, more than any buffer of the port"
    );
    for (number, frame) in (0..).zip(frames) {
        assert_eq!(frame.seq, number, "a frame is missing");
    }
    assert_eq!(board.core_hz()?, subject.model.core_hz());
    // SCLK is 100 kHz for registers and 12.8 MHz for samples on the STM32H743, 82 kHz and 10.5 MHz on the
    // STM32F446 (docs/hardware.md). The converters run, so SCLK is that for samples.
    let burst_hz = board.sclk_hz();
    assert!(
        (10_000_000..=20_000_000).contains(&burst_hz),
        "SCLK of {burst_hz} Hz"
    );
    if let Some(baud) = board.port().baud() {
        // Over the ten bits of a byte, sender and ST-LINK may differ by half a bit in total, less a margin
        // for noise: usually 2 % for each of them.
        assert!(baud.abs_diff(921_600) <= 921_600 / 50, "{baud} baud");
        record(subject, "baud", baud);
    }
    record(subject, "booted", true);
    record(subject, "hello_us", board.inbox().frames()[0].device_us);
    record(subject, "violations", board.converters().violations());
    record(subject, "unmapped", board.findings()?.unmapped.len());
    assert_sound(&mut board)
}

/// Without the clock from the ST-LINK, the board runs from its internal oscillator and reports the
/// missing clock.
pub(crate) fn starts_up_without_the_clock(subject: Subject) -> Result<(), BoardError> {
    let setup = Setup {
        clock_hz: 0,
        ..subject.setup()
    };
    let mut board = power_on(subject, &setup)?;
    board.run_until("converters run", UP_US, |frames| {
        converters(frames) == Some("")
    })?;
    let greetings = greetings(board.inbox().frames());
    let (cause, fault) = &greetings[0];
    assert_eq!(*cause, ResetCause::PowerOn);
    assert!(
        fault.contains("8 MHz from the ST-LINK"),
        "Hello reports {fault:?}"
    );
    assert_eq!(board.core_hz()?, subject.model.core_hz());
    assert_no_findings(&mut board)
}
