//! Mean and standard deviation of values.

use std::f64::consts::PI;
use std::fmt;

use crate::canvas::real;

/// Mean and standard deviation of a set of values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// Arithmetic mean, in the values' unit.
    pub mean: f64,
    /// Population standard deviation (divided by n), in the values' unit.
    pub sd: f64,
}

impl Spread {
    /// Computes mean and standard deviation of `values`; both are NaN if there are no values.
    pub fn from_values(values: &[f64]) -> Self {
        let count = real(values.len());
        let mean = values.iter().sum::<f64>() / count;
        let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / count;
        let sd = variance.sqrt();
        Self { mean, sd }
    }

    /// Returns the density of the normal distribution with this mean and standard deviation at `x`,
    /// per unit of the values.
    pub(crate) fn density(self, x: f64) -> f64 {
        let deviations = (x - self.mean) / self.sd;
        (-0.5 * deviations * deviations).exp() / (self.sd * (2.0 * PI).sqrt())
    }
}

impl fmt::Display for Spread {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.3} ± {:.3}", self.mean, self.sd)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_and_sd_of_a_known_set() {
        let spread = Spread::from_values(&[2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0]);
        assert!((spread.mean - 5.0).abs() < 1e-12 && (spread.sd - 2.0).abs() < 1e-12);
        assert_eq!(spread.to_string(), "5.000 ± 2.000");
    }

    #[test]
    fn the_density_has_area_one() {
        let (mean, sd) = (62.499, 0.227);
        let density = |place: u16| Spread { mean, sd }.density(60.5 + f64::from(place) * 0.001);
        let area: f64 = (0..4000).map(|place| density(place) * 0.001).sum();
        assert!((area - 1.0).abs() < 1e-6, "{area}");
    }
}
