//! Scenarios of the USB port: enumeration, opening and closing, pauses, suspend and unplugging.

use link::Streams;
use virtual_board::usb::{Command, State, UsbHost};
use virtual_board::{BoardError, VirtualBoard};

use crate::commands::ping;
use crate::images::Subject;
use crate::session::{assert_no_findings, converters, run_codes, stats, streaming};

/// Time limit in us for the host to open the port, with two bus resets and an enumeration.
const ENUMERATION_US: u64 = 500_000;

/// Time limit from a command to its acknowledgement over USB, in us.
const ANSWER_US: u64 = 200_000;

/// Range and step of the times, in us, for which the cable stays plugged in. The host starts the
/// enumeration after 100 ms of debouncing, so the cable is unplugged at varying points of it.
const EARLY_US: std::ops::Range<u64> = 100_000..240_000;
const EARLY_STEP_US: usize = 17_001;

fn host(board: &VirtualBoard) -> UsbHost {
    board.port().usb().expect("an image with a USB port").clone()
}

/// Runs until the host sees the device in `state`.
fn reach(board: &mut VirtualBoard, state: State) -> Result<(), BoardError> {
    let host = host(board);
    board.run_until(&format!("{state:?}"), ENUMERATION_US, |_| host.state() == state)
}

/// Asserts that the host enumerates a device that has just started, and finds its serial port and
/// its strings.
pub(crate) fn assert_enumerates(board: &mut VirtualBoard) -> Result<(), BoardError> {
    reach(board, State::Open)?;
    let device = host(board).device().expect("a configured device");
    assert_eq!((device.vendor, device.product), (0x1209, 0x0001));
    let strings = [device.manufacturer, device.product_name];
    assert_eq!(strings, ["Corticode", "Corticode"]);
    assert!(device.capabilities.is_some(), "a USB 2.1 device has a BOS descriptor");
    ping(board, ANSWER_US)
}

/// Scenario: the port works again after the host has not read for three seconds, after closing and
/// opening it, and after suspend.
pub(crate) fn works_after_pauses_and_suspend(subject: Subject) -> Result<(), BoardError> {
    let mut board = streaming(subject, Streams::CODES)?;
    run_codes(&mut board, 4)?;
    let host = host(&board);

    host.command(Command::PauseReading(true));
    board.run_for_us(3_000_000)?;
    let codes = board.inbox().codes().count();
    host.command(Command::PauseReading(false));
    run_codes(&mut board, 8)?;
    // The device's count of dropped frames must equal the number of frame numbers that are missing.
    let seqs: Vec<u32> = board.inbox().frames().iter().map(|frame| frame.seq).collect();
    let missing: u32 = seqs.windows(2).map(|pair| pair[1] - pair[0] - 1).sum();
    run_codes(&mut board, 20)?;
    let dropped = stats(board.inbox().frames()).expect("a report").frames_dropped;
    assert_eq!(dropped, missing, "missing frame numbers and dropped frames");
    assert!(board.inbox().codes().count() > codes);
    assert_eq!(board.inbox().decode_errors(), [""; 0]);

    host.command(Command::Open(false));
    reach_without_reopening(&mut board, State::Configured)?;
    host.command(Command::Open(true));
    reach(&mut board, State::Open)?;
    ping(&mut board, ANSWER_US)?;

    host.command(Command::Suspend(true));
    board.run_for_us(1_000_000)?;
    host.command(Command::Suspend(false));
    board.run_for_us(40_000)?;
    ping(&mut board, ANSWER_US)?;
    assert_sound_but_cut_frames(&mut board)?;
    subject.record("usb_outlasts_its_host", true);
    Ok(())
}

/// Scenario: the device is enumerated and answers after unplugging while a packet waits to be read,
/// after unplugging at several points of the enumeration, and after a bus reset.
pub(crate) fn reconnects_after_unplugging(subject: Subject) -> Result<(), BoardError> {
    let mut board = streaming(subject, Streams::CODES)?;
    run_codes(&mut board, 4)?;
    let host = host(&board);
    let answers = |board: &mut VirtualBoard| {
        reach(board, State::Open)?;
        ping(board, ANSWER_US)
    };
    let pull = |board: &mut VirtualBoard, us: u64| {
        host.command(Command::Unplug);
        board.run_for_us(us)?;
        host.command(Command::Plug);
        Ok::<_, BoardError>(())
    };
    host.command(Command::PauseReading(true));
    board.run_for_us(200_000)?;
    pull(&mut board, 500_000)?;
    host.command(Command::PauseReading(false));
    answers(&mut board)?;
    for early_us in EARLY_US.step_by(EARLY_STEP_US) {
        pull(&mut board, 50_000)?;
        board.run_for_us(early_us)?;
        pull(&mut board, 50_000)?;
        answers(&mut board)?;
    }
    host.command(Command::ResetBus);
    board.run_for_us(50_000)?;
    answers(&mut board)?;
    assert_eq!(converters(board.inbox().frames()), Some(""));
    assert_sound_but_cut_frames(&mut board)?;
    subject.record("usb_replugged", true);
    Ok(())
}

/// Runs until the host sees the device in `state`; meanwhile the host does not open the port again.
fn reach_without_reopening(board: &mut VirtualBoard, state: State) -> Result<(), BoardError> {
    let host = host(board);
    board.keep_open(false);
    reach(board, state)?;
    board.run_for_us(300_000)?;
    assert_eq!(host.state(), state);
    board.keep_open(true);
    Ok(())
}

/// Asserts what [`assert_no_findings`] asserts, and that at most three frames cannot be decoded:
/// after the port was closed or unplugged, a packet that waited in the device contains only the end
/// of a frame.
fn assert_sound_but_cut_frames(board: &mut VirtualBoard) -> Result<(), BoardError> {
    assert_no_findings(board)?;
    let bad = board.inbox().decode_errors();
    assert!(bad.len() <= 3, "more than one for each time the port was closed: {bad:?}");
    Ok(())
}
