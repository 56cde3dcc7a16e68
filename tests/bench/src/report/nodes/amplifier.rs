//! A simulated amplifier, which publishes frames of one hop each in real time.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use neuro_ros::{Header, NeuroDataFloat, NeuroDataInfo, NeuroFrame, NeuroHeader, Stamp, Wire};
use ros1::Publisher;

use super::figures::{SharedTimes, Times};
use super::wait_until;

/// Number of samples per time step of the encoder.
const SAMPLES_PER_STEP: usize = (model::ADC_RATE_HZ / model::STEP_RATE_HZ) as usize;
/// Number of samples in a published frame: one hop.
const SAMPLES: usize = model::HOP * SAMPLES_PER_STEP;
/// Number, counted from 1, of the frame that completes window 0.
#[expect(clippy::cast_possible_truncation, reason = "some frames")]
pub(super) const FIRST: u32 = ((model::STEPS - 1) * SAMPLES_PER_STEP / SAMPLES) as u32 + 1;
/// Time from one published frame to the next.
const PERIOD: Duration =
    Duration::from_nanos(1_000_000_000 * SAMPLES as u64 / model::ADC_RATE_HZ as u64);

/// A thread that publishes each frame on two topics, on the second topic half a period later.
#[derive(Debug)]
pub(super) struct Amplifier {
    sent: [SharedTimes; 2],
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Amplifier {
    pub(super) fn start(publishers: [Publisher; 2]) -> Amplifier {
        let sent = <[SharedTimes; 2]>::default();
        let stop = Arc::<AtomicBool>::default();
        let (times, stopped) = (sent.clone(), Arc::clone(&stop));
        let thread = thread::spawn(move || {
            let start = Instant::now();
            let mut number = 0;
            while !stopped.load(Ordering::Relaxed) {
                number += 1;
                let mut frame = frame(number);
                for ((half, publisher), times) in (0_u32..).zip(&publishers).zip(&times) {
                    wait_until(start + (2 * number + half) * PERIOD / 2);
                    frame.header.stamp = Stamp::now();
                    let bytes = frame.to_bytes();
                    if number >= FIRST {
                        times.note(u64::from(number - FIRST), Instant::now());
                    }
                    publisher.publish(&bytes);
                }
            }
        });
        Amplifier {
            sent,
            stop,
            thread: Some(thread),
        }
    }

    /// Returns, for both topics, when the frame that completes each window was sent.
    pub(super) fn times(&self) -> [Times; 2] {
        self.sent.each_ref().map(SharedTimes::so_far)
    }
}

impl Drop for Amplifier {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // An error means that the thread has panicked, which was printed then.
            let _ = thread.join();
        }
    }
}

/// Returns frame `number`: a hop of noise at the model's electrodes, from 0 to 255 uV.
fn frame(number: u32) -> NeuroFrame {
    let labels: Vec<String> = model::LABELS.split(' ').map(str::to_owned).collect();
    let values = SAMPLES * labels.len();
    let mut state = number;
    let value = |_| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f32::from((state >> 24).to_le_bytes()[0])
    };
    let narrow = |length: usize| u16::try_from(length).unwrap_or(u16::MAX);
    NeuroFrame {
        header: Header {
            seq: number,
            ..Header::default()
        },
        neuroheader: NeuroHeader { seq: number },
        sr: model::ADC_RATE_HZ,
        eeg: NeuroDataFloat {
            info: NeuroDataInfo {
                nsamples: narrow(SAMPLES),
                nchannels: narrow(labels.len()),
                stride: narrow(4 * labels.len()),
                unit: "uV".to_owned(),
                minmax: vec![-187_500.0, 187_500.0],
                labels,
                ..NeuroDataInfo::default()
            },
            data: (0..values).map(value).collect(),
        },
        ..NeuroFrame::default()
    }
}
