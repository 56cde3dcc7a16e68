//! Windows of tracks: at random offsets for training, at every hop for evaluation.

use crate::error::TrainerError;
use crate::pca;
use artifact::Dimensions;
use packed_fit::directions::principal_directions;
use packed_fit::{FitError, Track};
use rand::{Rng, RngExt};

/// Number of equal parts of a track; the last part is for validation.
const VALIDATION_PART: usize = 8;

/// Contiguous segments of filtered recordings, from which windows are cut.
#[derive(Clone, Debug)]
pub(crate) struct Dataset {
    dimensions: Dimensions,
    /// Values of each segment, in the order step, electrode (the last fastest).
    segments: Vec<Vec<f32>>,
}

/// The values of a window, in the order step, electrode (the last fastest).
pub(crate) type Window = [f32];

impl Dataset {
    /// Creates a dataset from whole tracks.
    ///
    /// # Errors
    /// If a track is shorter than a window.
    pub(crate) fn from_tracks(
        tracks: &[Track],
        dimensions: Dimensions,
    ) -> Result<Self, TrainerError> {
        tracks.iter().try_for_each(|track| require(track, dimensions.steps))?;
        Ok(Self { dimensions, segments: tracks.iter().map(|track| track.values.clone()).collect() })
    }

    /// Splits every track: the last eighth is for validation, the rest for training. The steps of
    /// one window between both parts are used for neither, so that training and validation windows
    /// are not adjacent.
    ///
    /// # Errors
    /// If the last eighth of a track would be shorter than two windows.
    pub(crate) fn split(tracks: &[Track], dimensions: Dimensions) -> Result<Split, TrainerError> {
        let mut split = Split {
            training: Self::from_segments(Vec::new(), dimensions),
            validation: Self::from_segments(Vec::new(), dimensions),
        };
        let Dimensions { steps, electrodes, .. } = dimensions;
        for track in tracks {
            require(track, 2 * VALIDATION_PART * steps)?;
            let at = track.steps() - track.steps() / VALIDATION_PART;
            let training = &track.values[..(at - steps) * electrodes];
            split.training.segments.push(training.to_vec());
            let validation = &track.values[at * electrodes..];
            split.validation.segments.push(validation.to_vec());
        }
        Ok(split)
    }

    /// Creates a dataset from segments of at least one window each.
    ///
    /// # Panics
    /// If a segment is shorter than a window.
    pub(crate) fn from_segments(segments: Vec<Vec<f32>>, dimensions: Dimensions) -> Self {
        let window = dimensions.window_electrodes();
        assert!(
            segments.iter().all(|values| values.len() >= window),
            "every segment must hold a window"
        );
        Self { dimensions, segments }
    }

    pub(crate) fn dimensions(&self) -> Dimensions {
        self.dimensions
    }

    /// Iterates over the values of each segment, in the order step, electrode.
    pub(crate) fn segments(&self) -> impl Iterator<Item = &[f32]> {
        self.segments.iter().map(Vec::as_slice)
    }

    fn steps(&self, segment: &[f32]) -> usize {
        segment.len() / self.dimensions.electrodes
    }

    /// Returns the window that starts at the time step `at` of a segment.
    fn window<'a>(&self, segment: &'a [f32], at: usize) -> &'a Window {
        let start = at * self.dimensions.electrodes;
        &segment[start..start + self.dimensions.window_electrodes()]
    }

    /// Multiplies every value of the dataset by `factor`.
    pub(crate) fn scale(&mut self, factor: f64) {
        #[expect(clippy::cast_possible_truncation, reason = "a float network takes f32")]
        for value in self.segments.iter_mut().flatten() {
            *value = (f64::from(*value) * factor) as f32;
        }
    }

    /// Returns the root mean square over all time steps and electrodes. It equals the standard
    /// deviation, because the band-pass removes the mean.
    pub(crate) fn deviation(&self) -> f64 {
        let values = self.segments.iter().flatten();
        let (count, sum) = values
            .fold((0_u64, 0.0), |(count, sum), value| (count + 1, sum + f64::from(*value).powi(2)));
        let mean = sum / count as f64;
        mean.sqrt()
    }

    /// Returns the largest magnitude of all values, in the unit of the dataset.
    pub(crate) fn max_abs(&self) -> f32 {
        let values = self.segments.iter().flatten();
        values.fold(0.0, |largest, value| largest.max(value.abs()))
    }

    /// Returns the number of disjoint windows, which determines how many windows an epoch has.
    pub(crate) fn disjoint_windows(&self) -> usize {
        let steps = self.dimensions.steps;
        let windows = |segment: &Vec<f32>| self.steps(segment) / steps;
        self.segments.iter().map(windows).sum()
    }

    /// Returns the windows that start at every `hop`-th time step of every segment.
    pub(crate) fn aligned(&self, hop: usize) -> Vec<&Window> {
        let segments = self.segments.iter();
        segments
            .flat_map(|segment| {
                (0..=self.steps(segment) - self.dimensions.steps)
                    .step_by(hop)
                    .map(|at| self.window(segment, at))
            })
            .collect()
    }

    /// Returns `count` windows at random offsets, uniformly distributed over all segments.
    pub(crate) fn random(&self, count: usize, rng: &mut impl Rng) -> Vec<&Window> {
        let in_segment = |segment: &Vec<f32>| self.steps(segment) - self.dimensions.steps + 1;
        let offsets: usize = self.segments.iter().map(in_segment).sum();
        let mut draw = || {
            let mut at = rng.random_range(0..offsets);
            for segment in &self.segments {
                let here = in_segment(segment);
                if at < here {
                    return self.window(segment, at);
                }
                at -= here;
            }
            unreachable!("the offset is below the sum over all segments")
        };
        (0..count).map(|_| draw()).collect()
    }
}

