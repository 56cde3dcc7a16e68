//! Checks what a recorder of the Lab Streaming Layer has received: compares it with the recording
//! that ROS-Neuro's recorder made at the same time, and with the board's clock.

use std::ops::Range;
use std::path::Path;

use acceptance::lsl_recording::{LslRecording, LslSignal};

use crate::RATE;
use crate::recorded::Recorded;

/// Largest permitted error of a sample's time, seconds.
const TOLERANCE_S: f64 = 1e-3;
/// Largest permitted error in the first seconds of a board's run, when its clock's rate is unknown.
const UNSETTLED_TOLERANCE_S: f64 = 5e-3;
/// Largest permitted value of the shortest time from a sample to its arrival, seconds.
const DELAY_S: f64 = 0.02;
/// Rounding of a value in the file of ROS-Neuro's recorder, uV.
const ROUNDING_UV: f32 = 0.05;
/// Number of consecutive equal samples by which the two recordings are aligned.
const ALIGNED: usize = 8;

/// The streams `raw` and `events`.
pub(crate) struct Streamed {
    raw: LslSignal,
    markers: Vec<(f64, String)>,
    /// Shortest time from a sample to its arrival, seconds.
    least_delay_s: f64,
}

impl Streamed {
    pub(crate) fn read(folder: &Path) -> Self {
        let recording = LslRecording::read(folder);
        let least_delay_s = &recording.described["streams"]["raw"]["least_delay_s"];
        Self {
            raw: recording.signal("raw"),
            markers: recording.markers(),
            least_delay_s: least_delay_s.as_f64().expect("samples"),
        }
    }

    /// Checks that the samples equal those of `recorded`, that their times are correct by the
    /// board's clock, and that each marker is at its sample. `ppm` states, for each run of the
    /// board, by how many parts per million the board's clock is fast; the samples must follow each
    /// other at this true rate, also across a gap. Returns the largest error of a time after
    /// settling, seconds.
    pub(crate) fn check(&self, recorded: &Recorded, ppm: &[i32]) -> f64 {
        let (times, recorded) = self.common(recorded);
        for (sample, pair) in times.windows(2).enumerate() {
            assert!(pair[0] < pair[1], "sample {sample}: {pair:?}");
        }
        // No sample arrives before it is made, and the shortest delay is small.
        assert!(
            (-TOLERANCE_S..DELAY_S).contains(&self.least_delay_s),
            "{} s from a sample to its arrival",
            self.least_delay_s
        );
        let runs = recorded.runs(ppm.len());
        self.check_markers(&recorded, &times, &runs);
        let errors = runs.iter().zip(ppm).map(|(run, ppm)| {
            let period_s = 1.0 / RATE / (1.0 + f64::from(*ppm) * 1e-6);
            let samples = run.clone().filter(|sample| !recorded.is_filler(*sample));
            // Offset of each sample's time from a clock that has the true rate and reads 0 at the
            // first sample of the recording.
            let samples = samples.map(|sample| (sample, times[sample] - sample as f64 * period_s));
            largest_error_s(&samples.collect::<Vec<_>>(), recorded.settled(run))
        });
        errors.fold(0.0, f64::max)
    }

    /// Returns the times of the samples that both recordings have, and `recorded` cut to these
    /// samples.
    fn common(&self, recorded: &Recorded) -> (Vec<f64>, Recorded) {
        let channels = self.raw.channels;
        let rows: Vec<&[f32]> = self.raw.values.chunks(channels).collect();
        let is_start = |first: usize, streamed: usize| {
            let recorded = recorded.signals.iter().skip(first);
            let mut pairs = recorded.zip(&rows[streamed..]).take(ALIGNED);
            pairs.all(|(recorded, streamed)| is_same(recorded, streamed))
        };
        let is_lost = |row: &usize| (*row..row + ALIGNED).any(|row| recorded.is_filler(row));
        let mut starts = 0..recorded.flags.len() - ALIGNED;
        let first = starts.find(|row| !is_lost(row)).expect("some samples");
        // Either recording may have begun earlier.
        let [skipped, before] = (first..rows.len())
            .find(|place| is_start(first, *place))
            .map(|place| [0, place - first])
            .or_else(|| Some([(first..recorded.flags.len()).find(|row| is_start(*row, 0))?, 0]))
            .expect("the same samples");
        let recorded = recorded.since(skipped);
        let times = &self.raw.times[before..];
        assert!(times.len() >= recorded.flags.len(), "the newest samples");
        for (sample, (streamed, values)) in rows[before..].iter().zip(&recorded.signals).enumerate()
        {
            assert!(is_same(values, streamed), "sample {sample}: {values:?}, {streamed:?}");
        }
        (times[..recorded.flags.len()].to_vec(), recorded)
    }

