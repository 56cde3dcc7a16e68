//! Gives each step of a reconstructed frame its own device time, for the live page.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use neuro_ros::{NeuroFrame, Sink, SinkError};

/// Indices of the three words of the device time among the eight status words.
const TIME_WORDS: std::ops::Range<usize> = 3..6;

/// Sink of reconstructed frames that states the device time of each step. On the topic, all steps
/// of a frame have the device time of the last step of the window or packed block that completes
/// the frame.
pub(crate) struct StepTimes<S> {
    sink: S,
    /// Number of steps from the first step of a frame to the last step of the window that completes
    /// the frame.
    lookback: Arc<AtomicU32>,
    frame: NeuroFrame,
}

impl<S: Sink<NeuroFrame>> StepTimes<S> {
    pub(crate) fn new(sink: S, lookback: Arc<AtomicU32>) -> StepTimes<S> {
        StepTimes { sink, lookback, frame: NeuroFrame::default() }
    }
}

impl<S: Sink<NeuroFrame>> Sink<NeuroFrame> for StepTimes<S> {
    fn publish(&mut self, frame: &NeuroFrame) -> Result<(), SinkError> {
        if !self.sink.has_receivers() {
            return Ok(());
        }
        self.frame.clone_from(frame);
        // The device time of a packed block is that of the last step of the block's frame.
        let lookback = if frame.header.frame_id == NeuroFrame::NETWORK {
            self.lookback.load(Ordering::Relaxed)
        } else {
            u32::from(frame.eeg.info.nsamples.saturating_sub(1))
        };
        let rate = i64::from(frame.sr.max(1));
        let rows = self.frame.tri.data.chunks_exact_mut(8);
        for (words, step) in rows.zip(0..) {
            let time_us = TIME_WORDS.rev();
            let time_us = time_us.fold(0, |time, word| time << 16 | i64::from(words[word]));
            let before: i64 = i64::from(lookback) - step;
            let mut step_us = (time_us - before * 1_000_000 / rate).max(0);
            for word in &mut words[TIME_WORDS] {
                *word = (step_us & 0xffff) as i32;
                step_us >>= 16;
            }
        }
        self.sink.publish(&self.frame)
    }

    fn dropped(&self) -> u64 {
        self.sink.dropped()
    }

    fn has_receivers(&self) -> bool {
        self.sink.has_receivers()
    }
}

#[cfg(test)]
mod tests {
    use neuro_ros::{NeuroDataInfo, TriWords};

    use super::*;

    /// Sink that stores the newest frame.
    struct Newest(Arc<std::sync::Mutex<NeuroFrame>>);

    impl Sink<NeuroFrame> for Newest {
        fn publish(&mut self, frame: &NeuroFrame) -> Result<(), SinkError> {
            self.0.lock().unwrap().clone_from(frame);
            Ok(())
        }

        fn dropped(&self) -> u64 {
            0
        }
    }

    /// Returns the device times that a frame of 8 steps at 128 Hz has on the page.
    fn times(frame_id: &str, lookback: u32, device_time_us: u64) -> Vec<u64> {
        let info = NeuroDataInfo { nsamples: 8, ..NeuroDataInfo::default() };
        let mut frame = NeuroFrame::zeros(128, frame_id, info, NeuroDataInfo::default());
        let words = TriWords { device_time_us, flags: 0x8000, ..TriWords::default() };
        for row in frame.tri.data.chunks_exact_mut(8) {
            row.copy_from_slice(&words.words());
        }
        let newest = Arc::default();
        let mut sink = StepTimes::new(Newest(Arc::clone(&newest)), Arc::new(lookback.into()));
        sink.publish(&frame).unwrap();
        let published = newest.lock().unwrap();
        let rows = published.tri.data.chunks_exact(8);
        rows.map(|words| {
            assert_eq!((words[0], words[7]), (0x8000, 0));
            let words: Vec<u64> = words.iter().map(|word| u64::try_from(*word).unwrap()).collect();
            words[3] | words[4] << 16 | words[5] << 32
        })
        .collect()
    }

    #[test]
    fn a_step_has_its_own_device_time() {
        // In a window of 16 steps, the first hop ends 8 steps before the window's last step.
        let first = times(NeuroFrame::NETWORK, 15, 5_000_000_000);
        assert_eq!((first[0], first[1]), (4_999_882_813, 4_999_890_625));
        assert_eq!(first[7], 4_999_937_500);
        let last = times(NeuroFrame::NETWORK, 7, 5_000_000_000);
        assert_eq!((last[0], last[7]), (4_999_945_313, 5_000_000_000));
        assert_eq!(times("packed code", 15, 5_000_000_000), last);
        assert_eq!(times("packed code", 0, 1000)[0], 0);
    }
}
