//! From the application on an emulated microcontroller to a rospy subscriber of a real roscore.
#![forbid(unsafe_code)]

use std::time::{Duration, Instant};

use acceptance::chain::{Chain, Message, NEURO_FRAME_MD5};
use acceptance::{emulator, ros};
use host_sim::synthetic::{Generator, SyntheticSpec};
use link::Flags;

/// Seconds of codes; `CORTICODE_QEMU_SECONDS` asks for more.
const SECONDS: u32 = 12;
/// Codes in a second.
const RATE: u32 = 16;
/// From one code to the next by the device's stamps, microseconds.
const HOP_US: u64 = 62_500;

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
    assert_whole(&messages);
    println!(
        "{test}: {} codes in {:.1} s of the wall, none lost, {:.3} Hz by device stamps",
        messages.len(),
        took.as_secs_f64(),
        rate(&messages)
    );

    let bag = chain.end();
    assert!(bag.contains(NEURO_FRAME_MD5), "{bag}");
}

/// Every code of the stream, each a hop behind the one before, from a network that hears something.
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
        assert_eq!(message.status.device_us() - begin, index * HOP_US);
    }
    for pair in messages.windows(2) {
        assert_ne!(pair[0].values, pair[1].values, "two codes are the same");
        assert!(pair[1].stamp > pair[0].stamp, "stamps go back: {pair:?}");
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
