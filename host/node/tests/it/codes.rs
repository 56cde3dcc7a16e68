//! Codes of the acquisition's frames equal host-sim's codes bit for bit.

use any_model::{any_classifier, any_linear_for, any_packed_of};
use artifact::Artifact;
use artifact::classifier::Decision;
use bridge_core::Model;
use neuro_ros::DiagnosticLevel;
use pipeline::Mains;

use crate::acquisition::Acquisition;
use crate::harness::{Harness, START, is_filler, word};

/// Encodes `seconds` of an acquisition, and asserts that the codes equal those of a recording of
/// the same frames. Returns the harness for further checks.
fn equals_recording(acquisition: &Acquisition, seconds: u32) -> Harness {
    let frames = seconds * u32::from(acquisition.rate_hz) / u32::from(acquisition.samples);
    let expected = acquisition.codes_of_recording(frames, Mains::Hz50);
    let mut harness = Harness::new(&acquisition.frame(0));
    harness.receive_all(acquisition, 1..frames);
    let codes: Vec<&Vec<f32>> = harness.recorder.encoded.iter().map(|f| &f.eeg.data).collect();
    assert!(codes.len() > 8, "only {} codes", codes.len());
    for (window, (code, expected)) in codes.iter().zip(&expected).enumerate() {
        assert_eq!(*code, expected, "window {window}");
    }
    // At the end, a live resampler waits for more samples; a recording's resampler does not.
    let missing = expected.len() - codes.len();
    let hop_us = 1_000_000 * model::HOP as u64 / u64::from(model::STEP_RATE_HZ);
    assert!(
        missing as u64 <= harness.source.delay_us().div_ceil(hop_us),
        "{missing} codes missing"
    );
    for (window, frame) in harness.recorder.encoded.iter().enumerate() {
        assert!(!is_filler(frame), "window {window} is a filler");
        assert_eq!(usize::try_from(word(frame, "seq_lo")), Ok(window));
        assert_eq!(word(frame, "lost"), 0);
    }
    harness
}

#[test]
fn codes_of_frames_at_the_rate_of_the_adc_are_those_of_a_recording() {
    for samples in [32, 1, 7, 64, 512] {
        equals_recording(&Acquisition::new(model::ADC_RATE_HZ, samples), 8);
    }
}

/// Audits compare the codes with those that the batch reference computes with the person's model.
#[test]
fn codes_are_those_of_the_person_s_model_also_after_a_restart_of_the_acquisition() {
    if !model::HAS_SHORTCUT || model::PACKED.is_none() {
        return;
    }
    let built_in = Artifact::from_files(model::artifact_files::FILES).unwrap();
    let packed = any_packed_of(model::PACKED_COEFFICIENTS, 7, &built_in.description);
    let person = any_linear_for(2, &built_in).unwrap();
    let person = person.with_packed(Some(packed)).unwrap();
    let acquisition = Acquisition::new(model::ADC_RATE_HZ, 32);
    let mut harness = Harness::with_person(&acquisition.frame(0), &person);
    let id = person.id.to_string();
    for _ in 0..2 {
        let audits = harness.recorder.audits;
        harness.receive_all(&acquisition, 1..16 * 12);
        assert!(harness.recorder.audits > audits, "no code was compared");
        let device = harness.status("corticode: device");
        assert_ne!(device.level, DiagnosticLevel::Error, "{}", device.message);
        assert!(device.values.iter().any(|value| value.value == id), "{id}");
        // The acquisition starts again.
        harness.receive(&acquisition.frame(0), 1_000_000).unwrap();
    }
    let own = acquisition.codes_of_recording(16 * 12, Mains::Hz50);
    assert_ne!(harness.recorder.encoded[0].eeg.data, own[0]);
}

/// A prediction is computed from the same steps as a code, and comes with the frame that completes
/// its hop.
#[test]
fn each_hop_of_frames_has_the_prediction_of_the_pipeline_s_features() {
    let classifier = any_classifier(model::LABELS.split(' '));
    let acquisition = Acquisition::new(model::ADC_RATE_HZ, 32);
    let first = acquisition.frame(0);
    let mut harness = Harness::with_classifier(&first, Some(classifier.clone()));
    let frames = 16 * 12;
    harness.receive_all(&acquisition, 1..frames);
    let made = &harness.recorder.predictions;
    // The last frame ends three samples after the last step of a hop, so that hop is complete.
    let hops = usize::try_from(frames).unwrap();
    assert_eq!(made.len(), hops);
    let mut decision = Decision::new(&classifier);
    let mut chosen = 0;
    for (features, output) in acquisition.features(frames, &classifier).iter().zip(made) {
        let class = if features.settling {
            decision.skip_hop();
            None
        } else {
            let prediction = decision.add_hop(features.levels());
            prediction.is_settled.then(|| prediction.class())
        };
        assert_eq!(output.softpredict.data, decision.probabilities());
        let expected = [0, 1].map(|of| i32::from(class == Some(of)));
        assert_eq!(output.hardpredict.data, expected);
        chosen += usize::from(class.is_some());
    }
    assert!(chosen > 16, "{chosen}");
}

#[test]
fn the_program_decodes_the_codes_of_the_model_that_it_was_built_with() {
    let acquisition = Acquisition::new(model::ADC_RATE_HZ, model::ADC_RATE_HZ / 16);
    let mut harness = Harness::new(&acquisition.frame(0));
    let decoded = Model::embedded().unwrap();
    assert_eq!(decoded.id(), model::MODEL_ID);
    let labels: Vec<&str> = model::LABELS.split(' ').collect();
    assert_eq!(decoded.electrodes(), labels);
    let device = harness.status("corticode: device");
    assert_ne!(device.level, DiagnosticLevel::Error, "{}", device.message);
    assert!(!device.message.contains("--model"), "{}", device.message);
}

