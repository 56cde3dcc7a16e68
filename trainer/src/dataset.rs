//! Windows of tracks: at random offsets for training, at every hop for evaluation.

use crate::error::TrainerError;
use crate::track::{Step, Track};
use artifact::{STEPS, WINDOW_ELECTRODES};
use rand::{Rng, RngExt};

/// The last 1 / `VALIDATION_PART` of every track is used for validation.
const VALIDATION_PART: usize = 8;

/// Contiguous segments of filtered recordings, from which windows are cut.
#[derive(Clone, Debug, Default)]
pub struct Dataset {
    segments: Vec<Vec<Step>>,
}

/// A window of 16 time steps, flattened: the value of an electrode has the index step * 61 + electrode.
pub type Window = [f32; WINDOW_ELECTRODES];

impl Dataset {
    /// Creates a dataset from whole tracks.
    ///
    /// # Errors
    /// If a track is shorter than a window.
    pub fn from_tracks(tracks: &[Track]) -> Result<Self, TrainerError> {
        tracks.iter().try_for_each(|track| require(track, STEPS))?;
        Ok(Self {
            segments: tracks.iter().map(|track| track.steps.clone()).collect(),
        })
    }

    /// Splits every track: the last eighth is for validation, the rest for training. The 16 time steps
    /// between the two parts are in neither, so that windows of different parts are not adjacent.
    ///
    /// # Errors
    /// If a track has fewer than 256 time steps: its last eighth would be shorter than two windows.
    pub fn split(tracks: &[Track]) -> Result<Split, TrainerError> {
        let mut split = Split {
            training: Self::default(),
            validation: Self::default(),
        };
        for track in tracks {
            require(track, 2 * VALIDATION_PART * STEPS)?;
            let at = track.steps.len() - track.steps.len() / VALIDATION_PART;
            split
                .training
                .segments
                .push(track.steps[..at - STEPS].to_vec());
            split.validation.segments.push(track.steps[at..].to_vec());
        }
        Ok(split)
    }

    /// Creates a dataset from segments of at least 16 time steps each.
    ///
    /// # Panics
    /// If a segment is shorter than 16 time steps.
    pub fn from_segments(segments: Vec<Vec<Step>>) -> Self {
        assert!(
            segments.iter().all(|steps| steps.len() >= STEPS),
            "every segment must hold a window"
        );
        Self { segments }
    }

    /// Multiplies every value of the dataset by `factor`.
    pub fn scale(&mut self, factor: f64) {
        #[expect(clippy::cast_possible_truncation, reason = "a float network takes f32")]
        for value in self.segments.iter_mut().flatten().flatten() {
            *value = (f64::from(*value) * factor) as f32;
        }
    }

    /// Returns the root mean square over all time steps and electrodes. This is the standard deviation,
    /// because the band-pass removes the mean.
    pub fn deviation(&self) -> f64 {
        let values = self.segments.iter().flatten().flatten();
        let (count, sum) = values.fold((0_u64, 0.0), |(count, sum), value| {
            (count + 1, sum + f64::from(*value).powi(2))
        });
        #[expect(clippy::cast_precision_loss, reason = "far fewer than 2^53 numbers")]
        let mean = sum / count as f64;
        mean.sqrt()
    }

    /// Returns the largest magnitude of all values, in the unit of the dataset.
    pub fn max_abs(&self) -> f32 {
        let values = self.segments.iter().flatten().flatten();
        values.fold(0.0, |largest, value| largest.max(value.abs()))
    }

    /// Returns the number of disjoint windows, which determines the number of windows of an epoch.
    pub fn disjoint_windows(&self) -> usize {
        self.segments.iter().map(|steps| steps.len() / STEPS).sum()
    }

    /// Returns the windows that start at every `hop`-th time step of every segment.
    pub fn aligned(&self, hop: usize) -> Vec<&Window> {
        let segments = self.segments.iter();
        segments
            .flat_map(|steps| {
                (0..=steps.len() - STEPS)
                    .step_by(hop)
                    .map(|at| window(steps, at))
            })
            .collect()
    }

