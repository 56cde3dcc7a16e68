//! Frames that cannot be encoded are refused, with a reason that names the value and the remedy.

use neuro_ros::{NeuroDataFloat, NeuroFrame};
use node::{Refusal, Source};
use pipeline::Mains;

use crate::acquisition::Acquisition;
use crate::harness::Harness;

/// Returns why a first frame is refused. `change` makes the only change to a valid frame.
fn refusal(change: impl FnOnce(&mut NeuroFrame)) -> Refusal {
    let mut frame = Acquisition::new(512, 32).frame(0);
    change(&mut frame);
    match Source::new(&frame, Mains::Hz50, 1) {
        Ok(_) => panic!("not refused"),
        Err(refusal) => refusal,
    }
}

fn assert_names(refusal: &Refusal, kind: &str, parts: &[&str]) {
    let text = refusal.to_string();
    assert_eq!(refusal.kind(), kind, "{text}");
    for part in parts {
        assert!(text.contains(part), "no {part:?} in {text:?}");
    }
}

#[test]
fn a_first_frame_with_a_wrong_rate_shape_unit_value_or_labels_is_refused() {
    for rate_hz in [0, model::STEP_RATE_HZ - 1] {
        let named = format!("{rate_hz} Hz");
        let refusal = refusal(|frame| frame.sr = rate_hz);
        assert_names(&refusal, "rate", &[&named, "at least 128 Hz"]);
    }
    let short = refusal(|frame| frame.eeg.data.truncate(5));
    assert_names(&short, "shape", &["32 samples", "one label per channel"]);
    let unlabelled = refusal(|frame| frame.eeg.info.labels.truncate(5));
    assert_names(&unlabelled, "shape", &["labels"]);
    let empty = refusal(|frame| frame.eeg = NeuroDataFloat::default());
    assert_names(&empty, "shape", &["0 samples of 0 channels"]);
    let unit = refusal(|frame| "mV".clone_into(&mut frame.eeg.info.unit));
    assert_names(&unit, "unit", &["mV", "uV"]);
    let infinite = refusal(|frame| frame.eeg.data[frame.eeg.info.labels.len()] = f32::INFINITY);
    let first = model::LABELS.split(' ').next().unwrap();
    assert_names(&infinite, "not finite", &["sample 1", first, "inf"]);
    let strange = refusal(|frame| {
        for (index, label) in frame.eeg.info.labels.iter_mut().enumerate() {
            *label = format!("ch{index}");
        }
    });
    assert_names(&strange, "labels", &["ch0", "needed are"]);
}

#[test]
fn a_layout_that_changes_in_mid_stream_is_refused_and_the_old_one_goes_on() {
    let acquisition = Acquisition::new(512, 32);
    let mut harness = Harness::new(&acquisition.frame(0));
    let mut other = acquisition.clone();
    other.labels.swap(0, 1);
    let changes = [
        (Acquisition::new(500, 32), "the rate in Hz changed from 512 to 500"),
        (Acquisition::new(512, 16), "the samples per frame changed from 32 to 16"),
        (other, "a label changed from"),
    ];
    for (acquisition, expected) in changes {
        let refusal = harness.receive(&acquisition.frame(1), 62_500).unwrap_err();
        assert_names(&refusal, "changed layout", &[expected, "restart this node"]);
    }
    harness.receive_all(&acquisition, 1..10);
    assert_eq!(harness.source.counts().lost, 0);
    let repeated = harness.receive(&acquisition.frame(9), 62_500).unwrap_err();
    assert_names(&repeated, "repeated", &["frame 10"]);
}
