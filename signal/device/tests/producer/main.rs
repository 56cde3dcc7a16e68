//! Outputs of the producer for complete sequences of samples and for sequences with gaps.

use device::{
    AcquiredSample, BothEncoders, CapturedEvent, Encoders, Marks, Output, Payload, Producer, Run,
    streams_with,
};
use link::{BlockForm, EventKind, ExclusionPolicy, Flags, RAW_SAMPLES, Streams};
use model::{ADC_RATE_HZ, CELLS, HAS_NETWORK, HOP, PACKED, STEP_RATE_HZ, STEPS, SUBSTITUTION};
use pipeline::{
    Acquisition, Code, EncoderMemory, FeatureFilters, Mains, PackedMemory, Sample, Step,
};

mod packed;

/// Number of ADC samples per step.
const PER_STEP: u64 = model::ADC_RATE_HZ as u64 / model::STEP_RATE_HZ as u64;

const OVERRUN: Marks = Marks { overrun: true, ..Marks::NONE };

fn run(number: u32, streams: Streams) -> Run {
    Run { number, streams, ..Run::NONE }
}

/// Returns the index of the sample that carries step `step` of a run.
fn sample_of(step: u64) -> u64 {
    step * u64::from(model::ADC_RATE_HZ) / u64::from(model::STEP_RATE_HZ)
}

/// Returns the device time of sample `index` of a run that starts at 0.
fn drdy_us(index: u64) -> u64 {
    index * 1_000_000 / u64::from(model::ADC_RATE_HZ)
}

/// Returns the device time of step `step` of a run that starts at 0.
fn step_us(step: u64) -> u64 {
    step * 1_000_000 / u64::from(model::STEP_RATE_HZ)
}

/// Returns sample `index` of a run, with its step if one is due.
fn acquired(index: u64) -> AcquiredSample {
    let (adc_hz, step_hz) = (model::ADC_RATE_HZ, model::STEP_RATE_HZ);
    let number = (index * u64::from(step_hz)).div_ceil(u64::from(adc_hz));
    let mut acquired = AcquiredSample {
        index,
        step_index: number,
        drdy_us: drdy_us(index),
        ..AcquiredSample::default()
    };
    acquired.sample.counts[5] = i32::try_from(index).expect("few");
    if sample_of(number) == index {
        let plane = core::array::from_fn(|cell| {
            let [value, ..] = (number * 37 + cell as u64 * 11).to_le_bytes();
            value.cast_signed()
        });
        acquired.step = Some(Step {
            sample: index,
            offset_us: u16::try_from(step_us(number) - drdy_us(index)).expect("short"),
            plane,
            ..Step::SILENCE
        });
    }
    acquired
}

/// Copies an output and leaks the copy, so that it outlives the producer.
fn keep(output: Output<'_>) -> Output<'static> {
    fn leak<T: Copy>(content: &T) -> &'static T {
        Box::leak(Box::new(*content))
    }
    Output {
        run: output.run,
        at_us: output.at_us,
        payload: match output.payload {
            Payload::Code(code, marks) => Payload::Code(leak(code), marks),
            Payload::PackedCode(code, marks) => Payload::PackedCode(leak(code), marks),
            Payload::Features(features, marks) => Payload::Features(leak(features), marks),
            Payload::Event(event) => Payload::Event(event),
            Payload::Exclusion(exclusion) => Payload::Exclusion(exclusion),
            Payload::Quality(quality) => Payload::Quality(leak(quality)),
            Payload::Raw(samples) => Payload::Raw(leak(samples)),
            Payload::CompressedRaw(samples) => Payload::CompressedRaw(leak(samples)),
            Payload::Filtered(steps) => Payload::Filtered(leak(steps)),
            Payload::Audit(window) => Payload::Audit(leak(window)),
            Payload::Impedance(impedance) => Payload::Impedance(leak(impedance)),
        },
    }
}

/// Returns a filter of one electrode, with a band-pass that differentiates twice.
fn filters() -> FeatureFilters {
    let mut weights = [0; model::ELECTRODES];
    weights[3] = 1;
    FeatureFilters::new(7, [[1 << 32, 0, 0]; 2], &weights).expect("a filter in range")
}

