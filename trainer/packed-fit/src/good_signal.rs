//! Selects the part of a person's signal that a model is fitted to.

use crate::bad_electrodes::{interpolate, interpolate_bad, silent_electrodes};
use crate::innovation::SECOND;
use crate::track::Track;

/// A second is left out if more than this fraction of the electrodes is bad in it.
const MOST_BAD: f64 = 0.25;

/// Signal of a person without the parts that would spoil a fit. It has only the seconds in which at
/// least three quarters of the electrodes are good; in these seconds, the bad electrodes are
/// interpolated.
///
/// Electrodes are judged in each second as `trainer` judges them in each recording. An electrode
/// that is bad in at least a quarter of the seconds with a signal counts as bad in all of them.
/// This limit is safe: an electrode that is bad throughout is found in about half of the seconds or
/// more (FT8 of EEGMMIDB S004: in 52 of 102 and in 111 of 113 seconds).
#[derive(Clone, Debug, Default)]
pub struct GoodSignal {
    /// Stretches of consecutive good seconds, in the order of the recordings.
    pub tracks: Vec<Track>,
    /// Number of seconds that were judged.
    pub judged: usize,
    /// Number of judged seconds in which no electrode has a signal.
    pub silent: usize,
    /// For each electrode, the number of judged seconds with a signal in which it was bad.
    pub bad_seconds: Vec<usize>,
    /// For each electrode, whether it was bad or without a signal in the newest judged second.
    pub newest_bad: Vec<bool>,
}

impl GoodSignal {
    /// Selects the good seconds of `stretches`, in each of which no step is missing. Steps after
    /// the last whole second of a stretch are left out.
    pub fn select(stretches: &[Track], electrodes: &[String]) -> Self {
        let cut = stretches.iter().enumerate().flat_map(|(index, stretch)| {
            let starts = (0..stretch.steps() / SECOND).map(|second| second * SECOND);
            starts.map(move |start| (index, start, stretch.part(start..start + SECOND)))
        });
        let mut seconds: Vec<(usize, usize, Track)> = cut.collect();
        let judged = seconds.len();
        let has_signal = |second: &Track| silent_electrodes(second, electrodes).is_ok();
        let newest_is_silent = seconds.last().is_some_and(|newest| !has_signal(&newest.2));
        seconds.retain(|(.., second)| has_signal(second));
        let mut bad_seconds = vec![0; electrodes.len()];
        let silent = judged - seconds.len();
        let mut own: Vec<&mut Track> = seconds.iter_mut().map(|(.., second)| second).collect();
        if !own.is_empty() {
            // Interpolation fails only for a silent second, and silent seconds have been removed.
            let _ = interpolate_bad(&mut own, electrodes);
        }
        let newest = seconds.last().map(|(.., newest)| &newest.bad);
        let newest_bad = (0..electrodes.len()).map(|electrode| {
            newest_is_silent || newest.is_some_and(|newest| newest.contains(&electrode))
        });
        let newest_bad = newest_bad.collect();
        for &electrode in seconds.iter().flat_map(|(.., second)| &second.bad) {
            bad_seconds[electrode] += 1;
        }
        let mut signal = Self { tracks: Vec::new(), judged, silent, bad_seconds, newest_bad };
        let always: Vec<usize> = signal.always_bad().collect();
        let mut end = None;
        for (index, start, mut second) in seconds {
            second.bad.extend(&always);
            second.bad.sort_unstable();
            second.bad.dedup();
            if second.bad.len() as f64 > MOST_BAD * electrodes.len() as f64 {
                continue;
            }
            interpolate(&mut second, electrodes);
            // Clear the list of bad electrodes: it differs between the seconds that a stretch
            // joins.
            second.bad.clear();
            match signal.tracks.last_mut().filter(|_| end == Some((index, start))) {
                Some(track) => track.values.extend(second.values),
                None => signal.tracks.push(second),
            }
            end = Some((index, start + SECOND));
        }
        signal
    }

    /// Returns the indices of the electrodes that are bad in at least a quarter of the seconds with
    /// a signal.
    pub fn always_bad(&self) -> impl Iterator<Item = usize> {
        let bad = self.bad_seconds.iter().enumerate();
        let bad =
            bad.filter(|(_, seconds)| **seconds > 0 && 4 * **seconds >= self.judged - self.silent);
        bad.map(|(index, _)| index)
    }

    /// Returns the number of good seconds.
    pub fn seconds(&self) -> usize {
        self.tracks.iter().map(Track::steps).sum::<usize>() / SECOND
    }

    /// Removes all but the first `seconds` good seconds.
    pub fn truncate(&mut self, seconds: usize) {
        let [first, _] = split(&self.tracks, seconds * SECOND);
        self.tracks = first;
    }
}

/// Splits recordings into the first three quarters of their steps, and the last quarter.
pub(crate) fn first_three_quarters(tracks: &[Track]) -> [Vec<Track>; 2] {
    let steps: usize = tracks.iter().map(Track::steps).sum();
    split(tracks, steps / 4 * 3)
}

