//! Tests of self-test, reset, trigger edges and all streams except codes.

use std::time::Duration;

use link::{Event, EventKind, ResetInto, Streams};
use pipeline::Acquisition;

use super::*;

#[test]
fn filtered_frames_are_the_steps_that_the_encoder_reads() {
    let (mut board, outbox) = board();
    send(&mut board, &mut Encoder::default(), start(Streams::FILTERED));
    let mut acquisition = Acquisition::new(Mains::Hz50);
    let mut steps = Vec::new();
    let mut state = 1_u32;
    for index in 1..=1_024 {
        // Pseudo-random counts of 20 bits.
        let counts = std::array::from_fn(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state.cast_signed() >> 12
        });
        let sample = Sample { counts };
        board.process_sample(&sample, index * 1_000_000 / 512);
        steps.extend(acquisition.process_sample(&sample));
    }
    let seen = frames(&outbox, |message| match message {
        ToHost::Filtered(filtered) => {
            assert_eq!((filtered.electrodes, filtered.fraction_bits), (61, 5));
            Some((filtered.first_step, filtered.values().collect::<Vec<_>>()))
        }
        _ => None,
    });
    let firsts: Vec<u64> = seen.iter().map(|(first, _)| *first).collect();
    assert_eq!(firsts, (0..1_024 / 4).step_by(4).collect::<Vec<_>>());
    let expected: Vec<i32> = steps.iter().flat_map(|step| step.electrodes).collect();
    let together: Vec<i32> = seen.into_iter().flat_map(|(_, values)| values).collect();
    assert_eq!(together, expected);
}

#[test]
fn a_self_test_between_runs_is_answered_with_its_result() {
    let (mut board, outbox) = board();
    let mut host = Encoder::default();
    for command in [START, ToDevice::Stop, ToDevice::SelfTest, START] {
        send(&mut board, &mut host, command);
    }
    let results = frames(&outbox, |message| match message {
        ToHost::SelfTest(test) => Some(test),
        _ => None,
    });
    let [test] = &results[..] else {
        panic!("{} results", results.len());
    };
    let found = (&test.fault[..], test.chips.len(), test.channels.len());
    assert_eq!(found, ("", 8, 64));
    let mut channels = test.channels.iter();
    assert!(channels.all(|channel| channel.gain_error.abs() < 0.01));
    assert!(board.is_streaming());
}

#[test]
fn after_a_reset_the_board_introduces_itself_with_another_session_id() {
    let (mut board, outbox) = board();
    let mut host = Encoder::default();
    for command in [START, ToDevice::Reset(ResetInto::Firmware)] {
        send(&mut board, &mut host, command);
    }
    let hellos = frames(&outbox, |message| match message {
        ToHost::Hello(hello) => Some((hello.session_id, hello.reset_cause)),
        _ => None,
    });
    let expected = [(7, ResetCause::PowerOn), (8, ResetCause::Software)];
    assert_eq!(hellos, expected);
    assert!(!board.is_streaming());
    let samples = |message: ToHost<'_>| match message {
        ToHost::Stats(stats) => Some((stats.samples, stats.codes_made)),
        _ => None,
    };
    send(&mut board, &mut host, START);
    board.process_sample(&Sample::default(), 2_000);
    send(&mut board, &mut host, ToDevice::Reset(ResetInto::Firmware));
    send(&mut board, &mut host, ToDevice::Stop);
    assert_eq!(frames(&outbox, samples), [(0, 0)], "counted since boot");
}

#[test]
fn trigger_edges_are_sent_before_the_samples_that_follow_them() {
    let (board, outbox) = board();
    let trigger = crate::trigger::Trigger::every(Duration::from_micros(15_625));
    let mut board = board.with_trigger(Some(trigger.expect("slow enough")));
    let mut host = Encoder::default();
    let mut seen = Vec::new();
    let mut stream = |from: u64| {
        send(&mut board, &mut host, start(Streams::RAW | Streams::EVENTS));
        for index in 0..17 {
            board.process_sample(&Sample::default(), from + index * 1_000_000 / 512);
            seen.extend(frames(&outbox, |message| match message {
                ToHost::Event(event) => Some(Ok(event)),
                ToHost::Raw(raw) => Some(Err(raw.first_sample)),
                _ => None,
            }));
        }
        send(&mut board, &mut host, ToDevice::Stop);
        frames(&outbox, |_| Some(()));
    };
    // Edge 0 occurs a microsecond after sample 0. In the second run, edges 64 and 65 occur right
    // before samples 7 and 15, each of which is the last sample of a raw frame. The edges between
    // the two runs are counted but not sent.
    stream(15_625 - 1);
    stream(1_002_000);
    let event = |kind, number, sample| Ok(Event { kind, number, sample });
    let (rise, fall) = (EventKind::TriggerRise, EventKind::TriggerFall);
    assert_eq!(
        seen,
        [
            event(rise, 0, 1),
            Err(0),
            event(fall, 1, 9),
            Err(8),
            event(rise, 64, 7),
            Err(0),
            event(fall, 65, 15),
            Err(8),
        ]
    );
}