/// Returns the outputs of a new producer for `samples`. Automatic exclusion is off, so that no
/// electrode is excluded whatever the signal, and exclusion reports are left out, because a model
/// without a table sends none.
fn outputs_of(samples: impl IntoIterator<Item = AcquiredSample>) -> Vec<Output<'static>> {
    let mut producer = Box::new(Producer::new(BothEncoders::EMPTY));
    producer.set_filters(filters());
    producer.set_exclusion(ExclusionPolicy { automatic: false, ..ExclusionPolicy::AUTOMATIC });
    let mut outputs = Vec::new();
    for sample in samples {
        producer.process(&sample, &mut |output| outputs.push(keep(output)));
    }
    outputs.retain(|output| !matches!(output.payload, Payload::Exclusion(_)));
    outputs
}

/// Returns the samples of a run without the `lost` ones. The first remaining sample starts the run;
/// a sample directly after a lost one reports the loss.
fn samples(streams: Streams, count: u64, lost: &[u64]) -> impl Iterator<Item = AcquiredSample> {
    let remaining = (0..count).filter(move |index| !lost.contains(index));
    remaining.enumerate().map(move |(place, index)| AcquiredSample {
        new_run: (place == 0).then(|| run(1, streams)),
        lost: if index > 0 && lost.contains(&(index - 1)) { OVERRUN } else { Marks::NONE },
        ..acquired(index)
    })
}

/// Returns the index of the first sample, the number of samples and the flags of every raw output.
fn raw_frames(outputs: &[Output<'_>]) -> Vec<(u64, usize, Flags)> {
    let raw = outputs.iter().filter_map(|output| match &output.payload {
        Payload::Raw(raw) => Some(raw.message()),
        _ => None,
    });
    raw.map(|raw| {
        let samples: Vec<i32> = raw.counts().skip(5).step_by(model::CHANNELS).collect();
        let first = i32::try_from(raw.first_sample).expect("few");
        assert!((first..).zip(&samples).all(|(due, count)| due == *count));
        (raw.first_sample, samples.len(), raw.flags)
    })
    .collect()
}

/// Returns code, time and faults of every output that is a code.
fn codes<'o>(outputs: &[Output<'o>]) -> Vec<(&'o Code, u64, Marks)> {
    let codes = outputs.iter().filter_map(|output| match output.payload {
        Payload::Code(code, marks) => Some((code, output.at_us, marks)),
        _ => None,
    });
    codes.collect()
}

#[test]
fn a_run_produces_exactly_the_requested_streams() {
    let kinds = |streams| {
        let mut kinds = outputs_of(samples(streams, 2 * 512, &[]))
            .iter()
            .map(|output| match output.payload {
                Payload::Code(..) => Streams::CODES,
                Payload::PackedCode(..) => Streams::PACKED,
                Payload::Raw(_) => Streams::RAW,
                Payload::CompressedRaw(_) => Streams::COMPRESSED_RAW,
                Payload::Features(..) => Streams::FEATURES,
                Payload::Filtered(_) => Streams::FILTERED,
                Payload::Audit(_) => Streams::AUDIT,
                _ => Streams::empty(),
            })
            .collect::<Vec<_>>();
        kinds.retain(|kind| !kind.is_empty());
        kinds.dedup();
        kinds
    };
    for one in [
        Streams::CODES,
        Streams::RAW,
        Streams::COMPRESSED_RAW,
        Streams::FILTERED,
        Streams::AUDIT,
        Streams::PACKED,
        Streams::FEATURES,
    ] {
        assert_eq!(kinds(one), [one]);
    }
    assert_eq!(kinds(Streams::EVENTS), []);
    assert!(kinds(Streams::ALL).len() > 5);
}

/// Features have the faults of their own hop, the filters' id, and the time of the hop's last step.
#[test]
fn a_lost_sample_marks_the_features_of_its_hop_alone() {
    let samples_per_hop = HOP as u64 * PER_STEP;
    let lost = samples_per_hop + 5;
    let outputs = outputs_of(samples(Streams::FEATURES, 3 * samples_per_hop, &[lost]));
    let made = outputs.iter().map(|output| match output.payload {
        Payload::Features(features, marks) => {
            let last = (u64::from(features.hop) + 1) * HOP as u64 - 1;
            assert_eq!((features.id, output.at_us), (7, step_us(last)));
            (features.hop, marks.overrun)
        }
        other => panic!("{other:?}"),
    });
    assert!(made.eq([(0, false), (1, true), (2, false)]));
}

