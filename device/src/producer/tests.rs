//! What comes of samples and steps, and of those that are missing.

use std::{boxed::Box, vec, vec::Vec};

use link::{Flags, RAW_SAMPLES};
use model::{CELLS, HOP, STEPS};

use super::*;

/// Samples of a step.
const PER_STEP: u64 = model::ADC_RATE_HZ as u64 / model::STEP_RATE_HZ as u64;

const OVERRUN: Marks = Marks {
    overrun: true,
    ..Marks::NONE
};

fn run(number: u32, streams: Streams) -> Run {
    Run {
        number,
        streams,
        ..Run::NONE
    }
}

/// Sample number `index` of a run, at a thousand microseconds for each, and its step, if one is due.
fn taken(index: u64) -> Taken {
    let mut taken = Taken {
        index,
        drdy_us: 1_000 * index,
        ..Taken::default()
    };
    taken.sample.counts[5] = i32::try_from(index).expect("few");
    if (index + 1).is_multiple_of(PER_STEP) {
        let number = index / PER_STEP;
        let plane = core::array::from_fn(|cell| {
            let [value, ..] = (number * 37 + cell as u64 * 11).to_le_bytes();
            value.cast_signed()
        });
        let step = Step {
            sample: index,
            plane,
            ..Step::SILENCE
        };
        taken.step = Some((number, step));
    }
    taken
}

/// What a new producer makes of these samples.
fn made_of(samples: impl IntoIterator<Item = Taken>) -> Vec<Made> {
    let mut producer = Box::new(Producer::new(EncoderMemory::EMPTY));
    let mut made = Vec::new();
    for sample in samples {
        producer.take(&sample, &mut |what| made.push(what));
    }
    made
}

/// The samples of a run, without those that are `lost`; the first that comes begins it.
fn samples(streams: Streams, count: u64, lost: &[u64]) -> impl Iterator<Item = Taken> {
    let came = (0..count).filter(move |index| !lost.contains(index));
    came.enumerate().map(move |(place, index)| Taken {
        begun: (place == 0).then(|| run(1, streams)),
        marks: if index > 0 && lost.contains(&(index - 1)) {
            OVERRUN
        } else {
            Marks::NONE
        },
        ..taken(index)
    })
}