    /// Checks that each edge of the trigger input has a marker between the samples around it, and
    /// that each beginning and end of fillers has a marker at its sample. Further markers within
    /// `times` may only repeat the level: after lost samples, the edge between two can be lost.
    /// Before a run has settled, samples that would be earlier than the one before are moved, and
    /// edges between them are not.
    fn check_markers(&self, recorded: &Recorded, times: &[f64], runs: &[Range<usize>]) {
        let samples = 0..times.len();
        let fillers: Vec<bool> = samples.map(|sample| recorded.is_filler(sample)).collect();
        let trigger: Vec<bool> = recorded.trigger.iter().map(|level| *level == 1).collect();
        for (text, levels, becomes) in [
            ("trigger high", &trigger, true),
            ("trigger low", &trigger, false),
            ("filler begin raw", &fillers, true),
            ("filler end raw", &fillers, false),
        ] {
            let of_text = self.markers.iter().filter(|(_, marker)| marker == text);
            let mut marks: Vec<f64> = of_text.map(|(time, _)| *time).collect();
            let pairs = levels.windows(2).zip(times.windows(2));
            let pairs = pairs.enumerate();
            let changes =
                pairs.filter(|(_, (levels, _))| levels[0] != becomes && levels[1] == becomes);
            for (sample, (_, at)) in changes {
                let [before, after] = [at[0], at[1]];
                let from = if text.starts_with("filler") { after } else { before };
                let mut settled = runs.iter().map(|run| recorded.settled(run)..run.end);
                let is_settled = settled.any(|settled| settled.contains(&sample));
                let tolerance_s = if is_settled { TOLERANCE_S } else { UNSETTLED_TOLERANCE_S };
                let near = (from - tolerance_s)..(after + tolerance_s);
                let found = marks.iter().position(|mark| near.contains(mark));
                let found = found.unwrap_or_else(|| panic!("{text} at {after}: {marks:?}"));
                marks.swap_remove(found);
            }
            for mark in marks {
                let next = times.partition_point(|time| *time < mark);
                let since = fillers[..next].iter().rposition(|is_filler| *is_filler);
                let is_repeated = since.is_some_and(|since| {
                    let mut levels = levels[since..].iter().take(next + 1 - since);
                    levels.all(|level| *level == becomes)
                });
                let is_outside = next == 0 || next == times.len();
                assert!(is_outside || is_repeated, "{text} at {mark}");
            }
        }
    }
}

/// Checks how far `offsets`, pairs of a sample's index and its offset in seconds, differ from the
/// median offset of the samples from `settled` on. Earlier samples may differ more, because the
/// bridge does not know the rate of the board's clock yet. Returns the largest difference over the
/// samples from `settled` on, in seconds.
fn largest_error_s(offsets: &[(usize, f64)], settled: usize) -> f64 {
    let first = offsets.partition_point(|(sample, _)| *sample < settled);
    let of =
        |offsets: &[(usize, f64)]| offsets.iter().map(|(_, offset)| *offset).collect::<Vec<_>>();
    let [early, mut late] = [&offsets[..first], &offsets[first..]].map(of);
    late.sort_by(f64::total_cmp);
    let truth = *late.get(late.len() / 2).expect("samples after the clock has settled");
    let largest =
        |offsets: &[f64]| offsets.iter().fold(0.0, |most: f64, of| most.max((of - truth).abs()));
    let [early, late] = [&early, &late].map(|offsets| largest(offsets));
    assert!(early < UNSETTLED_TOLERANCE_S, "{early} s");
    assert!(late < TOLERANCE_S, "{late} s");
    late
}

/// Returns whether a sample is equal in both recordings up to the rounding of ROS-Neuro's recorder.
fn is_same(recorded: &[f32], streamed: &[f32]) -> bool {
    let mut pairs = recorded.iter().zip(streamed);
    recorded.len() == streamed.len() && pairs.all(|(a, b)| (a - b).abs() < ROUNDING_UV)
}