#[test]
fn compressed_samples_need_no_past_after_a_lost_sample_and_every_quarter_of_a_second() {
    let samples = samples(Streams::COMPRESSED_RAW, 8 * 40, &[83]);
    let forms: Vec<(u64, u8, BlockForm)> = outputs_of(samples)
        .iter()
        .filter_map(|output| match &output.payload {
            Payload::CompressedRaw(raw) => Some(raw.message()),
            _ => None,
        })
        .map(|raw| (raw.first_sample, raw.samples, raw.form))
        .collect();
    let keys: Vec<(u64, u8)> = forms
        .iter()
        .filter(|(.., form)| *form == BlockForm::Key)
        .map(|(first, samples, _)| (*first, *samples))
        .collect();
    assert_eq!(keys, [(0, 8), (84, 8), (84 + 128, 8)]);
    assert_eq!(forms[10], (80, 3, BlockForm::Continuing));
}

#[test]
fn a_raw_frame_ends_before_a_lost_sample_and_the_next_one_starts_after_it() {
    let outputs = outputs_of(samples(Streams::RAW, 32, &[11, 12]));
    let whole = RAW_SAMPLES;
    assert_eq!(
        raw_frames(&outputs),
        [
            (0, whole, Flags::empty()),
            (8, 3, Flags::empty()),
            (13, whole, Flags::OVERRUN),
            (21, whole, Flags::empty()),
        ]
    );
    let times: Vec<u64> = outputs.iter().map(|output| output.at_us).collect();
    assert_eq!(times, [7, 10, 20, 28].map(drdy_us), "the time of each frame's last sample");
}

#[test]
fn a_filtered_frame_ends_before_a_lost_step_and_has_the_flags_of_all_its_samples() {
    // The sample with step 5 is lost, and a sample between steps 8 and 9 has a bad status word.
    let mut input: Vec<AcquiredSample> = samples(Streams::FILTERED, 64, &[sample_of(5)]).collect();
    for acquired in &mut input {
        acquired.marks.adc_status_bad = acquired.index == sample_of(8) + 1;
    }
    let found = outputs_of(input);
    let filtered = found.iter().filter_map(|output| match &output.payload {
        Payload::Filtered(steps) => Some(steps.message()),
        _ => None,
    });
    let filtered: Vec<_> = filtered
        .map(|steps| {
            let count = steps.values().count() / model::ELECTRODES;
            (steps.first_step, count, steps.flags)
        })
        .collect();
    let none = Flags::empty();
    assert_eq!(
        filtered,
        [(0, 4, none), (4, 1, none), (6, 4, Flags::OVERRUN | Flags::ADC_STATUS_BAD), (10, 4, none),]
    );
}

#[test]
fn lost_steps_shift_no_window_and_mark_the_codes_that_contain_them() {
    let lost = [20, 21].map(sample_of);
    let count = (STEPS + 4 * HOP) as u64 * PER_STEP;
    let outputs = outputs_of(samples(Streams::CODES, count, &lost));
    let codes = codes(&outputs).into_iter();
    let codes: Vec<(u32, u64, bool)> =
        codes.map(|(code, at_us, marks)| (code.window, at_us, marks.overrun)).collect();
    let end = |window: u64| step_us(window * HOP as u64 + STEPS as u64 - 1);
    let steps = |window: u64| window * HOP as u64..window * HOP as u64 + STEPS as u64;
    let due: Vec<(u32, u64, bool)> = (0..5)
        .map(|window| {
            let number = u32::try_from(window).expect("few");
            let is_marked = [20, 21].iter().any(|step| steps(window).contains(step));
            (number, end(window), is_marked)
        })
        .collect();
    // Step 22, the first after the lost steps, is marked as well. It is in the same windows as
    // steps 20 and 21, so no other window is marked.
    assert_eq!(codes, due);
}

#[test]
fn an_audit_with_the_planes_of_its_code_follows_every_ten_seconds() {
    let windows = 161;
    let count = (STEPS + (windows - 1) * HOP) as u64 * PER_STEP;
    let outputs = outputs_of(samples(Streams::CODES | Streams::AUDIT, count, &[]));
    let mut codes = Vec::new();
    let mut audits = Vec::new();
    for output in &outputs {
        match &output.payload {
            Payload::Code(code, _) => codes.push((output.at_us, code.values)),
            Payload::Audit(audit) => {
                let mut bytes = [0; pipeline::CodeValues::MAX_BYTES];
                let message = audit.message(model::MODEL_ID, &mut bytes);
                let planes: &[[u8; CELLS]] = message.planes.as_chunks().0;
                let mut encoder = pipeline::Encoder::new();
                let again = planes.iter().fold(None, |_, plane| {
                    encoder
                        .encode_step(&Step { plane: plane.map(u8::cast_signed), ..Step::SILENCE })
                });
                let (at_us, values) = codes.last().expect("the code precedes its audit");
                assert_eq!(*at_us, output.at_us);
                assert_eq!(again.map(|code| code.values), Some(*values));
                audits.push(message.window);
            }
            _ => {}
        }
    }
    assert_eq!((codes.len(), audits), (windows, vec![0, 160]));
}

