//! Every code of synthetic and of recorded EEG reaches a rospy subscriber of a real roscore, in
//! order and with the right values.

use acceptance::chain::{Chain, Message, NEURO_FRAME_MD5, messages_of};
use acceptance::process::SLACK;
use acceptance::{real_data, ros};
use link::Flags;
use pipeline::{Mains, Pipeline, Sample};

use crate::inputs::{recorded, synthetic};

/// Duration of the EEG that the board encodes in each test, in seconds.
const SECONDS: u32 = 12;

#[test]
fn every_code_of_synthetic_eeg_reaches_rospy() {
    let test = "synthetic EEG to rospy";
    if !ros::available(test) {
        return;
    }
    let input = ["--input=synthetic", "--seed=7"];
    passes(&input, Mains::Hz50, synthetic(7), &[]);
}

#[test]
fn every_code_of_a_gdf_recording_at_512_hz_reaches_rospy() {
    let test = "GDF, 512 Hz, to rospy";
    if !ros::available(test) {
        return;
    }
    let Some(path) = real_data::path(test, real_data::GDF_I16) else {
        return;
    };
    let electrodes: Vec<&str> = model::LABELS.split(' ').collect();
    let samples = recorded(&path);
    let input = format!("--input={}", path.display());
    let missing = real_data::interpolated(&path, &electrodes);
    passes(&[&input, "--mains=60"], Mains::Hz60, samples, &missing);
}

/// Runs the chain with EEG that the arguments `input` of host-sim select, and compares the messages
/// that rospy receives with the codes that the pipeline computes in this process. The messages must
/// name the `interpolated` electrodes.
fn passes(
    input: &[&str],
    mains: Mains,
    samples: impl Iterator<Item = Sample>,
    interpolated: &[String],
) {
    let folder = tempfile::tempdir().expect("a folder");
    let mut chain = Chain::start(folder.path());
    let duration = SECONDS.to_string();
    let mut board = chain.board(&[input, &["--duration", &duration]].concat());

    // While the chain runs, call the commands that a user would probably type first.
    chain.wait_for(16);
    let echo = chain.ros.tool("rostopic", &["echo", "-n1", "/encoded"]);
    assert!(echo.contains("nchannels: 128") && echo.contains("z127"), "{echo}");
    let info = chain.ros.tool("rosservice", &["call", "/acquisition/get_info"]);
    assert!(info.contains("result: True") && info.contains("nchannels: 128"), "{info}");

    let ended = board.wait(SLACK);
    assert!(ended.success(), "{}", board.log());
    let expected = expected_codes(mains, samples);
    let summary = format!("{} codes made, 0 frames dropped", expected.len());
    assert!(board.errors().contains(&summary), "not {summary:?}: {}", board.errors());
    chain.wait_for(expected.len());
    let messages = chain.messages();
    assert_eq!(messages.len(), expected.len(), "messages at the subscriber");
    assert_contract(&messages);
    let transducter = match interpolated {
        [] => "autoencoder".to_owned(),
        labels => format!("autoencoder; interpolated: {}", labels.join(" ")),
    };
    for (message, values) in messages.iter().zip(&expected) {
        assert_eq!(message.transducter, transducter);
        let largest =
            message.values.iter().zip(values).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
        // The tolerance allows for the subscriber's output, which has six decimals of each float32.
        assert!(largest < 2e-5 * values.iter().fold(1.0, |m: f64, x| m.max(x.abs())), "{largest}");
    }
    let bag = chain.stop();
    assert!(bag.contains(NEURO_FRAME_MD5), "{bag}");
    let recorded = format!("{} msgs", expected.len());
    assert!(bag.contains(&recorded), "not {recorded:?} in the recording: {bag}");
}

/// Returns the dequantised codes that the pipeline computes from the first [`SECONDS`] seconds of
/// `samples`.
fn expected_codes(mains: Mains, samples: impl Iterator<Item = Sample>) -> Vec<Vec<f64>> {
    let mut pipeline = Pipeline::new(mains);
    let count = usize::from(model::ADC_RATE_HZ) * usize::try_from(SECONDS).expect("small");
    let codes = samples.take(count).filter_map(|sample| pipeline.encode_sample(&sample));
    let scales = model::CODE_SCALE.iter().zip(&model::CODE_ZERO_POINT);
    let dequantise = |levels: [i32; 128]| {
        let pairs = levels.into_iter().zip(scales.clone());
        pairs
            .map(|(level, (scale, zero))| f64::from(level - i32::from(*zero)) * f64::from(*scale))
            .collect()
    };
    codes.map(|code| dequantise(code.values.levels())).collect()
}

/// Checks that the messages have the form that ROS-Neuro demands, and that no code is lost.
fn assert_contract(messages: &[Message]) {
    let labels: Vec<String> = (0..128).map(|index| format!("z{index:03}")).collect();
    for (index, message) in messages.iter().enumerate() {
        let number = u32::try_from(index).expect("few") + 1;
        assert_eq!((message.seq, message.header_seq), (number, number));
        assert_eq!(message.status.window(), index as u64);
        assert_eq!(message.status.lost, 0);
        assert_eq!(message.status.flags & u64::from(Flags::FILLER.bits()), 0);
        assert_eq!(message.md5, NEURO_FRAME_MD5);
        assert_eq!(message.type_name, "rosneuro_msgs/NeuroFrame");
        assert_eq!(message.sr, 16);
        let eeg = &message.eeg;
        assert_eq!((eeg.nsamples, eeg.nchannels, eeg.stride, eeg.isint), (1, 128, 512, 0));
        assert_eq!((eeg.count, &eeg.labels), (128, &labels));
        assert_eq!((message.exg.nchannels, message.exg.count), (0, 0));
        assert_eq!((message.tri.nchannels, message.tri.count), (8, 8));
        for block in [eeg, &message.exg, &message.tri] {
            assert_eq!((block.minmax.len(), block.labels.len()), (2, usize::from(block.nchannels)));
        }
        let [low, high] = eeg.minmax[..] else { panic!("two bounds") };
        assert!(message.values.iter().all(|value| (low..=high).contains(value)));
    }
    // By device time, consecutive codes are exactly one hop apart: 32 samples at 512 Hz.
    for pair in messages.windows(2) {
        assert_eq!(pair[1].status.device_us() - pair[0].status.device_us(), 62_500);
        assert!(pair[1].stamp > pair[0].stamp, "stamps go back: {pair:?}");
    }
}

#[test]
fn a_restart_of_roscore_loses_no_code() {
    if !ros::available("roscore restart") {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let mut chain = Chain::start(folder.path());
    let _board = chain.board(&["--input=synthetic"]);
    chain.wait_for(48);
    chain.ros.restart_core().expect("a new roscore");
    // A new subscriber registers only with the new master, so it receives codes only after the
    // bridge has registered there, too.
    let mut another = chain.subscriber_of("/encoded");
    another.wait_until("the bridge is registered at the new master", SLACK, |another| {
        messages_of(another).len() >= 16
    });
    let from_new: Vec<u32> = messages_of(&another).iter().map(|message| message.seq).collect();
    assert!(from_new.windows(2).all(|pair| pair[1] == pair[0] + 1), "gaps: {from_new:?}");

    // The first subscriber, which was connected before the restart, must receive all codes up to
    // the newest one that the new subscriber has received.
    let newest = from_new.last().map(|seq| usize::try_from(*seq));
    chain.wait_for(newest.expect("16 codes").expect("few"));
    assert_contract(&chain.messages());
}
