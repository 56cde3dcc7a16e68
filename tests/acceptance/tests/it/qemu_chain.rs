//! An emulated microcontroller runs the firmware and streams to a rospy subscriber of a real
//! roscore.

use std::time::Duration;

use acceptance::chain::{Chain, NEURO_FRAME_MD5, assert_continuous};
use acceptance::port::free_port;
use acceptance::{emulated_board, ros};
use emulator::installed;

use crate::inputs::synthetic;

/// Duration in seconds of the EEG whose codes must arrive; `CORTICODE_QEMU_SECONDS` overrides it.
const SECONDS: u32 = 12;
/// Number of codes that the board sends per second.
const RATE: u32 = 16;

#[test]
fn every_code_of_an_emulated_microcontroller_reaches_rospy() {
    let test = "emulated microcontroller to rospy";
    if !ros::available(test) || !installed::available(test) {
        return;
    }
    let seconds = std::env::var("CORTICODE_QEMU_SECONDS")
        .map_or(SECONDS, |seconds| seconds.parse().expect("CORTICODE_QEMU_SECONDS is a number"));
    let codes = usize::try_from(seconds * RATE).expect("few");
    let image = emulated_board::image();
    let folder = tempfile::tempdir().expect("a folder");
    let port = free_port().expect("a port");
    let mut chain = Chain::start_at(folder.path(), &format!("tcp:127.0.0.1:{port}"));
    let eeg = synthetic(7).map(|sample| sample.counts);
    let mut board = emulated_board::start(&image, port, folder.path(), eeg);

    chain.wait_for(1);
    std::thread::sleep(Duration::from_secs(seconds.into()));
    chain.wait_for(codes);
    assert!(board.is_running(), "{}", board.log());
    let messages = chain.messages();
    assert!(messages.len() >= codes, "{} of {codes}", messages.len());
    assert_continuous(&messages);
    let bag = chain.stop();
    assert!(bag.contains(NEURO_FRAME_MD5), "{bag}");
}
