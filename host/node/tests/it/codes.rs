//! Codes of the acquisition's frames are bit for bit those of host-sim.

use bridge_core::Model;
use neuro_ros::DiagnosticLevel;
use pipeline::Mains;

use crate::acquisition::Acquisition;
use crate::harness::{Harness, START, is_filler, word};

/// Encodes `seconds` of an acquisition, and asserts that the codes are those of a recording of it.
/// Returns the harness for further checks.
fn equals_recording(acquisition: &Acquisition, seconds: u32) -> Harness {
    let frames = seconds * u32::from(acquisition.rate_hz) / u32::from(acquisition.samples);
    let expected = acquisition.codes_of_recording(frames, Mains::Hz50);
    let mut harness = Harness::new(&acquisition.frame(0));
    harness.receive_all(acquisition, 1..frames);
    let codes: Vec<&Vec<f32>> = harness
        .recorder
        .encoded
        .iter()
        .map(|f| &f.eeg.data)
        .collect();
    assert!(codes.len() > 8, "only {} codes", codes.len());
    for (window, (code, expected)) in codes.iter().zip(&expected).enumerate() {
        assert_eq!(*code, expected, "window {window}");
    }
    // A live resampler waits until its last block is complete. The resampler of a recording does
    // not, so the live one lacks the codes of up to one and a half blocks.
    let waiting_us = harness.source.block_us() * 3 / 2;
    let missing = expected.len() - codes.len();
    let hop_us = 1_000_000 * model::HOP as u64 / u64::from(model::STEP_RATE_HZ);
    assert!(
        missing as u64 <= waiting_us.div_ceil(hop_us),
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
fn the_frame_that_completes_a_window_publishes_its_code() {
    let acquisition = Acquisition::new(model::ADC_RATE_HZ, 32);
    let mut harness = Harness::new(&acquisition.frame(0));
    for index in 1..40 {
        harness.receive_all(&acquisition, [index]);
        let samples = usize::try_from(index + 1).unwrap() * 32;
        let samples_per_step = usize::from(model::ADC_RATE_HZ / model::STEP_RATE_HZ);
        let is_complete =
            |window: &usize| (window * model::HOP + model::STEPS - 1) * samples_per_step < samples;
        let complete = (0..samples).take_while(is_complete).count();
        assert_eq!(
            harness.recorder.encoded.len(),
            complete,
            "after frame {index}"
        );
    }
}

#[test]
fn codes_of_other_rates_are_those_of_a_recording() {
    for (rate_hz, samples) in [(250, 10), (256, 16), (500, 25), (1000, 50), (1024, 64)] {
        equals_recording(&Acquisition::new(rate_hz, samples), 20);
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
    // An appended h can make the label of another electrode of the 10-5 system: CP1h is not CP1.
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
fn stamps_are_the_times_of_the_windows_also_when_codes_come_in_bursts() {
    for (rate_hz, samples) in [(model::ADC_RATE_HZ, 32), (250, 10)] {
        let acquisition = Acquisition::new(rate_hz, samples);
        let harness = equals_recording(&acquisition, 20);
        let delay_us = u64::from(Mains::Hz50.filter().group_delay_us);
        let frame_us = u64::from(samples) * 1_000_000 / u64::from(rate_hz);
        let hop_ns = 1_000_000_000 * model::HOP as u64 / u64::from(model::STEP_RATE_HZ);
        for (window, frame) in (0_u64..).zip(&harness.recorder.encoded) {
            // The first frame arrived one frame after its first sample was at the electrodes.
            let first_ns = START.wall_ns - i64::try_from((frame_us + delay_us) * 1000).unwrap();
            let expected_ns = first_ns + i64::try_from(window * hop_ns).unwrap();
            let error_ns = frame.header.stamp.nanoseconds() - expected_ns;
            assert!(
                error_ns.abs() < 1_000_000,
                "{rate_hz} Hz, window {window}: {error_ns} ns"
            );
        }
    }
}
