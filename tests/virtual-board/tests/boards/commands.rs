//! Scenarios in which the host sends commands to a streaming board and to an idle one.

use std::collections::HashSet;

use link::{AckResult, ResetInto, Streams, ToDevice};
use virtual_board::{BoardError, Cable, Converters, Kind, VirtualBoard, electrode_ohms};

use crate::images::Subject;
use crate::session::{
    acks, answer, assert_sound, converters, in_time, pick, run_codes, running, start, stats,
    streaming,
};

/// Number of codes after which the device has sent its counters; it sends them once each second.
const A_REPORT: usize = 20;

/// Number of commands that a scenario sends without pause; over the UART they take about 50 ms.
const COMMANDS: u32 = 300;

/// Scenario: while codes stream, the device receives every command once, and either acknowledges it
/// or counts the acknowledgement as dropped.
pub(crate) fn commands_arrive_while_codes_stream(subject: Subject) -> Result<(), BoardError> {
    let mut board = streaming(subject, Streams::CODES)?;
    run_codes(&mut board, A_REPORT)?;
    let before = acks(board.inbox().frames());
    let counted = stats(board.inbox().frames()).expect("a report each second");
    let (commands, dropped) = (counted.commands, counted.frames_dropped);
    for _ in 0..COMMANDS {
        board.send(&ToDevice::Ping);
    }
    run_codes(&mut board, A_REPORT)?;
    let frames = board.inbox().frames();
    let stats = stats(frames).expect("a report each second");
    assert_eq!(stats.input_bad, 0, "damaged commands");
    assert_eq!(stats.commands - commands, COMMANDS, "commands received");
    // The device drops and counts acknowledgements that do not fit into the UART's buffer. USB is
    // fast enough for all of them.
    let answered = u32::try_from(acks(frames) - before).expect("fewer than 2^32");
    let dropped = stats.frames_dropped - dropped;
    assert!(
        answered <= COMMANDS && answered + dropped >= COMMANDS,
        "{answered} answers, {dropped} dropped"
    );
    if subject.cable == Cable::Usb {
        assert_eq!(answered, COMMANDS);
    }
    assert_sound(&mut board)?;
    subject.record("commands_answered", answered);
    Ok(())
}

/// Scenario: the impedance of every electrode is measured. At 500 Hz and more, codes stream
/// meanwhile and no stage is late. At lower rates no codes stream, because the measuring current is
/// inside the EEG's band.
pub(crate) fn impedances_are_measured(subject: Subject) -> Result<(), BoardError> {
    let mut board = running(subject)?;
    let measure = ToDevice::SetImpedance { on: true };
    let streams =
        if subject.converters().rate_hz >= 500 { Streams::CODES } else { Streams::EVENTS };
    assert_eq!(start(&mut board, streams)?, AckResult::Done);
    assert_eq!(answer(&mut board, &measure)?, AckResult::Done);
    board.run_for_us(IMPEDANCES_US)?;
    if streams == Streams::CODES {
        in_time(&board);
    } else {
        assert_eq!(start(&mut board, Streams::CODES)?, AckResult::Busy);
    }
    let impedances = |kind: &Kind| match kind {
        Kind::Impedance(ohms) => Some(ohms.clone()),
        _ => None,
    };
    let found: Vec<_> = pick(board.inbox().frames(), impedances).collect();
    assert!(found.len() >= 2, "{} measurements", found.len());
    let mut worst = 0.0_f64;
    for (channel, ohms) in found.iter().flat_map(|ohms| ohms.iter().enumerate()) {
        let measured = f64::from(ohms.expect("not open"));
        let expected = electrode_ohms(channel);
        let error = (measured - expected).abs();
        assert!(error < 0.05 * expected + NOISE_OHMS, "channel {channel}: {measured} Ohm");
        if expected >= 5_000.0 {
            worst = worst.max(error / expected);
        }
    }
    subject.record("impedance_error_percent", format!("{:.2}", 100.0 * worst));
    assert_sound(&mut board)
}

/// Virtual time in us for two impedance measurements, which take 2 s each at 250 Hz.
const IMPEDANCES_US: u64 = 4_500_000;

/// Five standard deviations of the error, in ohms, that the noise of the synthetic signals causes
/// in a measured impedance. The noise of 74 counts is 1.65 uV RMS, ten times a converter's. The
/// measurement multiplies this noise by `sqrt(2 / 512)`, and 7.64 uV correspond to 1 kOhm.
const NOISE_OHMS: f64 = 70.0;

/// Scenario: a board refuses to start a boot loader that no host can reach.
pub(crate) fn loader_is_refused(subject: Subject) -> Result<(), BoardError> {
    let mut board = running(subject)?;
    let reset = ToDevice::Reset(ResetInto::Bootloader);
    assert_eq!(answer(&mut board, &reset)?, AckResult::NotSupported);
    assert_sound(&mut board)
}

