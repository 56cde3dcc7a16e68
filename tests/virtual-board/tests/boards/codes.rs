//! Comparison of a board's codes with those of host-sim.

use std::thread;
use std::time::{Duration, Instant};

use host_sim::{Identity, Outbox, VirtualBoard as Simulator, WhenFull};
use link::{Start, Streams};
use pipeline::{Mains, Sample};
use virtual_board::{BoardError, Cable, Inbox, Kind, Model, ReceivedCode, eeg};

use crate::figures::record;
use crate::images::Subject;
use crate::session::{assert_sound, run_codes, running, start};

/// Returns the number of codes to compare: 256 (16 s) for the default image of a board, 48 (3 s) for the
/// other image, which differs only in the port.
const fn codes(subject: Subject) -> usize {
    match (subject.model, subject.cable) {
        (Model::H743, Cable::Uart) | (Model::F446, Cable::Usb) => 48,
        _ => 256,
    }
}

/// Number of samples between the starts of two windows.
const HOP: u64 = 32;

/// The codes equal those of host-sim bit for bit, their timestamps are 62.5 ms apart, and nothing is late or lost.
pub(crate) fn codes_equal_those_of_host_sim(subject: Subject) -> Result<(), BoardError> {
    let mut board = running(subject)?;
    let before = board.converters().samples_delivered();
    start(&mut board, Streams::CODES)?;
    let after = board.converters().samples_delivered();
    let (start_us, started) = (board.now_us(), Instant::now());
    run_codes(&mut board, codes(subject))?;

    let virtual_us = board.now_us() - start_us;
    #[expect(clippy::cast_precision_loss, reason = "seconds")]
    let real_time_factor = virtual_us as f64 * 1e-6 / started.elapsed().as_secs_f64();
    let codes: Vec<ReceivedCode> = received(board.inbox());
    // The test does not know at which sample the codes start, so it tries all samples between the `Start`
    // command and its acknowledgement.
    let first = (before.saturating_sub(1)..=after + 1)
        .find(|&sample| simulated(sample, 2 * HOP)[..1] == codes[..1]);
    let first = first.expect("the first code equals none of host-sim's");
    let simulated = simulated(first, HOP * (codes.len() as u64 + 2));
    let equal = codes
        .iter()
        .zip(&simulated)
        .filter(|(image, host)| image == host);
    assert_eq!(equal.count(), codes.len());
    let stamps: Vec<u64> = board
        .inbox()
        .codes()
        .map(|(frame, _)| frame.device_us)
        .collect();
    for pair in stamps.windows(2) {
        assert_eq!(pair[1] - pair[0], 62_500);
    }

    for frame in board.inbox().frames() {
        match &frame.kind {
            Kind::Stats(stats) => {
                let lost = [
                    stats.frames_dropped,
                    stats.overruns,
                    stats.adc_status_bad,
                    stats.input_bad,
                ];
                assert_eq!(lost, [0; 4], "dropped, overruns, bad status, bad input");
            }
            Kind::Timing(timing) => {
                for stage in &timing.stages {
                    let late = stage.histogram.last().copied();
                    assert_eq!(late, Some(0), "{} is late: {stage:?}", stage.stage);
                }
            }
            _ => {}
        }
    }
    let timing = board
        .inbox()
        .frames()
        .iter()
        .rev()
        .find_map(|frame| match &frame.kind {
            Kind::Timing(timing) => Some(timing.clone()),
            _ => None,
        });
    let timing = timing.expect("a report each second");
    let worst = timing
        .stages
        .iter()
        .map(|stage| f64::from(stage.worst_ns) / f64::from(stage.deadline_ns));
    let worst = worst.fold(0.0, f64::max);
    // The peak of the stack use only grows, and the device reported it before this read, so the report
    // cannot be larger.
    let used = board.stack_used()?;
    let [reported, size] = [timing.stack_used, timing.stack_size].map(u64::from);
    assert!(
        used >= reported && used < size * 3 / 4,
        "{used} of {size} bytes of stack, {reported} reported"
    );
    assert_sound(&mut board)?;
    record(subject, "codes", codes.len());
    record(subject, "equal_to_host", codes.len());
    record(subject, "worst_path_over_deadline", format!("{worst:.3}"));
    record(
        subject,
        "real_time_factor",
        format!("{real_time_factor:.2}"),
    );
    record(subject, "stack_used", used);
    record(
        subject,
        "instructions_per_virtual_second",
        board.instructions() * 1_000_000 / board.now_us(),
    );
    Ok(())
}

/// Returns the codes that host-sim computes from `samples` samples, starting with sample `first`.
fn simulated(first: u64, samples: u64) -> Vec<ReceivedCode> {
    let outbox = Outbox::new(WhenFull::Wait);
    let identity = Identity {
        session_id: 0,
        chip_uid: [0; 12],
        ..Identity::default()
    };
    let mut board = Simulator::new(identity, Mains::default(), outbox.clone());
    let bytes = thread::scope(|scope| {
        let reader = scope.spawn(|| {
            let mut bytes = Vec::new();
            while let Some(frame) = outbox.pop() {
                bytes.extend(frame);
                outbox.mark_written();
            }
            bytes
        });
        let start = Start {
            streams: Streams::CODES,
            mains_hz: 0,
        };
        board.start(start, 0);
        for number in 0..samples {
            let mut sample = Sample::default();
            for (channel, count) in sample.counts.iter_mut().enumerate() {
                *count = eeg::count(first + number, channel);
            }
            board.process_sample(&sample, number * 1_000_000 / 512);
        }
        outbox.drain(Duration::from_secs(20));
        outbox.close();
        reader.join().expect("the reader ends")
    });
    let mut inbox = Inbox::default();
    inbox.decode(&bytes);
    received(&inbox)
}

fn received(inbox: &Inbox) -> Vec<ReceivedCode> {
    inbox.codes().map(|(_, code)| code.clone()).collect()
}
