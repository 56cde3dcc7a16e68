//! Messages that the subscriber received during one run.

use std::time::Instant;

use link::Flags;
use neuro_ros::NeuroFrame;

/// One message from the bridge, with the time at which it arrived.
#[derive(Debug, Clone)]
pub(crate) struct Received {
    pub(crate) arrival: Instant,
    pub(crate) frame: NeuroFrame,
}

impl Received {
    /// Index of the code's window since the device started the stream.
    pub(crate) fn window(&self) -> u64 {
        self.word("seq_lo") | self.word("seq_hi") << 16
    }

    /// Device time of the code's last sample, us.
    fn device_us(&self) -> u64 {
        self.word("t_us_0") | self.word("t_us_1") << 16 | self.word("t_us_2") << 32
    }

    /// Returns whether the bridge sent this message in place of a lost code.
    pub(crate) fn is_filler(&self) -> bool {
        self.has(Flags::FILLER)
    }

    /// Returns whether the device's filters were still settling when the code was made.
    pub(crate) fn is_settling(&self) -> bool {
        self.has(Flags::SETTLING)
    }

    fn has(&self, flag: Flags) -> bool {
        self.word("flags") & u64::from(flag.bits()) != 0
    }

    /// Returns the status word with this label, 16 bits; 0 if the frame has no such word.
    fn word(&self, label: &str) -> u64 {
        let tri = &self.frame.tri;
        let place = tri.info.labels.iter().position(|name| name == label);
        let word = place.and_then(|place| tri.data.get(place));
        word.and_then(|word| u64::try_from(*word).ok()).unwrap_or(0)
    }
}

/// Messages of one run in the order of their arrival, and the number of codes that the board
/// reports.
#[derive(Debug, Clone, Default)]
pub(crate) struct Run {
    /// Messages that arrived on `/encoded`.
    pub(crate) codes: Vec<Received>,
    /// Messages that arrived on `/neurodata_reconstructed`.
    pub(crate) reconstructed: Vec<Received>,
    /// Number of codes made, from the board's report; `None` if its report has no such number.
    pub(crate) made_by_board: Option<usize>,
}

impl Run {
    /// Number of codes that the board made: its own count or, without one, the highest received
    /// index plus one.
    pub(crate) fn made(&self) -> usize {
        let indices = self.codes.iter().map(Received::window);
        let highest = indices.max().map_or(0, |index| index + 1);
        self.made_by_board
            .unwrap_or(usize::try_from(highest).unwrap_or(usize::MAX))
    }

    /// Number of codes that arrived at the subscriber, without fillers.
    pub(crate) fn received(&self) -> usize {
        self.codes.iter().filter(|code| !code.is_filler()).count()
    }

    /// Number of codes that were made but did not arrive.
    pub(crate) fn lost(&self) -> usize {
        self.made().saturating_sub(self.received())
    }

    /// Times between the arrivals of successive codes at the subscriber, ms.
    pub(crate) fn arrival_intervals_ms(&self) -> Vec<f64> {
        let pairs = self.codes.windows(2);
        pairs
            .map(|pair| (pair[1].arrival - pair[0].arrival).as_secs_f64() * 1000.0)
            .collect()
    }

    /// Differences between the device times of successive received codes, ms.
    pub(crate) fn device_intervals_ms(&self) -> Vec<f64> {
        let codes = self.codes.iter().filter(|code| !code.is_filler());
        let times: Vec<u64> = codes.map(Received::device_us).collect();
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

    fn received(window: u16, us: u64, flags: u16) -> Received {
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
        Received {
            arrival: Instant::now(),
            frame: NeuroFrame {
                tri,
                ..NeuroFrame::default()
            },
        }
    }

    #[test]
    fn made_is_received_plus_lost_and_a_filler_counts_as_lost() {
        let run = Run {
            codes: vec![
                received(0, 0x1_0000_FFFF, 0),
                received(1, 0, Flags::FILLER.bits()),
                received(2, 0x1_0001_F447, 0),
            ],
            ..Run::default()
        };
        assert_eq!([run.made(), run.received(), run.lost()], [3, 2, 1]);
        let interval = run.device_intervals_ms();
        assert!(
            (interval[0] - 62.536).abs() < 1e-9 && interval.len() == 1,
            "{interval:?}"
        );
        // The board counts one more code, which never arrived.
        let run = Run {
            made_by_board: Some(4),
            ..run
        };
        assert_eq!([run.made(), run.received(), run.lost()], [4, 2, 2]);
    }
}
