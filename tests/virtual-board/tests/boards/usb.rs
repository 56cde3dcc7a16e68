//! The USB port: a host that opens, closes, looks away, suspends and unplugs.

use link::{Streams, ToDevice};
use virtual_board::usb::{State, UsbHost};
use virtual_board::{Trouble, VirtualBoard};

use crate::figures::record;
use crate::images::Subject;
use crate::session::{
    acks, assert_no_findings, assert_sound, converters, power_on, run_codes, running, start,
    streaming,
};

/// Longest time for debouncing, two resets and an enumeration, us.
const ENUMERATION_US: u64 = 500_000;

/// Longest time for an answer, us.
const ANSWER_US: u64 = 200_000;

/// Times between plug and unplug while the device is being set up, us.
const EARLY_US: std::ops::Range<u64> = 100_000..240_000;
const EARLY_STEP_US: usize = 17_001;

fn host(board: &VirtualBoard) -> UsbHost {
    board
        .port()
        .usb()
        .expect("this image talks over USB")
        .clone()
}

/// Runs until the host has got so far with the device.
fn reach(board: &mut VirtualBoard, state: State) -> Result<(), Trouble> {
    let host = host(board);
    board.run_until(&format!("{state:?}"), ENUMERATION_US, |_| {
        host.state() == state
    })
}

/// The device answers a command.
fn assert_answers(board: &mut VirtualBoard) -> Result<(), Trouble> {
    let before = acks(board.inbox().frames());
    board.send(&ToDevice::Ping);
    board.run_until("an answer", ANSWER_US, |frames| acks(frames) > before)?;
    Ok(())
}

/// The host enumerates the device as Linux and Windows do, and finds a serial port that it knows.
pub(crate) fn enumerates(subject: Subject) -> Result<(), Trouble> {
    let mut board = power_on(subject, &subject.setup())?;
    reach(&mut board, State::Open)?;
    let device = host(&board).device().expect("it is configured");
    assert_eq!((device.vendor, device.product), (0x1209, 0x0001));
    let strings = [device.manufacturer, device.product_name];
    assert_eq!(strings, ["Corticode", "Corticode"]);
    assert!(
        device.capabilities.is_some(),
        "a device of USB 2.10 has a BOS descriptor"
    );
    assert_answers(&mut board)?;
    assert_sound(&mut board)?;
    record(subject, "usb_enumerates", true);
    Ok(())
}

/// Codes go on after the port was closed and opened, after a host that read nothing for three seconds, and
/// after a bus that was suspended.
pub(crate) fn outlasts_its_host(subject: Subject) -> Result<(), Trouble> {
    let mut board = streaming(subject, Streams::CODES)?;
    run_codes(&mut board, 4)?;
    let host = host(&board);

    host.stall(true);
    board.run_for_us(3_000_000)?;
    let codes = board.inbox().codes().count();
    host.stall(false);
    run_codes(&mut board, 8)?;
    // What was dropped is counted: numbers of frames that are missing, and the device's own count.
    let seqs: Vec<u32> = board
        .inbox()
        .frames()
        .iter()
        .map(|frame| frame.seq)
        .collect();
    let missing: u32 = seqs.windows(2).map(|pair| pair[1] - pair[0] - 1).sum();
    run_codes(&mut board, 20)?;
    let dropped = crate::session::stats(board.inbox().frames())
        .expect("a report")
        .frames_dropped;
    assert_eq!(
        dropped, missing,
        "frames that the host missed and frames that the device dropped"
    );
    assert!(board.inbox().codes().count() > codes);
    assert_eq!(board.inbox().bad(), [""; 0]);

    host.close();
    reach_without_reopening(&mut board, State::Configured)?;
    host.open();
    reach(&mut board, State::Open)?;
    assert_answers(&mut board)?;

    host.suspend();
    board.run_for_us(1_000_000)?;
    host.resume();
    board.run_for_us(40_000)?;
    assert_answers(&mut board)?;
    assert_sound_but_cut_frames(&mut board)?;
    record(subject, "usb_outlasts_its_host", true);
    Ok(())
}

/// Unplugged while it sends, with a packet waiting that nobody takes, and while it is set up: each time it is
/// enumerated again and answers.
pub(crate) fn comes_back_when_it_is_replugged(subject: Subject) -> Result<(), Trouble> {
    let mut board = running(subject)?;
    start(&mut board, Streams::CODES)?;
    run_codes(&mut board, 4)?;
    let host = host(&board);
    host.stall(true);
    board.run_for_us(200_000)?;
    host.unplug();
    board.run_for_us(500_000)?;
    host.stall(false);
    host.plug();
    reach(&mut board, State::Open)?;
    assert_answers(&mut board)?;

    for early_us in EARLY_US.step_by(EARLY_STEP_US) {
        host.unplug();
        board.run_for_us(50_000)?;
        host.plug();
        board.run_for_us(early_us)?;
        host.unplug();
        board.run_for_us(50_000)?;
        host.plug();
        reach(&mut board, State::Open)?;
        assert_answers(&mut board)?;
    }
    host.reset_bus();
    board.run_for_us(50_000)?;
    reach(&mut board, State::Open)?;
    assert_answers(&mut board)?;
    assert_eq!(converters(board.inbox().frames()), Some(""));
    assert_sound_but_cut_frames(&mut board)?;
    record(subject, "usb_replugged", true);
    Ok(())
}

/// Closes without the harness opening the port again at once.
fn reach_without_reopening(board: &mut VirtualBoard, state: State) -> Result<(), Trouble> {
    let host = host(board);
    board.keep_open(false);
    reach(board, state)?;
    board.run_for_us(300_000)?;
    assert_eq!(host.state(), state);
    board.keep_open(true);
    Ok(())
}

/// As [`assert_sound`](crate::session::assert_sound), but for the end of a frame whose beginning an earlier
/// opening of the port had: a packet that waited while the port was closed or unplugged.
fn assert_sound_but_cut_frames(board: &mut VirtualBoard) -> Result<(), Trouble> {
    assert_no_findings(board)?;
    let bad = board.inbox().bad();
    assert!(bad.len() <= 3, "one for each closing at most: {bad:?}");
    Ok(())
}