#[test]
fn a_new_run_keeps_nothing_of_the_previous_one() {
    let streams = Streams::RAW | Streams::CODES;
    let mut input: Vec<AcquiredSample> = samples(streams, 13, &[]).collect();
    input.extend(samples(streams, 70, &[]).map(|mut acquired| {
        acquired.new_run = acquired.new_run.map(|run| Run { number: 2, ..run });
        acquired
    }));
    let outputs = outputs_of(input);
    let (second, first): (Vec<_>, Vec<_>) = outputs.into_iter().partition(|out| out.run == 2);
    assert_eq!(raw_frames(&first), [(0, 8, Flags::empty())]);
    let fresh = outputs_of(samples(streams, 70, &[]));
    assert_eq!(raw_frames(&second), raw_frames(&fresh));
    assert_eq!(codes(&second), codes(&fresh));
    assert_eq!(codes(&fresh).len(), 1);
}

/// Returns time and sample index of the events that are emitted for samples every 1,000 us.
/// `captured` holds the time of each edge and the index of the first sample at which the producer
/// can see it.
fn events(streams: Streams, captured: &[(u64, u64)]) -> Vec<(u64, u64)> {
    let mut producer = Box::new(Producer::new(BothEncoders::EMPTY));
    let mut outputs = Vec::new();
    let mut captured = captured.iter().peekable();
    for index in 0..6 {
        let mut sample = acquired(index);
        sample.new_run = (index == 0).then(|| run(1, streams));
        sample.drdy_us = 1_000 * index;
        producer.process(&sample, &mut |output| outputs.push(keep(output)));
        let next = || {
            let (at_us, _) = captured.next_if(|(_, found_at)| *found_at <= index)?;
            Some(CapturedEvent { kind: EventKind::TriggerRise, number: 0, at_us: *at_us })
        };
        producer.place_events(&sample, next, &mut |output| outputs.push(keep(output)));
    }
    let events = outputs.iter().filter_map(|output| match &output.payload {
        Payload::Event(event) => Some((output.at_us, event.sample)),
        _ => None,
    });
    events.collect()
}

#[test]
fn an_event_belongs_to_the_first_sample_that_is_not_before_it() {
    // Six edges become visible at once, with sample 1, as if the encoder task ran late.
    let captured =
        [(0, 0), (1, 1), (1_000, 1), (1_001, 1), (2_999, 1), (3_000, 1), (3_001, 1), (4_500, 5)];
    assert_eq!(
        events(Streams::EVENTS, &captured),
        [(0, 0), (1, 1), (1_000, 1), (1_001, 2), (2_999, 3), (3_000, 3), (3_001, 4), (4_500, 5),]
    );
}

#[test]
fn events_that_were_not_requested_are_discarded() {
    assert_eq!(events(Streams::CODES, &[(0, 0), (1_500, 2)]), []);
}

/// Returns run number and sample index of the event for an edge at `at_us`; `None` if the edge is
/// discarded. Run 1 has one sample, at 1,000 us; run 2 starts at 2,000 us.
fn event_before_a_new_run(at_us: u64) -> Option<(u32, u64)> {
    let mut producer = Box::new(Producer::new(BothEncoders::EMPTY));
    let mut outputs = Vec::new();
    let mut captured = Some(CapturedEvent { kind: EventKind::TriggerFall, number: 3, at_us });
    for (index, new_run) in [(0, Some(1)), (0, Some(2)), (1, None)] {
        let mut sample = acquired(index);
        sample.new_run = new_run.map(|number| run(number, Streams::EVENTS));
        sample.drdy_us = 1_000 * (index + u64::from(new_run.unwrap_or(2)));
        producer.process(&sample, &mut |output| outputs.push(keep(output)));
        producer.place_events(&sample, || captured.take(), &mut |output| {
            outputs.push(keep(output));
        });
    }
    outputs.retain(|output| !matches!(output.payload, Payload::Exclusion(_)));
    assert!(outputs.len() < 2, "{outputs:?}");
    outputs.first().map(|output| match &output.payload {
        Payload::Event(event) => (output.run, event.sample),
        payload => panic!("{payload:?}"),
    })
}

