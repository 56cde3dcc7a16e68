//! Blocks of rows and events, to which a recording's streams are converted before writing.

use bridge_core::TRI_LABELS;
use link::Flags;
use neuro_ros::NeuroFrame;

/// Number of streams in [`Stream::ALL`].
pub(crate) const STREAMS: usize = 5;

/// A stream of a recording; each is written to a file of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stream {
    Codes,
    Reconstructed,
    Raw,
    Filtered,
    Predictions,
}

impl Stream {
    /// All streams in the order of their discriminants, which index arrays with an element per
    /// stream.
    pub(crate) const ALL: [Stream; STREAMS] =
        [Stream::Codes, Stream::Reconstructed, Stream::Raw, Stream::Filtered, Stream::Predictions];

    /// Returns the part of a file's name that names the stream, such as `raw` in `a.raw.gdf`.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Stream::Codes => "codes",
            Stream::Reconstructed => "reconstructed",
            Stream::Raw => "raw",
            Stream::Filtered => "filtered",
            Stream::Predictions => "predictions",
        }
    }
}

/// Consecutive rows of one stream; a row is a code, a sample, a step or a prediction.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    pub(crate) stream: Stream,
    /// The frame that the bridge's core has published: values, status words, rate and labels.
    pub(crate) frame: NeuroFrame,
    /// Number of restarts of the device before these rows. Device times before and after a restart
    /// cannot be compared.
    pub(crate) run: u32,
    /// Device time when the signals of the first row were at the electrodes, microseconds. Negative
    /// if that was before the device started.
    pub(crate) first_us: i64,
    /// Wall clock when the signals of the first row were at the electrodes, nanoseconds since 1970.
    pub(crate) wall_ns: i64,
    /// Index of the first row in its stream; `None` for codes, reconstructed rows and predictions.
    pub(crate) index: Option<u64>,
}

impl Block {
    pub(crate) fn rows(&self) -> usize {
        usize::from(self.frame.eeg.info.nsamples)
    }

    /// Returns whether all rows of the block are fillers.
    pub(crate) fn is_filler(&self) -> bool {
        let filler = i32::from(Flags::FILLER.bits());
        let mut words = self.frame.tri.data.chunks_exact(TRI_LABELS.len());
        words.all(|words| words[0] & filler != 0)
    }

    /// Returns the time from the first row to row `row`, microseconds, rounded down.
    pub(crate) fn offset_us(&self, row: usize) -> i64 {
        let row = i64::try_from(row).unwrap_or(i64::MAX);
        row.saturating_mul(1_000_000) / i64::from(self.frame.sr.max(1))
    }

    /// Returns the values of row `row`: the electrodes first, then spare channels.
    pub(crate) fn values(&self, row: usize) -> impl Iterator<Item = f32> {
        let of = |data: &'_ [f32], width: u16| {
            let width = usize::from(width);
            data.get(row * width..(row + 1) * width).unwrap_or_default().to_vec()
        };
        let eeg = of(&self.frame.eeg.data, self.frame.eeg.info.nchannels);
        eeg.into_iter().chain(of(&self.frame.exg.data, self.frame.exg.info.nchannels))
    }

    /// Returns the status words of row `row`, in the order of [`TRI_LABELS`].
    pub(crate) fn words(&self, row: usize) -> &[i32] {
        let width = TRI_LABELS.len();
        let words = self.frame.tri.data.get(row * width..(row + 1) * width);
        words.unwrap_or(&[0; TRI_LABELS.len()])
    }

    /// Turns all rows into fillers, which repeat the values of the last row. Advances the times and
    /// the index by `rows` rows.
    pub(crate) fn become_filler(&mut self, rows: u64) {
        let period = u64::from(self.frame.sr.max(1));
        let later_us = i64::try_from(rows.saturating_mul(1_000_000) / period).unwrap_or(i64::MAX);
        self.first_us = self.first_us.saturating_add(later_us);
        self.wall_ns = self.wall_ns.saturating_add(later_us.saturating_mul(1000));
        self.index = self.index.map(|index| index + rows);
        let last = self.rows() - 1;
        for data in [&mut self.frame.eeg, &mut self.frame.exg] {
            let width = usize::from(data.info.nchannels);
            for row in 0..last {
                data.data.copy_within(last * width.., row * width);
            }
        }
        for words in self.frame.tri.data.chunks_exact_mut(TRI_LABELS.len()) {
            words[0] = i32::from(Flags::FILLER.bits());
        }
    }
}

/// An edge of the trigger input or a marker of the user, with its times.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct TimedEvent {
    /// Number of restarts of the device before the event happened.
    pub(crate) run: u32,
    /// Device time of the event, microseconds.
    pub(crate) device_us: i64,
    /// Wall clock when the event happened, nanoseconds since 1970.
    pub(crate) wall_ns: i64,
    /// Event code, as in GDF's table of events and on ROS-Neuro's event bus.
    pub(crate) code: u16,
    pub(crate) description: String,
}
