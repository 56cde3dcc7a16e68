//! What a subscriber heard during one run.

use std::time::Instant;

use link::Flags;
use neuro_ros::NeuroFrame;

/// One message and when it came.
#[derive(Debug, Clone)]
pub(crate) struct Heard {
    /// Arrival at the subscriber.
    pub(crate) arrival: Instant,
    /// The message.
    pub(crate) frame: NeuroFrame,
}

impl Heard {
    /// Index of the code since the device's start of the stream.
    pub(crate) fn window(&self) -> u64 {
        self.word("seq_lo") | self.word("seq_hi") << 16
    }

    /// Device time of the code, microseconds.
    pub(crate) fn device_us(&self) -> u64 {
        self.word("t_us_0") | self.word("t_us_1") << 16 | self.word("t_us_2") << 32
    }

    /// Whether it stands in the place of a code that was lost.
    pub(crate) fn is_filler(&self) -> bool {
        self.has(Flags::FILLER)
    }

    /// Whether the filters had not settled yet.
    pub(crate) fn is_settling(&self) -> bool {
        self.has(Flags::SETTLING)
    }

    fn has(&self, flag: Flags) -> bool {
        self.word("flags") & u64::from(flag.bits()) != 0
    }

    /// A status word, 16 bits, by its label; 0 where the frame has none of that name.
    fn word(&self, label: &str) -> u64 {
        let tri = &self.frame.tri;
        let place = tri.info.labels.iter().position(|name| name == label);
        let word = place.and_then(|place| tri.data.get(place));
        word.and_then(|word| u64::try_from(*word).ok()).unwrap_or(0)
    }
}

/// Everything that was heard, in the order of arrival.
#[derive(Debug, Clone, Default)]
pub(crate) struct Run {
    /// From `/encoded`.
    pub(crate) codes: Vec<Heard>,
    /// From `/neurodata_reconstructed`.
    pub(crate) reconstructed: Vec<Heard>,
    /// Codes that the board says it made, where it said so.
    pub(crate) made_by_board: Option<usize>,
}

impl Run {
    /// Codes that the board made: by its own count, else by the highest number heard.
    pub(crate) fn made(&self) -> usize {
        let highest = self
            .codes
            .iter()
            .map(|heard| heard.window() + 1)
            .max()
            .unwrap_or(0);
        self.made_by_board
            .unwrap_or(usize::try_from(highest).unwrap_or(usize::MAX))
    }

    /// Codes that arrived at the subscriber, fillers not counted.
    pub(crate) fn received(&self) -> usize {
        self.codes.iter().filter(|heard| !heard.is_filler()).count()
    }

    /// Codes that were made and did not arrive.
    pub(crate) fn lost(&self) -> usize {
        self.made().saturating_sub(self.received())
    }

    /// Between two arrivals at the subscriber, ms.
    pub(crate) fn arrival_intervals_ms(&self) -> Vec<f64> {
        let pairs = self.codes.windows(2);
        pairs
            .map(|pair| (pair[1].arrival - pair[0].arrival).as_secs_f64() * 1000.0)
            .collect()
    }

    /// Between the device's stamps of two codes that follow each other, ms.
    pub(crate) fn device_intervals_ms(&self) -> Vec<f64> {
        let times: Vec<u64> = self
            .codes
            .iter()
            .filter(|heard| !heard.is_filler())
            .map(Heard::device_us)
            .collect();
        let micros = times.windows(2).map(|pair| pair[1].saturating_sub(pair[0]));
        micros
            .map(|us| f64::from(u32::try_from(us).unwrap_or(u32::MAX)) / 1000.0)
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use neuro_ros::NeuroDataInt32;

    use super::*;

    fn heard(window: u16, us: u64, flags: u16) -> Heard {
        let mut tri = NeuroDataInt32::default();
        let time = [us & 0xFFFF, us >> 16 & 0xFFFF, us >> 32]
            .map(|word| i32::try_from(word).expect("16 bits"));
        for (label, word) in [
            ("flags", flags.into()),
            ("seq_lo", window.into()),
            ("seq_hi", 0),
            ("t_us_0", time[0]),
            ("t_us_1", time[1]),
            ("t_us_2", time[2]),
        ] {
            tri.info.labels.push(label.to_owned());
            tri.data.push(word);
        }
        Heard {
            arrival: Instant::now(),
            frame: NeuroFrame {
                tri,
                ..NeuroFrame::default()
            },
        }
    }

    #[test]
    fn made_is_received_and_lost_and_a_filler_is_lost() {
        let filler = heard(1, 0, Flags::FILLER.bits());
        let codes = vec![
            heard(0, 0x1_0000_FFFF, 0),
            filler,
            heard(2, 0x1_0001_F447, 0),
        ];
        let run = Run {
            codes,
            ..Run::default()
        };
        assert_eq!([run.made(), run.received(), run.lost()], [3, 2, 1]);
        let interval = run.device_intervals_ms();
        assert!(
            (interval[0] - 62.536).abs() < 1e-9 && interval.len() == 1,
            "{interval:?}"
        );
        // The board knows of one more that nobody heard.
        let run = Run {
            made_by_board: Some(4),
            ..run
        };
        assert_eq!([run.made(), run.received(), run.lost()], [4, 2, 2]);
    }
}
