//! A simulated amplifier, which publishes frames of at most one hop in real time.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use neuro_ros::{Header, NeuroDataFloat, NeuroDataInfo, NeuroFrame, NeuroHeader, Stamp, Wire};
use ros1::Publisher;

use super::figures::{SharedTimes, Times};
use super::{run_before_others, wait_until};

/// Rate and length of an amplifier's frames.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frames {
    /// Samples per second.
    rate_hz: u32,
    /// Samples in a frame.
    samples: u32,
}

impl Frames {
    /// Returns the frames of an amplifier of `rate_hz`. At the rate of the model's ADC, each frame
    /// lasts a hop; at other rates, 1/64 s or 20 ms. Returns `None` if neither is a whole number of
    /// samples.
    pub(super) fn new(rate_hz: u16) -> Option<Frames> {
        let step_rate = u32::from(model::STEP_RATE_HZ);
        let hops = (rate_hz == model::ADC_RATE_HZ).then_some(step_rate / HOP);
        let rate_hz = u32::from(rate_hz);
        let mut per_second = hops.into_iter().chain([64, 50]);
        let per_second = per_second.find(|frames| rate_hz.is_multiple_of(*frames))?;
        let samples = rate_hz / per_second;
        Some(Frames { rate_hz, samples })
    }

    /// Returns a, b and c such that floor((a n - b) / c) is the index of the newest window whose
    /// last step is in frame n or in an earlier frame, where n counts from 1.
    pub(super) fn windows(self) -> [i64; 3] {
        let step_rate = i64::from(model::STEP_RATE_HZ);
        let rate = i64::from(self.rate_hz);
        [
            i64::from(self.samples) * step_rate,
            step_rate + (i64::from(STEPS) - 1) * rate,
            i64::from(HOP) * rate,
        ]
    }

    fn period(self) -> Duration {
        Duration::from_secs(1) * self.samples / self.rate_hz
    }
}

/// Number of steps of a window.
#[expect(clippy::cast_possible_truncation, reason = "some steps")]
const STEPS: u32 = model::STEPS as u32;
/// Number of steps from one code to the next.
#[expect(clippy::cast_possible_truncation, reason = "some steps")]
const HOP: u32 = model::HOP as u32;

/// A thread that publishes each frame on two topics, half a period later on the second one.
#[derive(Debug)]
pub(super) struct Amplifier {
    sent: [SharedTimes; 2],
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Amplifier {
    pub(super) fn start(frames: Frames, publishers: [Publisher; 2]) -> Amplifier {
        let sent = <[SharedTimes; 2]>::default();
        let stop = Arc::<AtomicBool>::default();
        let (times, stopped) = (sent.clone(), Arc::clone(&stop));
        let thread = thread::spawn(move || {
            run_before_others();
            let (start, period) = (Instant::now(), frames.period());
            let [a, b, c] = frames.windows();
            let mut number = 0;
            while !stopped.load(Ordering::Relaxed) {
                number += 1;
                let mut frame = frames.frame(number);
                let window = (a * i64::from(number) - b).div_euclid(c);
                for ((half, publisher), times) in (0_u32..).zip(&publishers).zip(&times) {
                    wait_until(start + (2 * number + half) * period / 2);
                    frame.header.stamp = Stamp::now();
                    let bytes = frame.to_bytes();
                    if let Ok(window) = u64::try_from(window) {
                        times.note(window, Instant::now());
                    }
                    publisher.publish(&bytes);
                }
            }
        });
        Amplifier { sent, stop, thread: Some(thread) }
    }

    /// Returns the times at which the frame with each window's last step was sent, for both topics.
    pub(super) fn times(&self) -> [Times; 2] {
        self.sent.each_ref().map(SharedTimes::so_far)
    }
}

impl Drop for Amplifier {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // An error means that the thread panicked, which has printed its message.
            let _ = thread.join();
        }
    }
}

impl Frames {
    /// Returns frame `number`: noise at the model's electrodes, from 0 to 255 uV.
    fn frame(self, number: u32) -> NeuroFrame {
        let labels: Vec<String> = model::LABELS.split(' ').map(str::to_owned).collect();
        let values = self.samples as usize * labels.len();
        let mut state = number;
        let value = |_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f32::from((state >> 24).to_le_bytes()[0])
        };
        let channels = u16::try_from(labels.len()).unwrap_or(u16::MAX);
        NeuroFrame {
            header: Header { seq: number, ..Header::default() },
            neuroheader: NeuroHeader { seq: number },
            sr: u16::try_from(self.rate_hz).unwrap_or(u16::MAX),
            eeg: NeuroDataFloat {
                info: NeuroDataInfo {
                    nsamples: u16::try_from(self.samples).unwrap_or(u16::MAX),
                    nchannels: channels,
                    stride: 4 * channels,
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
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_are_those_counted_sample_by_sample() {
        for rate_hz in [128, 250, 256, 500, 512, 1000] {
            let frames = Frames::new(rate_hz).expect("a whole number of samples");
            let [a, b, c] = frames.windows();
            let rate = u64::from(rate_hz);
            for number in 1..200_u32 {
                let samples = u64::from(number * frames.samples);
                // Step s belongs to the first sample at or after its time, s / step rate.
                let step_is_in = |step: u64| (step * rate).div_ceil(128) < samples;
                let windows = (0_u64..).take_while(|window| {
                    step_is_in(window * u64::from(HOP) + u64::from(STEPS) - 1)
                });
                let newest = i64::try_from(windows.count()).expect("some windows") - 1;
                let formula = (a * i64::from(number) - b).div_euclid(c);
                assert_eq!(formula.max(-1), newest, "{rate_hz} Hz, frame {number}");
            }
        }
    }
}