#[test]
fn an_event_that_waits_for_its_sample_is_kept_if_it_happened_in_the_new_run() {
    assert_eq!(event_before_a_new_run(1_500), None);
    assert_eq!(event_before_a_new_run(1_999), None);
    assert_eq!(event_before_a_new_run(2_000), Some((2, 0)));
    assert_eq!(event_before_a_new_run(2_500), Some((2, 1)));
}

/// An electrode that reaches the rail is excluded with that very step: the report comes before the
/// first output that excludes the electrode, and filtered steps stay as measured. `packed_alone.rs`
/// runs this test with a model that has a table.
#[test]
fn a_railed_electrode_is_reported_and_filled() {
    if SUBSTITUTION.is_none() {
        eprintln!("SKIPPED: the model has no table of substitutions");
        return;
    }
    let streams = Streams::ALL.without(Streams::RAW | Streams::COMPRESSED_RAW | Streams::EVENTS);
    let mut acquisition = Acquisition::new(Mains::Hz50);
    let mut producer = Box::new(Producer::new(BothEncoders::EMPTY));
    let mut outputs = Vec::new();
    let mut steps = 0;
    let railed = u64::from(ADC_RATE_HZ) * 3 / 5;
    for index in 0..u64::from(ADC_RATE_HZ) {
        let mut sample = Sample::default();
        for (channel, count) in sample.counts.iter_mut().enumerate() {
            *count = i32::try_from((index * 7 + channel as u64 * 13) % 101).expect("small");
        }
        if index >= railed {
            sample.counts[2] = Sample::MAX;
        }
        let step = acquisition.process_sample(&sample);
        let acquired = AcquiredSample {
            new_run: (index == 0).then(|| run(1, streams)),
            sample,
            index,
            step_index: steps,
            step,
            ..AcquiredSample::default()
        };
        steps += u64::from(step.is_some());
        producer.process(&acquired, &mut |output| outputs.push(keep(output)));
    }
    let excluded_at = outputs.iter().position(|output| {
        matches!(output.payload, Payload::Exclusion(exclusion) if exclusion.excluded == 1 << 2)
    });
    let excluded_at = excluded_at.expect("a report");
    let Payload::Exclusion(report) = outputs[excluded_at].payload else {
        unreachable!("found above");
    };
    let step_hz = u64::from(STEP_RATE_HZ);
    let first = (railed * step_hz).div_ceil(u64::from(ADC_RATE_HZ));
    assert_eq!(report.first_step, first);
    // At the first step, nothing is excluded.
    assert!(outputs.iter().any(|output| {
        matches!(output.payload, Payload::Exclusion(exclusion) if exclusion.first_step == 0)
    }));
    let mut blocks = 0;
    for (place, output) in outputs.iter().enumerate() {
        let (saturated, marks) = match output.payload {
            Payload::Code(code, marks) => (code.saturated, marks),
            Payload::PackedCode(code, marks) => (code.saturated, marks),
            _ => continue,
        };
        assert_eq!(saturated, 0, "the rail is not in a code");
        assert_eq!(marks.substituted, place > excluded_at);
        blocks += usize::from(marks.substituted);
    }
    assert!(blocks > 3);
    // The encoders get the prediction of the electrode at the rail. The prediction is small, so no
    // encoded value is clipped.
    assert_eq!(producer.clipped(), 0);
    // Once a second the report is repeated. The filtered steps have the flag for the rail, because
    // they stay as measured.
    assert!(matches!(outputs.last().map(|output| output.payload), Some(Payload::Exclusion(_))));
    let measured = outputs.iter().any(|output| match output.payload {
        Payload::Filtered(chunk) => chunk.message().flags.contains(link::Flags::SATURATED),
        _ => false,
    });
    assert!(measured);
}

/// `tests/acceptance` also builds this test with models for only one of the encoders.
#[test]
fn a_device_offers_what_its_encoders_feed_and_what_needs_none() {
    let packed = if PACKED.is_some() { Streams::PACKED | Streams::AUDIT } else { Streams::empty() };
    let others = Streams::RAW
        | Streams::COMPRESSED_RAW
        | Streams::FILTERED
        | Streams::EVENTS
        | Streams::FEATURES;
    let network = if HAS_NETWORK { Streams::CODES | Streams::AUDIT } else { Streams::empty() };
    assert_eq!(streams_with::<EncoderMemory>(), others | network);
    assert_eq!(streams_with::<PackedMemory>(), others | packed);
    assert_eq!(streams_with::<BothEncoders>(), others | network | packed);
}