/// Training tracks whose values are in units of the standard deviation of their training part.
#[derive(Clone, Debug)]
pub(crate) struct TrainingSet {
    /// Training part and validation part.
    pub(crate) split: Split,
    /// Complete tracks with their original amplitude, for calibration.
    pub(crate) whole: Dataset,
    /// Standard deviation of the training part, uV.
    pub(crate) sd_uv: f64,
}

impl TrainingSet {
    /// Splits tracks into training and validation part, and scales both to units of the training
    /// part's standard deviation. `recorded` are the same tracks with their original amplitude,
    /// which can differ between people; they determine the ranges of a device's input and codes.
    ///
    /// # Errors
    /// If a track is too short, or all values of the training part are 0.
    pub(crate) fn new(
        tracks: &[Track],
        recorded: &[Track],
        dimensions: Dimensions,
    ) -> Result<Self, TrainerError> {
        let mut split = Dataset::split(tracks, dimensions)?;
        let mut whole = Dataset::from_tracks(recorded, dimensions)?;
        let sd_uv = split.training.deviation();
        if sd_uv <= 0.0 {
            return Err(FitError::Silent.into());
        }
        for part in [&mut split.training, &mut split.validation, &mut whole] {
            part.scale(1.0 / sd_uv);
        }
        Ok(Self { split, whole, sd_uv })
    }

    /// Returns the principal directions of the training part, one for each value of a code.
    pub(crate) fn directions(&self) -> Vec<Vec<f32>> {
        let count = self.whole.dimensions.numbers;
        principal_directions(pca::second_moment(&self.split.training), count)
    }
}

/// Training part and validation part of the training tracks.
#[derive(Clone, Debug)]
pub(crate) struct Split {
    pub(crate) training: Dataset,
    /// Windows on which the best epoch is chosen.
    pub(crate) validation: Dataset,
}

/// Returns an error that names the track if it has fewer than `needed` steps.
fn require(track: &Track, needed: usize) -> Result<(), TrainerError> {
    let steps = track.steps();
    if steps >= needed {
        return Ok(());
    }
    Err(TrainerError::TooShort { name: track.name.clone(), steps, needed })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    fn dimensions() -> Dimensions {
        testing::description().dimensions()
    }

    /// Returns a track whose values equal the index of their time step.
    fn ramp(length: usize) -> Track {
        let electrodes = dimensions().electrodes;
        let values = (0..length).flat_map(|step| vec![step as f32; electrodes]);
        Track::new("ramp", electrodes, values.collect())
    }

    #[test]
    fn training_and_validation_are_a_window_apart_and_the_training_part_has_deviation_1() {
        let split = Dataset::split(&[ramp(800)], dimensions()).unwrap();
        let training = split.training.aligned(1);
        let last = training[training.len() - 1][dimensions().window_electrodes() - 1];
        let first = split.validation.aligned(1)[0][0];
        assert!((first - last - 17.0).abs() < f32::EPSILON, "{last} {first}");
        assert_eq!(split.validation.disjoint_windows(), 100 / 16);
        let tracks = [ramp(800)];
        let scaled = TrainingSet::new(&tracks, &tracks, dimensions()).unwrap();
        assert!((scaled.split.training.deviation() - 1.0).abs() < 1e-6);
    }

    #[test]
    fn aligned_windows_are_a_hop_apart_within_their_segment() {
        let dataset = Dataset::from_tracks(&[ramp(40), ramp(16)], dimensions()).unwrap();
        let starts: Vec<f32> = dataset.aligned(8).iter().map(|window| window[0]).collect();
        assert_eq!(starts, [0.0, 8.0, 16.0, 24.0, 0.0]);
    }

    #[test]
    fn random_windows_reach_every_offset_and_depend_on_the_seed_only() {
        let dataset = Dataset::from_tracks(&[ramp(20), ramp(17)], dimensions()).unwrap();
        let draw = |seed| -> Vec<f32> {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            dataset.random(200, &mut rng).iter().map(|window| window[0]).collect()
        };
        assert_eq!(draw(1), draw(1));
        assert_ne!(draw(1), draw(2));
        for offset in [0.0, 1.0, 2.0, 3.0, 4.0] {
            assert!(draw(1).contains(&offset), "offset {offset} is never drawn");
        }
    }

    #[test]
    fn the_error_of_a_short_track_names_it() {
        let error = Dataset::split(&[ramp(200)], dimensions()).unwrap_err();
        assert!(error.to_string().starts_with("ramp has 200 time steps"), "{error}");
    }
}
