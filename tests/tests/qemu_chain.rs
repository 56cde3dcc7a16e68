//! From the application on an emulated microcontroller to a rospy subscriber of a real roscore.
#![forbid(unsafe_code)]

use std::time::{Duration, Instant};

use acceptance::chain::{Chain, NEURO_FRAME_MD5, assert_whole, rate};
use acceptance::{emulator, ros};
use host_sim::synthetic::{Generator, SyntheticSpec};

/// Seconds of codes; `CORTICODE_QEMU_SECONDS` asks for more.
const SECONDS: u32 = 12;
/// Codes in a second.
const RATE: u32 = 16;

#[test]
fn an_emulated_microcontroller_streams_to_rospy_code_by_code() {
    let test = "emulated microcontroller to rospy";
    if !ros::available(test) || !emulator::available(test) {
        return;
    }
    let seconds = std::env::var("CORTICODE_QEMU_SECONDS").map_or(SECONDS, |seconds| {
        seconds.parse().expect("CORTICODE_QEMU_SECONDS is a number")
    });
    let codes = usize::try_from(seconds * RATE).expect("few");
    let image = emulator::image();
    let folder = tempfile::tempdir().expect("a folder");
    let port = ros::free_port().expect("a port");
    let mut chain = Chain::start_at(folder.path(), &format!("tcp:127.0.0.1:{port}"));
    let spec = SyntheticSpec::new(7, model::LABELS.split(' '));
    let eeg = Generator::new(&spec).expect("the model's electrodes");
    let mut board = emulator::start(&image, port, folder.path(), eeg);

    chain.wait_for(1);
    let begin = Instant::now();
    std::thread::sleep(Duration::from_secs(seconds.into()));
    chain.wait_for(codes);
    let took = begin.elapsed();
    assert!(board.is_running(), "{}", board.log());
    let messages = chain.heard();
    assert!(messages.len() >= codes, "{} of {codes}", messages.len());
    assert_whole(&messages, 0);
    println!(
        "{test}: {} codes in {:.1} s of the wall, none lost, {:.3} Hz by device stamps",
        messages.len(),
        took.as_secs_f64(),
        rate(&messages)
    );

    let bag = chain.end();
    assert!(bag.contains(NEURO_FRAME_MD5), "{bag}");
}
