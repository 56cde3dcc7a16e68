//! Virtual boards run the images for the NUCLEO boards and stream to a rospy subscriber of a real
//! roscore.

use std::time::{Duration, Instant};

use acceptance::chain::{Chain, NEURO_FRAME_MD5, assert_continuous, rate};
use acceptance::port::free_port;
use acceptance::{ros, virtual_board};

/// Number of codes that the test receives, 4 s of device time. It checks that each follows the one
/// before; the scenarios of `tests/virtual-board` compare 256 codes with those of host-sim.
const CODES: usize = 64;
/// Longest wall-clock wait for all codes: on a busy machine a board runs slower than in real time.
const TIMEOUT: Duration = Duration::from_mins(4);

#[test]
fn every_code_of_the_default_board_reaches_rospy_over_usb() {
    streams_to_rospy("h743", "NUCLEO-H743ZI2 to rospy");
}

#[test]
fn every_code_of_the_small_board_reaches_rospy_over_its_uart() {
    streams_to_rospy("f446", "NUCLEO-F446RE to rospy");
}

fn streams_to_rospy(name: &'static str, test: &str) {
    if !ros::available(test) || !virtual_board::available(test) {
        return;
    }
    let board = virtual_board::Board::build(name);
    let folder = tempfile::tempdir().expect("a folder");
    let port = free_port().expect("a port");
    let chain = Chain::start_at(folder.path(), &format!("tcp:127.0.0.1:{port}"));
    let mut board = board.start(port, folder.path());

    let start = Instant::now();
    while chain.messages().len() < CODES && start.elapsed() < TIMEOUT && board.is_running() {
        std::thread::sleep(Duration::from_millis(500));
    }
    let messages = chain.messages();
    assert!(board.is_running(), "{}", board.log());
    assert!(
        messages.len() >= CODES,
        "{} of {CODES} codes\n{}",
        messages.len(),
        board.log()
    );
    // The tolerance is 1 us, because the board rounds device times to whole microseconds of its
    // clock.
    assert_continuous(&messages, 1);
    println!(
        "{test}: {} codes in {:.1} s of wall time, none lost, {:.3} Hz by device time",
        messages.len(),
        start.elapsed().as_secs_f64(),
        rate(&messages)
    );
    let bag = chain.stop();
    assert!(bag.contains(NEURO_FRAME_MD5), "{bag}");
}