/// First sample, samples and flags of each raw frame.
fn raw_frames(made: &[Made]) -> Vec<(u64, usize, Flags)> {
    let raw = made.iter().filter_map(|made| match &made.what {
        What::Raw(raw) => Some(raw.message()),
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

#[test]
fn a_run_makes_what_the_host_wants_and_nothing_else() {
    let kinds = |streams| {
        let mut kinds = made_of(samples(streams, 2 * 512, &[]))
            .iter()
            .map(|made| match made.what {
                What::Code(..) => Streams::CODES,
                What::Raw(_) => Streams::RAW,
                What::Filtered(_) => Streams::FILTERED,
                What::Audit(_) => Streams::AUDIT,
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
        Streams::FILTERED,
        Streams::AUDIT,
    ] {
        assert_eq!(kinds(one), [one]);
    }
    assert_eq!(kinds(Streams::EVENTS), []);
    assert!(kinds(Streams::ALL).len() > 4);
}

#[test]
fn a_raw_frame_ends_before_a_sample_that_is_lost_and_the_next_one_begins_behind_it() {
    let made = made_of(samples(Streams::RAW, 32, &[11, 12]));
    let whole = RAW_SAMPLES;
    assert_eq!(
        raw_frames(&made),
        [
            (0, whole, Flags::empty()),
            (8, 3, Flags::empty()),
            (13, whole, Flags::OVERRUN),
            (21, whole, Flags::empty()),
        ]
    );
    let times: Vec<u64> = made.iter().map(|made| made.at_us).collect();
    assert_eq!(
        times,
        [7_000, 10_000, 20_000, 28_000],
        "their last samples'"
    );
}

#[test]
fn filtered_steps_end_before_one_that_is_lost_and_tell_what_was_wrong_with_any_of_their_samples() {
    // The sample of step 5, and then one between steps 8 and 9.
    let mut input: Vec<Taken> = samples(Streams::FILTERED, 64, &[5 * PER_STEP + 3]).collect();
    for taken in &mut input {
        taken.marks.adc_status_bad = taken.index == 9 * PER_STEP + 1;
    }
    let found = made_of(input);
    let filtered = found.iter().filter_map(|made| match &made.what {
        What::Filtered(steps) => Some(steps.message()),
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
        [
            (0, 4, none),
            (4, 1, none),
            (6, 4, Flags::OVERRUN | Flags::ADC_STATUS_BAD),
            (10, 4, none),
        ]
    );
}

#[test]
fn windows_keep_their_time_where_steps_are_lost_and_their_codes_say_so() {
    // Steps 20 and 21 are lost.
    let lost = [20 * PER_STEP + 3, 21 * PER_STEP + 3];
    let count = (STEPS + 4 * HOP) as u64 * PER_STEP;
    let codes: Vec<(u32, u64, bool)> = made_of(samples(Streams::CODES, count, &lost))
        .iter()
        .filter_map(|made| match &made.what {
            What::Code(code, marks) => Some((code.window, made.at_us, marks.overrun)),
            _ => None,
        })
        .collect();
    let end = |window: u64| 1_000 * ((window * HOP as u64 + STEPS as u64) * PER_STEP - 1);
    let steps = |window: u64| window * HOP as u64..window * HOP as u64 + STEPS as u64;
    let due: Vec<(u32, u64, bool)> = (0..5)
        .map(|window| {
            let number = u32::try_from(window).expect("few");
            let is_marked = [20, 21].iter().any(|step| steps(window).contains(step));
            (number, end(window), is_marked)
        })
        .collect();
    // Step 22, behind them, is marked as well, and lies in the same windows.
    assert_eq!(codes, due);
}

#[test]
fn an_audit_holds_the_planes_of_its_code_and_comes_every_ten_seconds() {
    let windows = 161;
    let count = (STEPS + (windows - 1) * HOP) as u64 * PER_STEP;
    let made = made_of(samples(Streams::CODES | Streams::AUDIT, count, &[]));
    let mut codes = Vec::new();
    let mut audits = Vec::new();
    for made in &made {
        match &made.what {
            What::Code(code, _) => codes.push((made.at_us, code.values)),
            What::Audit(audit) => {
                let message = audit.message();
                let planes: &[[u8; CELLS]] = message.planes.as_chunks().0;
                let mut encoder = Encoder::new();
                let again = planes.iter().fold(None, |_, plane| {
                    encoder.encode_step(&Step {
                        plane: plane.map(u8::cast_signed),
                        ..Step::SILENCE
                    })
                });
                let (at_us, values) = codes.last().expect("its code comes before it");
                assert_eq!(*at_us, made.at_us);
                assert_eq!(again.map(|code| code.values), Some(*values));
                audits.push(message.window);
            }
            _ => {}
        }
    }
    assert_eq!((codes.len(), audits), (windows, vec![0, 160]));
}

#[test]
fn a_new_run_takes_nothing_over_from_the_one_before() {
    let streams = Streams::RAW | Streams::CODES;
    let mut input: Vec<Taken> = samples(streams, 13, &[]).collect();
    input.extend(samples(streams, 70, &[]).map(|mut taken| {
        taken.begun = taken.begun.map(|run| Run { number: 2, ..run });
        taken
    }));
    let made = made_of(input);
    let of_each = |number| {
        let made: Vec<Made> = made
            .iter()
            .filter(|made| made.run == number)
            .cloned()
            .collect();
        raw_frames(&made)
    };
    assert_eq!(of_each(1), [(0, 8, Flags::empty())]);
    assert_eq!(of_each(2)[0], (0, 8, Flags::empty()));
    let fresh = made_of(samples(streams, 70, &[]));
    let codes = |made: &[Made], run| {
        let made = made.iter().filter(|made| made.run == run);
        let codes = made.filter_map(|made| match &made.what {
            What::Code(code, _) => Some(*code),
            _ => None,
        });
        codes.collect::<Vec<_>>()
    };
    assert_eq!(codes(&made, 2), codes(&fresh, 1));
    assert_eq!(codes(&fresh, 1).len(), 1);
}

/// Places what was captured at these times around the samples of a run; gives time and sample of the
/// events.
fn events(streams: Streams, captured: &[(u64, u64)]) -> Vec<(u64, u64)> {
    let mut producer = Box::new(Producer::new(EncoderMemory::EMPTY));
    let mut made = Vec::new();
    let mut captured = captured.iter().peekable();
    for index in 0..6 {
        let mut sample = taken(index);
        sample.begun = (index == 0).then(|| run(1, streams));
        producer.take(&sample, &mut |what| made.push(what));
        // When it was captured is when the encoder may find it.
        let next = || {
            let (at_us, _) = captured.next_if(|(_, found_at)| *found_at <= index)?;
            Some(Captured {
                kind: EventKind::TriggerRise,
                number: 0,
                at_us: *at_us,
            })
        };
        producer.place(&sample, next, &mut |what| made.push(what));
    }
    let events = made.iter().filter_map(|made| match &made.what {
        What::Event(event) => Some((made.at_us, event.sample)),
        _ => None,
    });
    events.collect()
}

#[test]
fn an_event_belongs_to_the_first_sample_that_is_not_before_it() {
    // Time, and the sample after which the encoder finds it: a late encoder finds several at once.
    let captured = [
        (0, 0),
        (1, 1),
        (1_000, 1),
        (1_001, 1),
        (2_999, 1),
        (3_000, 1),
        (3_001, 1),
        (4_500, 5),
    ];
    assert_eq!(
        events(Streams::EVENTS, &captured),
        [
            (0, 0),
            (1, 1),
            (1_000, 1),
            (1_001, 2),
            (2_999, 3),
            (3_000, 3),
            (3_001, 4),
            (4_500, 5),
        ]
    );
}

#[test]
fn events_that_the_host_does_not_want_are_taken_out_and_not_sent() {
    assert_eq!(events(Streams::CODES, &[(0, 0), (1_500, 2)]), []);
}

/// An event that was captured at this time, after the first sample of a run at 1,000 us, which is the only
/// one: the next begins at 2,000 us. Gives its run and sample.
fn event_before_a_new_run(at_us: u64) -> Option<(u32, u64)> {
    let mut producer = Box::new(Producer::new(EncoderMemory::EMPTY));
    let mut made = Vec::new();
    let mut captured = Some(Captured {
        kind: EventKind::TriggerFall,
        number: 3,
        at_us,
    });
    for (index, begun) in [(0, Some(1)), (0, Some(2)), (1, None)] {
        let mut sample = taken(index);
        sample.begun = begun.map(|number| run(number, Streams::EVENTS));
        sample.drdy_us = 1_000 * (index + u64::from(begun.unwrap_or(2)));
        producer.take(&sample, &mut |what| made.push(what));
        producer.place(&sample, || captured.take(), &mut |what| made.push(what));
    }
    assert!(made.len() < 2, "{made:?}");
    made.first().map(|made| match &made.what {
        What::Event(event) => (made.run, event.sample),
        what => panic!("{what:?}"),
    })
}

#[test]
fn an_event_that_waits_for_its_sample_reaches_into_the_next_run_if_it_happened_in_it() {
    assert_eq!(event_before_a_new_run(1_500), None);
    assert_eq!(event_before_a_new_run(1_999), None);
    assert_eq!(event_before_a_new_run(2_000), Some((2, 0)));
    assert_eq!(event_before_a_new_run(2_500), Some((2, 1)));
}
