//! From the image that is flashed, on an emulated board, to a rospy subscriber of a real roscore.
#![forbid(unsafe_code)]

use std::time::{Duration, Instant};

use acceptance::chain::{Chain, NEURO_FRAME_MD5, assert_whole, rate};
use acceptance::{ros, virtual_board};

/// Codes to see: 16 s of the board's time.
const CODES: usize = 256;
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
    // The device's clock counts whole microseconds of its own quartz.
    assert_whole(&messages, 1);
    println!(
        "{test}: {} codes in {:.1} s of the wall, none lost, {:.3} Hz by device stamps",
        messages.len(),
        begin.elapsed().as_secs_f64(),
        rate(&messages)
    );
    let bag = chain.end();
    assert!(bag.contains(NEURO_FRAME_MD5), "{bag}");
}