    /// Returns `count` windows at random offsets, uniformly distributed over all segments.
    pub fn random(&self, count: usize, rng: &mut impl Rng) -> Vec<&Window> {
        let offsets: usize = self
            .segments
            .iter()
            .map(|steps| steps.len() - STEPS + 1)
            .sum();
        let mut draw = || {
            let mut at = rng.random_range(0..offsets);
            for steps in &self.segments {
                let here = steps.len() - STEPS + 1;
                if at < here {
                    return window(steps, at);
                }
                at -= here;
            }
            unreachable!("the offset is below the sum over all segments")
        };
        (0..count).map(|_| draw()).collect()
    }
}

/// The two parts of the training tracks.
#[derive(Clone, Debug)]
pub struct Split {
    /// Windows for training.
    pub training: Dataset,
    /// Windows on which the best epoch is selected.
    pub validation: Dataset,
}

fn require(track: &Track, needed: usize) -> Result<(), TrainerError> {
    let steps = track.steps.len();
    if steps >= needed {
        return Ok(());
    }
    Err(TrainerError::TooShort {
        name: track.name.clone(),
        steps,
        needed,
    })
}

fn window(steps: &[Step], at: usize) -> &Window {
    let flat = steps[at..at + STEPS].as_flattened();
    flat.try_into().expect("16 steps of 61 electrodes")
}

#[cfg(test)]
mod tests {
    use super::*;
    use artifact::ELECTRODES;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    /// Returns a track whose values equal the index of their time step.
    #[expect(clippy::cast_precision_loss, reason = "a few hundred steps")]
    fn ramp(length: usize) -> Track {
        let steps = (0..length).map(|step| [step as f32; ELECTRODES]).collect();
        Track {
            name: "ramp".to_owned(),
            steps,
            interpolated: vec![],
            saturated: 0,
            warnings: Vec::new(),
        }
    }

    #[test]
    fn training_and_validation_are_separated_by_a_window() {
        let split = Dataset::split(&[ramp(800)]).unwrap();
        let last = split.training.aligned(1).last().unwrap()[WINDOW_ELECTRODES - 1];
        let first = split.validation.aligned(1)[0][0];
        assert!((first - last - 17.0).abs() < f32::EPSILON, "{last} {first}");
        assert_eq!(split.validation.disjoint_windows(), 100 / 16);
    }

    #[test]
    fn aligned_windows_are_a_hop_apart_within_their_segment() {
        let dataset = Dataset::from_tracks(&[ramp(40), ramp(16)]).unwrap();
        let starts: Vec<f32> = dataset.aligned(8).iter().map(|window| window[0]).collect();
        assert_eq!(starts, [0.0, 8.0, 16.0, 24.0, 0.0]);
    }

    #[test]
    fn random_windows_reach_every_offset_and_depend_on_the_seed_only() {
        let dataset = Dataset::from_tracks(&[ramp(20), ramp(17)]).unwrap();
        let draw = |seed| -> Vec<f32> {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            dataset
                .random(200, &mut rng)
                .iter()
                .map(|window| window[0])
                .collect()
        };
        assert_eq!(draw(1), draw(1));
        assert_ne!(draw(1), draw(2));
        for offset in [0.0, 1.0, 2.0, 3.0, 4.0] {
            assert!(draw(1).contains(&offset), "offset {offset} is never drawn");
        }
    }

    #[test]
    fn the_error_of_a_short_track_names_it() {
        let error = Dataset::split(&[ramp(200)]).unwrap_err();
        assert!(
            error.to_string().starts_with("ramp has 200 time steps"),
            "{error}"
        );
    }

    #[test]
    fn dividing_by_the_deviation_makes_it_one() {
        let mut dataset = Dataset::from_tracks(&[ramp(50)]).unwrap();
        dataset.scale(1.0 / dataset.deviation());
        assert!((dataset.deviation() - 1.0).abs() < 1e-6);
    }
}
