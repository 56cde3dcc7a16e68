//! Mean and standard deviation.

use std::f64::consts::PI;
use std::fmt;

/// Mean and standard deviation of some values, in their unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Spread {
    /// Mean.
    pub(crate) mean: f64,
    /// Standard deviation, over n.
    pub(crate) sd: f64,
}

impl Spread {
    /// Spread of the values; NaN for none.
    pub(crate) fn of(values: &[f64]) -> Self {
        let count = f64::from(u32::try_from(values.len()).unwrap_or(u32::MAX));
        let mean = values.iter().sum::<f64>() / count;
        let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / count;
        Self {
            mean,
            sd: variance.sqrt(),
        }
    }

    /// Density of the normal distribution with this mean and SD, per unit.
    pub(crate) fn density(self, x: f64) -> f64 {
        let deviations = (x - self.mean) / self.sd;
        (-0.5 * deviations * deviations).exp() / (self.sd * (2.0 * PI).sqrt())
    }
}

impl fmt::Display for Spread {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{:.3} ± {:.3}", self.mean, self.sd)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_and_sd_of_a_known_set() {
        let spread = Spread::of(&[2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0]);
        assert!((spread.mean - 5.0).abs() < 1e-12 && (spread.sd - 2.0).abs() < 1e-12);
        assert_eq!(spread.to_string(), "5.000 ± 2.000");
    }

    #[test]
    fn the_density_has_area_one() {
        let spread = Spread {
            mean: 62.499,
            sd: 0.227,
        };
        let area: f64 = (0..4000)
            .map(|i| spread.density(60.5 + f64::from(i) * 0.001) * 0.001)
            .sum();
        assert!((area - 1.0).abs() < 1e-6, "{area}");
    }
}
