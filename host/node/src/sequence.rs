//! Finds lost frames and restarts of the acquisition from the numbers of its frames.

use neuro_ros::NeuroFrame;

/// Longest gap that is filled, microseconds. A longer gap counts as a restart of the acquisition.
const LONGEST_GAP_US: i64 = 120_000_000;

/// How a frame follows the frames before it, judged by its number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arrival {
    /// The frame follows the previous one directly, or is the first.
    Next,
    /// Holds the number of frames missing between the previous frame and this one.
    Lost(u32),
    /// The acquisition has restarted; how much is missing since the previous frame is not known.
    Restarted,
    /// The frame has the same number as the previous one.
    Repeated,
}

/// Number of the newest frame, to compare with the number of the next frame.
#[derive(Clone, Debug, Default)]
pub struct Sequence {
    newest: Option<u32>,
    /// Whether the acquisition does not number its frames: all have the number 0.
    is_unnumbered: bool,
}

impl Sequence {
    /// Notes a frame that lasts `frame_us` microseconds. Returns how it follows the previous frame.
    pub fn record(&mut self, frame: &NeuroFrame, frame_us: i64) -> Arrival {
        let seq = frame.neuroheader.seq;
        let Some(last) = self.newest.replace(seq) else {
            return Arrival::Next;
        };
        if seq == last && seq == 0 {
            self.is_unnumbered = true;
        } else if seq != 0 {
            self.is_unnumbered = false;
        }
        match seq.wrapping_sub(last) {
            0 if !self.is_unnumbered => Arrival::Repeated,
            0 | 1 => Arrival::Next,
            step if i64::from(step - 1).saturating_mul(frame_us) <= LONGEST_GAP_US => {
                Arrival::Lost(step - 1)
            }
            _ => Arrival::Restarted,
        }
    }

    /// Returns whether the acquisition does not number its frames, so that losses are not found.
    pub fn is_unnumbered(&self) -> bool {
        self.is_unnumbered
    }
}

#[cfg(test)]
mod tests {
    use neuro_ros::{NeuroFrame, NeuroHeader};

    use super::{Arrival, Sequence};

    /// Returns the arrivals of frames of 62.5 ms with these numbers.
    fn arrivals(numbers: &[u32]) -> Vec<Arrival> {
        let mut sequence = Sequence::default();
        let mut record = |seq: &u32| {
            let frame =
                NeuroFrame { neuroheader: NeuroHeader { seq: *seq }, ..NeuroFrame::default() };
            sequence.record(&frame, 62_500)
        };
        numbers.iter().map(&mut record).collect()
    }

    #[test]
    fn gaps_are_counted_across_the_wrap_and_long_ones_are_restarts() {
        let frames = [u32::MAX - 1, u32::MAX, 2, 3, 3000, 1];
        let expected = [
            Arrival::Next,
            Arrival::Next,
            Arrival::Lost(2),
            Arrival::Next,
            Arrival::Restarted,
            Arrival::Restarted,
        ];
        assert_eq!(arrivals(&frames), expected);
    }

    #[test]
    fn a_repeated_number_is_found_unless_the_acquisition_leaves_all_numbers_0() {
        let repeated = arrivals(&[5, 5, 6]);
        assert_eq!(repeated, [Arrival::Next, Arrival::Repeated, Arrival::Next]);
        assert_eq!(arrivals(&[0, 0, 0]), [Arrival::Next; 3]);
    }
}