/// Scenario: an image without the measurement of impedances refuses the command for it.
pub(crate) fn impedances_are_refused(subject: Subject) -> Result<(), BoardError> {
    let mut board = running(subject)?;
    let measure = ToDevice::SetImpedance { on: true };
    assert_eq!(answer(&mut board, &measure)?, AckResult::NotSupported);
    assert_sound(&mut board)
}

/// Number of bytes in a million that get a framing error; as many others get a noise error.
/// Together, the errors damage about one command in twenty.
const DAMAGED: u32 = 2_500;

/// Scenario: a byte with a framing or noise error destroys only the command that contains it. The
/// device counts damaged commands, executes no command twice, and continues to receive.
pub(crate) fn damaged_bytes_destroy_only_their_commands(
    subject: Subject,
) -> Result<(), BoardError> {
    let mut board = streaming(subject, Streams::CODES)?;
    run_codes(&mut board, 4)?;
    let before = board.inbox().frames().len();
    board.damage_uart(DAMAGED)?;
    for _ in 0..COMMANDS {
        board.send(&ToDevice::Ping);
    }
    run_codes(&mut board, A_REPORT)?;
    board.damage_uart(0)?;
    let counted = *stats(board.inbox().frames()).expect("a report each second");
    assert!(counted.input_bad > 0, "nothing was damaged: {counted:?}");
    assert!(counted.commands < COMMANDS + 2, "{counted:?}");
    let of = |kind: &Kind| match kind {
        Kind::Ack(ack) => Some(ack.of),
        _ => None,
    };
    let answered: Vec<u32> = pick(&board.inbox().frames()[before..], of).collect();
    let different: HashSet<_> = answered.iter().collect();
    assert_eq!(answered.len(), different.len(), "a command was answered twice");

    let before = acks(board.inbox().frames());
    for _ in 0..20 {
        board.send(&ToDevice::Ping);
    }
    run_codes(&mut board, 8)?;
    assert_eq!(acks(board.inbox().frames()) - before, 20, "acknowledgements after the damage");
    assert_sound(&mut board)?;
    subject.record("commands_damaged", counted.input_bad);
    Ok(())
}

/// Time limit for an answer on an idle line, in us. It covers the transfer of command and answer,
/// and the test's polling interval of 500 us. Most answers would take longer if the conversation
/// task looked for commands only at its tick, every 20 ms.
const ANSWER_US: u64 = 4_000;

/// Asserts that, while nothing streams, each command wakes the device's conversation task at once.
pub(crate) fn assert_idle_board_answers_at_once(
    board: &mut VirtualBoard,
) -> Result<(), BoardError> {
    for _ in 0..20 {
        ping(board, ANSWER_US)?;
        // The interval is no multiple of any period of the firmware, so that commands arrive at
        // varying points of each period.
        board.run_for_us(3_777)?;
    }
    Ok(())
}

/// Sends a `Ping` and waits at most `limit_us` for its acknowledgement.
pub(crate) fn ping(board: &mut VirtualBoard, limit_us: u64) -> Result<(), BoardError> {
    let before = acks(board.inbox().frames());
    board.send(&ToDevice::Ping);
    board.run_until("an answer", limit_us, |frames| acks(frames) > before)
}

/// Returns the longest wait for the result of a self-test, in us. A self-test takes 2.5 s plus the
/// duration of 1,000 samples (docs/bring-up.md).
pub(crate) fn self_test_us(subject: Subject) -> u64 {
    4_000_000 + 1_000_000_000 / u64::from(subject.converters().rate_hz)
}

/// Scenario: the self-test passes for all chips and channels, and afterwards the converters convert
/// again.
pub(crate) fn self_test_passes(subject: Subject) -> Result<(), BoardError> {
    let mut board = running(subject)?;
    board.send(&ToDevice::SelfTest);
    let mut found = None;
    board.run_until("the result of a self-test", self_test_us(subject), |frames| {
        let mut results = pick(frames, |kind| match kind {
            Kind::SelfTest(result) => Some(result),
            _ => None,
        });
        found = results.next().cloned();
        found.is_some()
    })?;
    let result = found.expect("a result");
    assert_eq!(result.fault, "", "{result:?}");
    let Converters { chips, rate_hz, .. } = subject.converters();
    assert_eq!((result.chips.len(), result.channels.len()), (chips, 8 * chips));
    assert_eq!((result.drdy_early, result.drdy_missed), (0, 0));
    let edges = board.converters().ready_edges();
    board.run_for_us(200_000)?;
    assert!(
        board.converters().ready_edges() > edges + u64::from(rate_hz) / 6,
        "the chain converts again"
    );
    assert_eq!(converters(board.inbox().frames()), Some(""));
    assert_sound(&mut board)?;
    subject.record("selftest_ok", true);
    Ok(())
}
