//! From the image that is flashed, on an emulated board, to a rospy subscriber of a real roscore.
#![forbid(unsafe_code)]

use std::time::{Duration, Instant};

use acceptance::chain::{Chain, Message, NEURO_FRAME_MD5};
use acceptance::{ros, virtual_board};
use link::Flags;

/// Codes to see: 16 s of the board's time.
const CODES: usize = 256;
/// From one code to the next by the device's stamps, microseconds.
const HOP_US: u64 = 62_500;
/// Real time for them: a busy machine runs a board at a fraction of real time.
const LONGEST: Duration = Duration::from_mins(4);

#[test]
fn the_default_board_streams_over_usb_to_rospy_code_by_code() {
    streams_to_rospy("h743", "NUCLEO-H743ZI2 to rospy");
}

#[test]
fn the_small_board_streams_over_its_uart_to_rospy_code_by_code() {
    streams_to_rospy("f446", "NUCLEO-F446RE to rospy");
}

fn streams_to_rospy(word: &'static str, test: &str) {
    if !ros::available(test) || !virtual_board::available(test) {
        return;
    }
    let board = virtual_board::Board::build(word);
    let folder = tempfile::tempdir().expect("a folder");
    let port = ros::free_port().expect("a port");
    let chain = Chain::start_at(folder.path(), &format!("tcp:127.0.0.1:{port}"));
    let mut board = board.start(port, folder.path());

    let begin = Instant::now();
    while chain.heard().len() < CODES && begin.elapsed() < LONGEST && board.is_running() {
        std::thread::sleep(Duration::from_millis(500));
    }
    let messages = chain.heard();
    assert!(board.is_running(), "{}", board.log());
    assert!(
        messages.len() >= CODES,
        "{} of {CODES} codes\n{}",
        messages.len(),
        board.log()
    );
    assert_whole(&messages);
    println!(
        "{test}: {} codes in {:.1} s of the wall, none lost, {:.3} Hz by device stamps",
        messages.len(),
        begin.elapsed().as_secs_f64(),
        rate(&messages)
    );
    let bag = chain.end();
    assert!(bag.contains(NEURO_FRAME_MD5), "{bag}");
}

/// Every code of the stream, each a hop after the one before, with nothing wrong in it.
fn assert_whole(messages: &[Message]) {
    let begin = messages[0].status.device_us();
    let bad = [Flags::FILLER, Flags::OVERRUN, Flags::ADC_STATUS_BAD];
    for (index, message) in (0..).zip(messages) {
        assert_eq!(message.md5, NEURO_FRAME_MD5);
        assert_eq!((message.sr, message.eeg.nchannels), (16, 128));
        assert_eq!(u64::from(message.seq), index + 1);
        assert_eq!(message.status.window(), index, "a gap");
        assert_eq!(message.status.lost, 0);
        let flags = message.status.flags;
        assert!(
            bad.iter().all(|bad| flags & u64::from(bad.bits()) == 0),
            "{flags:#b}"
        );
        // The device's clock counts its own quartz; a converter's sample is 1,953.125 us.
        let off = (message.status.device_us() - begin).abs_diff(index * HOP_US);
        assert!(off <= 1, "code {index} is {off} us off");
    }
}

/// Codes per second, by the stamps of the first and the last.
#[expect(clippy::cast_precision_loss, reason = "microseconds of minutes")]
fn rate(messages: &[Message]) -> f64 {
    let time = |message: &Message| message.status.device_us() as f64 * 1e-6;
    let [first, .., last] = messages else {
        return f64::NAN;
    };
    (messages.len() - 1) as f64 / (time(last) - time(first))
}
