//! A packed model for one person, and its error compared with another model's.

use crate::error::FitError;
use crate::evaluation::{RateFigures, evaluate};
use crate::fit::fit;
use crate::good_signal::{GoodSignal, first_three_quarters};
use artifact::{Description, ErrorWeight, PackedModel};

/// A packed model that was fitted to a person's signal.
#[derive(Clone, Debug)]
pub struct PersonalModel {
    /// The model, fitted to the whole signal.
    pub model: PackedModel,
    /// Figures at all rates, finest first, on the last quarter of the signal, with a model that was
    /// fitted to the first three quarters.
    pub own: Vec<RateFigures>,
    /// Figures of the model in the comparison, `other`, on the last quarter of the signal.
    pub other: Vec<RateFigures>,
    /// Mean square of the signal in the last quarter, in units of `input.sd_uv` squared.
    pub power: f64,
}

impl PersonalModel {
    /// Fits a packed model that has the coefficient count and the rate of `other` and the least
    /// error weighted by `weight`, and compares the two models. Reports its progress to `report`.
    ///
    /// # Errors
    /// If the signal does not determine a model.
    pub fn new(
        signal: &GoodSignal,
        description: &Description,
        other: &PackedModel,
        weight: Option<ErrorWeight>,
        report: &mut dyn FnMut(&str),
    ) -> Result<Self, FitError> {
        let tracks = &signal.tracks;
        let [first, last] = first_three_quarters(tracks);
        let count = other.coefficients();
        let tested = fit(&first, description, count, weight, report)?;
        let squares = last.iter().flat_map(|track| &track.values);
        let squares = squares.map(|uv| (f64::from(*uv) / description.input.sd_uv).powi(2));
        let values: usize = last.iter().map(|track| track.values.len()).sum();
        let mut model = fit(tracks, description, count, weight, report)?;
        model.description.rate = other.description.rate;
        Ok(Self {
            model,
            own: evaluate(&tested, &last, description, &mut |_| ())?,
            other: evaluate(other, &last, description, &mut |_| ())?,
            power: squares.sum::<f64>() / values.max(1) as f64,
        })
    }
}