/// Splits recordings into the first `steps` steps, and the rest.
fn split(tracks: &[Track], mut steps: usize) -> [Vec<Track>; 2] {
    let mut parts = [Vec::new(), Vec::new()];
    for track in tracks {
        let first = steps.min(track.steps());
        steps -= first;
        let ranges = [0..first, first..track.steps()];
        for (part, range) in parts.iter_mut().zip(ranges) {
            if !range.is_empty() {
                part.push(track.part(range));
            }
        }
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const LABELS: [&str; 9] = ["F3", "Fz", "F4", "C3", "Cz", "C4", "P3", "Pz", "P4"];
    const CZ: usize = 4;

    /// Returns a stretch in which neighbouring electrodes are similar. `change` gets the index of
    /// the second, a random number from -1 to 1, and the values of a step, which it may change.
    fn stretch(seconds: usize, change: impl Fn(usize, f32, &mut [f32; 9])) -> Track {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let values = (0..seconds * SECOND).flat_map(|step| {
            let [x, y, z]: [f32; 3] = std::array::from_fn(|_| rng.random_range(-20.0..20.0));
            let mut values: [f32; 9] = std::array::from_fn(|at| {
                let (row, column) = ((at / 3) as f32, (at % 3) as f32);
                x + y * row / 2.0 + z * column / 2.0 + rng.random_range(-1.0..1.0)
            });
            change(step / SECOND, rng.random_range(-1.0..1.0), &mut values);
            values
        });
        Track::new("device", 9, values.collect())
    }

    #[test]
    fn bad_seconds_are_interpolated_or_left_out_and_counted() {
        type Change = fn(usize, f32, &mut [f32; 9]);
        let pop: Change = |second, noise, values| {
            if second == 3 {
                values[CZ] += 300.0 * noise;
            }
        };
        let flat: Change = |second, _, values| {
            if second >= 8 {
                values[CZ] = 0.01;
            }
        };
        let silent: Change = |second, _, values| {
            if second == 2 || second == 9 {
                values.fill(0.0);
            }
        };
        let off: Change = |second, noise, values| {
            if second >= 5 {
                values.fill(0.0);
            } else if second == 0 {
                values[CZ] += 300.0 * noise;
            }
        };
        let three: Change = |second, noise, values| {
            if second == 5 {
                for (at, factor) in [(0, 1.0), (CZ, 97.0), (8, 211.0)] {
                    values[at] = 300.0 * (factor * noise).sin();
                }
            }
        };
        let noise: Change = |_, noise, values| values[CZ] += 100.0 * noise;
        for (name, change, good, cz, stretches, newest, always) in [
            ("pop", pop, 10, 1, 1, false, false),
            ("flat", flat, 10, 2, 1, true, false),
            ("silent", silent, 8, 0, 2, true, false),
            ("off", off, 5, 1, 1, true, false),
            ("three", three, 9, 1, 2, false, false),
            ("noise", noise, 10, 10, 1, true, true),
        ] {
            let recorded = stretch(10, change);
            let labels = LABELS.map(str::to_owned);
            let signal = GoodSignal::select(std::slice::from_ref(&recorded), &labels);
            assert_eq!(signal.judged, 10, "{name}");
            let silent = ["silent", "off"].iter().position(|known| *known == name);
            assert_eq!(signal.silent, silent.map_or(0, |at| [2, 5][at]), "{name}");
            assert_eq!(signal.seconds(), good, "{name}");
            assert_eq!(signal.tracks.len(), stretches, "{name}");
            assert_eq!(signal.bad_seconds[CZ], cz, "{name}");
            assert_eq!(signal.newest_bad[CZ], newest, "{name}");
            let expected: &[usize] = if always { &[CZ] } else { &[] };
            assert!(signal.always_bad().eq(expected.iter().copied()), "{name}");
            // Interpolated from four neighbours, Cz is close to its signal without the fault.
            let clean = stretch(10, |_, _, _| ());
            if good == 10 {
                let values = signal.tracks[0].values.iter().zip(&clean.values);
                let largest = values.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                assert!(largest < 5.0, "{name}: {largest}");
            }
        }
    }

    #[test]
    fn stretches_are_not_joined_and_parts_of_seconds_are_left_out() {
        let labels = LABELS.map(str::to_owned);
        let mut first = stretch(3, |_, _, _| ());
        first.values.truncate(9 * (2 * SECOND + 100));
        let stretches = [first, stretch(2, |_, _, _| ())];
        let mut signal = GoodSignal::select(&stretches, &labels);
        assert_eq!((signal.judged, signal.seconds()), (4, 4));
        assert_eq!(signal.tracks.len(), 2);
        assert_eq!(signal.tracks[1].values, stretches[1].values);
        signal.truncate(3);
        assert_eq!(
            signal.tracks.iter().map(Track::steps).collect::<Vec<_>>(),
            [2 * SECOND, SECOND]
        );
        let nothing = GoodSignal::select(&[], &labels);
        assert_eq!((nothing.judged, nothing.seconds()), (0, 0));
        assert_eq!(nothing.newest_bad, [false; 9]);
    }
}