#[test]
fn no_bounds_of_a_delay_are_shown_because_the_device_has_no_clock() {
    let acquisition = Acquisition::new(model::ADC_RATE_HZ, model::ADC_RATE_HZ / 16);
    let mut harness = Harness::new(&acquisition.frame(0));
    // The core would query a board's clock after 2 s, so 5 s show that it does not query this
    // device.
    harness.receive_all(&acquisition, 1..16 * 5);
    let clock = harness.status("corticode: clock");
    let keys: Vec<&str> = clock.values.iter().map(|value| &*value.key).collect();
    assert!(keys.contains(&"drift ppm"), "{keys:?}");
    assert!(!keys.contains(&"round trip us"), "{keys:?}");
}

#[test]
fn the_frame_that_completes_a_window_publishes_its_code_also_when_it_is_resampled() {
    let rate = model::ADC_RATE_HZ;
    let delays = [(rate, 0), (160, 26), (250, 8), (500, 10), (1000, 16), (2000, 32), (5000, 78)];
    for (rate_hz, delay) in delays {
        let samples = rate_hz / 20;
        let acquisition = Acquisition::new(rate_hz, samples);
        let mut harness = Harness::new(&acquisition.frame(0));
        let frame_us = harness.source.layout().frame_us().unsigned_abs();
        let hop_us = 1_000_000 * model::HOP as u64 / u64::from(model::STEP_RATE_HZ);
        let most = usize::try_from(frame_us.div_ceil(hop_us)).unwrap();
        let [rate_hz, adc_rate_hz] = [rate_hz, model::ADC_RATE_HZ].map(usize::from);
        let samples_per_step = usize::from(model::ADC_RATE_HZ / model::STEP_RATE_HZ);
        // Returns the index of the acquisition's last sample that the last step of a window depends
        // on.
        let last = |window: &usize| {
            let step = window * model::HOP + model::STEPS - 1;
            step * samples_per_step * rate_hz / adc_rate_hz + delay
        };
        for index in 1..2 * u32::try_from(rate_hz).unwrap() / u32::from(samples) {
            let before = harness.recorder.encoded.len();
            harness.receive_all(&acquisition, [index]);
            let received = usize::try_from(index + 1).unwrap() * usize::from(samples);
            let complete = (0..received).take_while(|window| last(window) < received).count();
            let codes = harness.recorder.encoded.len();
            assert_eq!(codes, complete, "{rate_hz} Hz, after frame {index}");
            assert!(codes - before <= most, "{rate_hz} Hz: {}", codes - before);
        }
    }
}

#[test]
fn labels_can_have_any_order_and_spelling_and_missing_electrodes_are_announced() {
    let mut acquisition = Acquisition::new(model::ADC_RATE_HZ, 32);
    acquisition.labels.reverse();
    let labels = acquisition.labels.iter().enumerate();
    let spelled = labels.map(|(index, label)| match index % 3 {
        0 => label.to_uppercase(),
        1 => format!("{}.", label.to_lowercase()),
        _ => format!("{label}h"),
    });
    // With an appended h, a label can name another electrode of the 10-5 system: CP1h is not CP1.
    // Such a label keeps its old spelling.
    let spelled: Vec<String> = spelled
        .zip(&acquisition.labels)
        .map(|(spelled, label)| {
            let same =
                recordings::Electrode::parse(&spelled) == recordings::Electrode::parse(label);
            if same { spelled } else { label.clone() }
        })
        .collect();
    acquisition.labels = spelled;
    let missing = acquisition.labels.remove(5);
    acquisition.labels.push("EMG".to_owned());
    let harness = equals_recording(&acquisition, 6);
    let interpolated = harness.source.map().interpolated();
    assert_eq!(interpolated.len(), 1);
    assert_eq!(
        recordings::Electrode::parse(interpolated[0]),
        recordings::Electrode::parse(&missing)
    );
    let transducter = &harness.recorder.encoded[0].eeg.info.transducter;
    let expected = format!("interpolated: {}", interpolated[0]);
    assert!(transducter.contains(&expected), "{transducter}");
}

#[test]
fn codes_and_stamps_of_any_rate_are_those_of_a_recording_whatever_the_resampler_s_delay() {
    let rate = model::ADC_RATE_HZ;
    for rate_hz in [rate, 128, 160, 250, 256, 500, 1000, 1024, 2000, 2048, 5000] {
        let harness = equals_recording(&Acquisition::new(rate_hz, rate_hz / 16), 4);
        let group_delay_us = i64::from(Mains::Hz50.filter().group_delay_us);
        let frame_us = harness.source.layout().frame_us();
        let waits_us = i64::try_from(harness.source.delay_us()).unwrap();
        let hop_us =
            1_000_000 * i64::try_from(model::HOP).unwrap() / i64::from(model::STEP_RATE_HZ);
        for (window, frame) in (0_i64..).zip(&harness.recorder.encoded) {
            // The first frame arrived one frame's duration after the time of its first sample.
            let first_us = START.wall_ns / 1000 - frame_us - group_delay_us;
            let stamp_us = frame.header.stamp.nanoseconds() / 1000;
            let error_us = stamp_us - first_us - window * hop_us;
            // As long as few frames have come, the amplifier's true rate is unknown. A sample is
            // then placed late by up to 4 % of the time from it to the end of the newest frame,
            // divided by the number of frames.
            let frames = ((window + 2) * hop_us + waits_us) / frame_us;
            let late_us = (frame_us + waits_us) / 25 / frames.max(1);
            assert!(
                (-100..100 + late_us).contains(&error_us),
                "{rate_hz} Hz, window {window}: {error_us} us"
            );
        }
    }
}