/// Returns the mean squared error at a mean block length of `bits` bits, in the unit of the
/// figures. Interpolates linearly between two rates in the logarithms of length and error. `None`
/// if no two rates enclose the length.
pub fn error_at(figures: &[RateFigures], bits: f64) -> Option<f64> {
    let pair = figures.windows(2).find(|pair| (pair[1].bits..=pair[0].bits).contains(&bits))?;
    let [finer, coarser] = [&pair[0], &pair[1]];
    let part = (bits.ln() - finer.bits.ln()) / (coarser.bits.ln() - finer.bits.ln());
    Some((finer.mse.ln() + part * (coarser.mse.ln() - finer.mse.ln())).exp())
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::innovation::SECOND;
    use crate::personal_code::PersonalCode;
    use crate::track::Track;
    use artifact::{Artifact, MontageFile, Pca, TrainingCard};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use std::path::Path;

    pub(crate) fn description() -> Description {
        let paper = Path::new("../../signal/model/paper");
        let mut description = Artifact::read(paper).unwrap().description;
        let text = include_str!("../../../files/montages/cyton-8.toml");
        let montage = MontageFile::parse(Path::new("cyton-8.toml"), text).unwrap();
        description.montage = montage.montage();
        description.grid = montage.grid();
        description.training = TrainingCard::default();
        description
    }

    /// Returns the signal of a head with three slow sources; `seed` determines the weights with
    /// which they reach each electrode.
    fn head(seed: u64, seconds: usize) -> Track {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let weights: [[f32; 3]; 8] =
            std::array::from_fn(|_| std::array::from_fn(|_| rng.random_range(-1.0..1.0)));
        let mut sources = [0.0_f32; 3];
        let values = (0..seconds * SECOND).flat_map(|_| {
            for source in &mut sources {
                *source = 0.95 * *source + rng.random_range(-20.0..20.0);
            }
            weights.map(|weights| {
                let sum: f32 = weights.iter().zip(sources).map(|(w, source)| w * source).sum();
                sum + rng.random_range(-2.0..2.0)
            })
        });
        Track::new("head", 8, values.collect())
    }

    fn personal(tracks: Vec<Track>, other: &PackedModel) -> PersonalModel {
        let signal = GoodSignal { tracks, ..GoodSignal::default() };
        PersonalModel::new(&signal, &description(), other, None, &mut |_| ()).unwrap()
    }

    #[test]
    fn a_model_of_the_head_has_less_error_than_another_unless_the_last_quarter_is_of_another_head()
    {
        let mut other = fit(&[head(2, 60)], &description(), 32, None, &mut |_| ()).unwrap();
        other.description.rate = 6;
        let at_equal_bits = |personal: &PersonalModel| {
            let own = &personal.own[4];
            let other = error_at(&personal.other, own.bits).expect("within its rates");
            own.mse / other
        };
        let same = personal(vec![head(1, 80)], &other);
        assert!(at_equal_bits(&same) < 0.7, "{}", at_equal_bits(&same));
        assert_eq!(same.model.coefficients(), 32);
        assert_eq!(same.model.description.rate, 6);
        // The last quarter is of another head. A fit that included it would know this head, so the
        // error would be small.
        let changed = personal(vec![head(1, 60), head(2, 20)], &other);
        assert!(at_equal_bits(&changed) > 1.3, "{}", at_equal_bits(&changed));
        let power = |track: &Track| {
            let squares = track.values.iter().map(|uv| f64::from(*uv).powi(2));
            squares.sum::<f64>() / track.values.len() as f64
        };
        let unit = description().input.sd_uv.powi(2);
        let expected = power(&head(2, 20)) / unit;
        assert!((changed.power / expected - 1.0).abs() < 1e-6);
    }

    #[test]
    fn a_code_of_the_head_has_less_error_than_another_unless_the_last_quarter_is_of_another_head() {
        let mut description = description();
        description.code.numbers = 16;
        let packed = fit(&[head(2, 60)], &description, 32, None, &mut |_| ()).unwrap();
        let values = description.dimensions().window_electrodes();
        let unit = |at: usize| (0..values).map(|value| f32::from(value == at)).collect();
        let directions: Vec<Vec<f32>> = (0..16).map(unit).collect();
        let ranges = [vec![-1.0; 16], vec![1.0; 16]];
        let model = Pca::new(&directions, ranges, 400.0).to_model(description);
        let model = model.unwrap().with_packed(Some(packed)).unwrap();
        let code = |tracks: Vec<Track>, other: &Artifact| {
            let signal = GoodSignal { tracks, ..GoodSignal::default() };
            PersonalCode::new(&signal, other).unwrap()
        };
        let other = code(vec![head(2, 60)], &model).model;
        let same = code(vec![head(1, 80)], &other);
        assert!(same.own_prd < 0.7 * same.other_prd, "{same:?}");
        assert_eq!(same.model.packed, model.packed);
        let input = model.input_scale_uv().unwrap();
        assert!((same.model.input_scale_uv().unwrap() / input - 1.0).abs() < 1e-12);
        let changed = code(vec![head(1, 60), head(2, 20)], &other);
        assert!(changed.own_prd > 1.3 * changed.other_prd, "{changed:?}");
    }

    #[test]
    fn the_error_between_two_rates_is_on_a_line_of_logarithms() {
        let figures = [(400.0, 0.01), (100.0, 0.04), (25.0, 0.08)].map(|(bits, mse)| RateFigures {
            rate: 0,
            bits,
            longest: 0,
            mse,
            mse_smoothed: mse,
        });
        for (bits, expected) in
            [(400.0, 0.01), (200.0, 0.02), (100.0, 0.04), (50.0, 0.04 * 2.0_f64.sqrt())]
        {
            let error = error_at(&figures, bits).unwrap();
            assert!((error / expected - 1.0).abs() < 1e-9, "{bits} {error}");
        }
        assert_eq!(error_at(&figures, 401.0), None);
        assert_eq!(error_at(&figures, 24.0), None);
    }
}
