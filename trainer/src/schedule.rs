//! The learning rate over a training.

use std::f64::consts::PI;

/// One cycle: from a low rate up to the peak, then down to almost nothing, both along a cosine
/// (Smith and Topin, arXiv 1708.07120; the shape and ratios of PyTorch's `OneCycleLR`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OneCycle {
    /// Largest rate.
    pub peak: f64,
    /// Updates of the whole training.
    pub updates: u64,
}

/// Part of the updates during which the rate rises.
const WARM_UP: f64 = 0.15;
/// Peak rate over first rate.
const RISE: f64 = 25.0;
/// First rate over last rate.
const FALL: f64 = 1e4;

impl OneCycle {
    /// The rate of an update, counted from 0.
    #[expect(clippy::cast_precision_loss, reason = "far fewer than 2^53 updates")]
    pub fn rate(&self, update: u64) -> f64 {
        let last = self.updates.saturating_sub(1).max(1) as f64;
        let turn = WARM_UP * last;
        let first = self.peak / RISE;
        let update = (update as f64).min(last);
        if update < turn {
            ease(first, self.peak, update / turn)
        } else {
            ease(self.peak, first / FALL, (update - turn) / (last - turn))
        }
    }
}

/// Half a cosine from `from` to `to`.
fn ease(from: f64, to: f64, part: f64) -> f64 {
    to + (from - to) * (1.0 + (PI * part).cos()) / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_rises_to_the_peak_and_falls_to_almost_nothing() {
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
    fn a_training_of_one_update_has_a_rate() {
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
