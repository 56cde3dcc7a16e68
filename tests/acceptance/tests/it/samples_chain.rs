//! Every raw sample and every filtered step reaches rospy, in order and with the right values.

use acceptance::chain::{Chain, Message, NEURO_FRAME_MD5, messages_of};
use acceptance::process::{Process, SLACK};
use acceptance::ros;
use link::Flags;
use model::{ADC_RATE_HZ, CHANNELS, ELECTRODES, HOP, LSB_NV, STEP_RATE_HZ};
use pipeline::{Mains, Sample};

use crate::inputs::{steps, synthetic};

/// Duration of the EEG that the board samples, in seconds.
const SECONDS: usize = 8;
/// Number of samples in each frame of `/neurodata`, which holds one hop.
const SAMPLES: usize = HOP * ADC_RATE_HZ as usize / STEP_RATE_HZ as usize;
/// Number of levels of a filtered step per count: 2^5, because the step has 5 fraction bits.
const FRACTION: f64 = 32.0;

#[test]
fn samples_and_steps_reach_rospy_together_with_the_codes() {
    if !ros::available("raw samples and filtered steps to rospy") {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let chain = Chain::start_with(folder.path(), &["--streams=codes,raw,filtered"]);
    let mut raw = chain.subscriber_of("/neurodata");
    let mut filtered = chain.subscriber_of("/neurodata_corticode");
    let duration = SECONDS.to_string();
    let mut board = chain.board(&["--input=synthetic", "--seed=7", "--duration", &duration]);
    let ended = board.wait(SLACK);
    assert!(ended.success(), "{}", board.log());
    let summary = board.errors();
    assert!(summary.contains(" 0 frames dropped"), "{summary}");

    let total = SECONDS * usize::from(ADC_RATE_HZ);
    let samples: Vec<Sample> = synthetic(7).take(total).collect();

    let uv = f64::from(LSB_NV) * 1e-3;
    let electrodes = samples.iter().flat_map(|sample| &sample.counts[..ELECTRODES]);
    let expected: Vec<f64> = electrodes.map(|&count| f64::from(count) * uv).collect();
    let messages = all(&mut raw, total / SAMPLES);
    assert_frames(&messages, SAMPLES, ADC_RATE_HZ);
    assert_values(&messages, &expected);
    for message in &messages {
        let spare: Vec<String> = (1..=CHANNELS - ELECTRODES).map(|n| format!("exg{n}")).collect();
        assert_eq!(message.exg.labels, spare);
        assert_eq!(message.exg.count, SAMPLES * spare.len());
    }

    let expected: Vec<f64> = steps(Mains::Hz50, samples.into_iter())
        .flat_map(|step| step.electrodes)
        .map(|value| f64::from(value) * uv / FRACTION)
        .collect();
    let messages = all(&mut filtered, total / SAMPLES);
    assert_frames(&messages, HOP, STEP_RATE_HZ);
    assert_values(&messages, &expected);

    let codes = chain.messages();
    assert!(codes.iter().all(|code| code.status.lost == 0));
    let bag = chain.stop();
    assert!(bag.contains(NEURO_FRAME_MD5), "{bag}");
}

/// Waits until a subscriber has received `count` messages, and returns them.
fn all(subscriber: &mut Process, count: usize) -> Vec<Message> {
    let what = format!("{count} frames of samples");
    subscriber.wait_until(&what, SLACK, |subscriber| subscriber.output().lines().count() > count);
    let messages = messages_of(subscriber);
    assert_eq!(messages.len(), count);
    messages
}

/// Checks that the frames have the form that ROS-Neuro demands: shape, one label per channel, no
/// gap in numbers and times, and no filler.
fn assert_frames(messages: &[Message], nsamples: usize, rate_hz: u16) {
    let labels: Vec<String> = model::LABELS.split(' ').map(str::to_owned).collect();
    for (index, message) in (0..).zip(messages) {
        assert_eq!(message.md5, NEURO_FRAME_MD5);
        assert_eq!(u64::from(message.seq), index + 1);
        assert_eq!((message.sr, message.status.window()), (rate_hz, index));
        assert_eq!(message.status.lost, 0);
        assert_eq!(message.status.flags & u64::from(Flags::FILLER.bits()), 0);
        let eeg = &message.eeg;
        assert_eq!((usize::from(eeg.nsamples), &eeg.labels[..]), (nsamples, &labels[..]));
        assert_eq!((eeg.count, usize::from(eeg.stride)), (nsamples * ELECTRODES, 4 * ELECTRODES));
        assert_eq!(message.tri.count, 8 * nsamples);
        assert_eq!((message.eeg.minmax.len(), message.exg.minmax.len()), (2, 2));
    }
    for pair in messages.windows(2) {
        let period_us = pair[1].status.device_us() - pair[0].status.device_us();
        // Allow 1 us, because the sampling period is not a whole number of microseconds and device
        // times are rounded to microseconds.
        assert!(period_us.abs_diff(62_500) <= 1, "{period_us} us");
        assert!(pair[1].stamp > pair[0].stamp);
    }
}

/// Checks that the values equal `expected` within the rounding to float32 and to the six decimals
/// that the subscriber prints.
fn assert_values(messages: &[Message], expected: &[f64]) {
    let values = messages.iter().flat_map(|message| &message.values);
    let mut count = 0;
    for (value, expected) in values.zip(expected) {
        assert!(
            (value - expected).abs() < 2e-6 + 1e-6 * expected.abs(),
            "{value} instead of {expected} uV"
        );
        count += 1;
    }
    assert_eq!(count, expected.len());
}
