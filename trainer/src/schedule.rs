//! The learning-rate schedule of a training run.

use std::f64::consts::PI;

/// A one-cycle schedule: the rate rises to the peak, then falls to almost 0, both along a cosine
/// (Smith and Topin, arXiv 1708.07120; shape and ratios of PyTorch's `OneCycleLR`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OneCycle {
    /// Largest learning rate, reached after 15 % of the updates.
    pub peak: f64,
    /// Number of updates of the whole training run.
    pub updates: u64,
}

/// Fraction of the updates during which the rate rises to its peak.
const WARM_UP: f64 = 0.15;
/// Ratio of the peak rate to the first rate.
const RISE: f64 = 25.0;
/// Ratio of the first rate to the last rate.
const FALL: f64 = 1e4;

impl OneCycle {
    /// Returns the learning rate of an update, counted from 0.
    pub fn rate(&self, update: u64) -> f64 {
        let last = self.updates.saturating_sub(1).max(1) as f64;
        let peak_at = WARM_UP * last;
        let first = self.peak / RISE;
        let update = (update as f64).min(last);
        if update < peak_at {
            ease(first, self.peak, update / peak_at)
        } else {
            ease(
                self.peak,
                first / FALL,
                (update - peak_at) / (last - peak_at),
            )
        }
    }
}

/// Interpolates between `from` and `to` along half a cosine; `part` is in 0..=1.
fn ease(from: f64, to: f64, part: f64) -> f64 {
    to + (from - to) * (1.0 + (PI * part).cos()) / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_rises_to_the_peak_and_falls_to_almost_zero() {
        let schedule = OneCycle {
            peak: 1e-3,
            updates: 101,
        };
        assert!((schedule.rate(0) - 4e-5).abs() < 1e-12);
        assert!((schedule.rate(15) - 1e-3).abs() < 1e-12);
        assert!((schedule.rate(100) - 4e-9).abs() < 1e-12);
        let rates: Vec<f64> = (0..101).map(|update| schedule.rate(update)).collect();
        assert!(rates[..16].is_sorted());
        assert!(rates[15..].is_sorted_by(|a, b| a >= b));
    }

    #[test]
    fn a_training_of_one_update_has_a_positive_rate() {
        assert!(
            OneCycle {
                peak: 1.0,
                updates: 1
            }
            .rate(0)
                > 0.0
        );
    }
}
