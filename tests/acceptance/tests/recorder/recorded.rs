//! What ROS-Neuro's recorder has written.

use std::ops::Range;

use recordings::{Block, EventLabel, Recording};

use crate::{FRAME, RATE, TRIGGER_HIGH};

/// Number of samples, 3 s from the start of a board's run, after which the bridge knows the rate of
/// the board's clock.
const SETTLING: usize = 48 * FRAME;

/// The contents of a recording that the tests check.
pub(crate) struct Recorded {
    /// Status words of each sample: flags, number of the frame, and level of the trigger input.
    pub(crate) flags: Vec<u16>,
    pub(crate) frames: Vec<u32>,
    pub(crate) trigger: Vec<u16>,
    /// Values of the electrodes and spare channels of each sample.
    pub(crate) signals: Vec<Vec<f32>>,
    /// Positions, in samples, of the rising edges that the recorder has stored as events.
    rises: Vec<f64>,
    /// Codes of the events that are neither rising nor falling edges.
    pub(crate) reports: Vec<u16>,
}

impl Recorded {
    pub(crate) fn read(mut recording: Recording) -> Self {
        let words = ["flags", "seq_lo", "seq_hi", "trigger"];
        let labels = recording.labels();
        let places =
            words.map(|word| labels.iter().position(|label| *label == word).expect("a word"));
        let mut values = [const { Vec::new() }; 4];
        let mut signals = Vec::new();
        let mut block = Block::default();
        while recording.read_block(&mut block).expect("a whole file") {
            for (values, place) in values.iter_mut().zip(places) {
                values.extend(block.samples[place].iter().map(|&value| word(value)));
            }
            let columns = &block.samples[..places[0]];
            let rows = 0..columns[0].len();
            signals.extend(rows.map(|row| columns.iter().map(|of| of[row] as f32).collect()));
        }
        // The recorder's library fills the last record of 1 s with zeros. Cut them off: only the
        // bridge's first frame has sequence number 0.
        let written = values[1].iter().zip(&values[2]).rposition(|words| words != (&0, &0));
        for values in &mut values {
            values.truncate(written.map_or(0, |last| last + 1));
        }
        signals.truncate(values[0].len());
        let events = recording.events().expect("an event table");
        let mut recorded = Self {
            frames: values[1]
                .iter()
                .zip(&values[2])
                .map(|(low, high)| u32::from(*low) | u32::from(*high) << 16)
                .collect(),
            flags: values[0].clone(),
            trigger: values[3].clone(),
            signals,
            rises: Vec::new(),
            reports: Vec::new(),
        };
        for event in events {
            match event.label {
                EventLabel::Type(TRIGGER_HIGH) => recorded.rises.push(event.onset_s * RATE),
                EventLabel::Type(code) if code & 0x8000 == 0 => recorded.reports.push(code),
                _ => {}
            }
        }
        recorded
    }

    /// Checks that the frames' numbers have no gap and that each rising edge in the status words
    /// has an event. Returns the largest distance of such an event from its edge, in seconds.
    pub(crate) fn largest_error_s(&self) -> f64 {
        for (sample, frame) in self.frames.iter().enumerate() {
            let since_start = frame - self.frames[0];
            assert_eq!(since_start as usize, sample / FRAME, "sample {sample}");
        }
        let pairs = self.trigger.windows(2).enumerate();
        let rises = pairs
            .filter(|(_, pair)| *pair == [0, 1])
            .map(|(sample, _)| sample + 1)
            // Skip edges in the first frame: their events were published before the recording
            // began.
            .filter(|sample| *sample >= FRAME);
        let errors = rises.map(|sample| {
            // The trigger input rose between the sample before and this one.
            let errors = self.rises.iter().map(|rise| rise - (sample as f64 - 0.5));
            let nearest = errors.min_by(|a, b| a.abs().total_cmp(&b.abs()));
            nearest.expect("an event") / RATE
        });
        let errors: Vec<f64> = errors.collect();
        assert!(errors.len() >= 3, "{} edges", errors.len());
        errors.iter().fold(0.0, |most: f64, error| most.max(error.abs()))
    }

    pub(crate) fn is_filler(&self, sample: usize) -> bool {
        self.flags[sample] & 0x8000 != 0
    }

    /// Returns the recording from `sample` on, without events.
    pub(crate) fn since(&self, sample: usize) -> Self {
        Self {
            flags: self.flags[sample..].to_vec(),
            frames: self.frames[sample..].to_vec(),
            trigger: self.trigger[sample..].to_vec(),
            signals: self.signals[sample..].to_vec(),
            rises: Vec::new(),
            reports: Vec::new(),
        }
    }

    /// Returns the range of samples of each of the board's `count` runs, one or two. Two runs are
    /// separated by the longest series of fillers in the recording.
    pub(crate) fn runs(&self, count: usize) -> Vec<Range<usize>> {
        let all = 0..self.flags.len();
        if count == 1 {
            return vec![all];
        }
        let (mut longest, mut start) = (0..0, 0);
        for sample in all.clone() {
            if !self.is_filler(sample) {
                start = sample + 1;
            } else if sample + 1 - start > longest.len() {
                longest = start..sample + 1;
            }
        }
        vec![all.start..longest.start, longest.end..all.end]
    }

    /// Returns the first sample of a run after [`SETTLING`].
    pub(crate) fn settled(&self, run: &Range<usize>) -> usize {
        // The first run began with the bridge's first frame, which may not be in the recording.
        let before = if run.start == 0 { self.frames[0] as usize * FRAME } else { 0 };
        run.start + SETTLING.saturating_sub(before)
    }

    pub(crate) fn fillers(&self) -> usize {
        (0..self.flags.len()).filter(|sample| self.is_filler(*sample)).count()
    }
}

/// Returns a recorded status word as the integer that was published.
fn word(value: f64) -> u16 {
    assert!(value.is_finite() && (value - value.round()).abs() < 0.01, "{value} is no word");
    let word = value.round();
    assert!((0.0..=65_535.0).contains(&word), "{value} is no word");
    #[expect(clippy::cast_sign_loss, reason = "checked above")]
    let word = word as u16;
    word
}
