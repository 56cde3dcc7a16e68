//! From power on to converters that run.

use link::ResetCause;
use virtual_board::{Kind, Setup, Trouble};

use crate::figures::record;
use crate::images::Subject;
use crate::session::{
    UP_US, assert_no_findings, assert_sound, converters, greetings, power_on, running,
};

/// Longest time from power on to `Hello`, us of the device's clock: clocks and the encoder's memory. An
/// image whose time driver starts half a period ahead says 65,536 more.
const HELLO_US: u64 = 20_000;

/// Clocks, port and converters come up, within their rules, and the first words are complete.
pub(crate) fn starts_up(subject: Subject) -> Result<(), Trouble> {
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
        "1,074 bytes, longer than any buffer of the port"
    );
    for (number, frame) in (0..).zip(frames) {
        assert_eq!(frame.seq, number, "a frame is missing");
    }
    assert_eq!(board.core_hz()?, subject.model.core_hz());
    // 100 kHz and 12.8 MHz, 82 kHz and 10.5 MHz (docs/hardware.md): registers are done, bursts run.
    let burst_hz = board.sclk_hz();
    assert!(
        (10_000_000..=20_000_000).contains(&burst_hz),
        "SCLK of {burst_hz} Hz"
    );
    if let Some(baud) = board.port().baud() {
        // Ten bits of the sender and of the ST-LINK may differ by half a bit, less what noise takes: 2 %
        // for each of them is the usual budget.
        assert!(baud.abs_diff(921_600) <= 921_600 / 50, "{baud} baud");
        record(subject, "baud", baud);
    }
    record(subject, "booted", true);
    record(subject, "hello_us", board.inbox().frames()[0].device_us);
    record(subject, "violations", board.converters().violations());
    record(subject, "unmapped", board.findings()?.unmapped.len());
    assert_sound(&mut board)
}

/// Without the ST-LINK's clock the board runs from its own oscillator and says so.
pub(crate) fn starts_up_without_the_clock(subject: Subject) -> Result<(), Trouble> {
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
        "it says {fault:?}"
    );
    assert_eq!(board.core_hz()?, subject.model.core_hz());
    assert_no_findings(&mut board)
}
