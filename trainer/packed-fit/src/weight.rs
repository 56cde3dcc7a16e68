//! The weighted error of a block, to which a packed model is fitted for classifiers that read a
//! frequency band through spatial filters.
//!
//! ```text
//! weighted error = e' (I + strength R (x) S) e          e: error of a block, order step, electrode
//! R_kl = b(high) - b(low), b(f) = (2 f / rate) sinc(2 f (k - l) / rate)       the band in a block
//! S = c (C + s^2 I)^(-1/2), c so that tr(C S) = tr C                          the electrodes
//! C: second moment of the band-passed electrodes; s^2: a tenth of its median eigenvalue
//! ```
//!
//! Whitening only halfway, with a floor under the quietest directions, is a compromise: quiet
//! directions carry what spatial filters read, but also the noise of the amplifier.

use crate::band_pass::{band_passed, parse_band};
use crate::error::FitError;
use crate::innovation::median;
use crate::track::Track;
use artifact::ErrorWeight;
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use std::f64::consts::PI;

/// Ratio of the floor `s^2` to the median eigenvalue of C, the second moment of the band-passed
/// electrodes.
const FLOOR: f64 = 0.1;

/// Band of the mu and beta rhythms, which motor imagery and movement change, Hz.
const MOTOR_HZ: [f64; 2] = [8.0, 30.0];
/// Default weight of errors in the band.
const STRENGTH: f64 = 3.0;

/// Returns the weight of errors for classifiers of `purpose`: `motor` (8 to 30 Hz), or a band such
/// as `8..13`, Hz.
///
/// # Errors
/// If `purpose` is neither.
pub fn weight_for(purpose: &str) -> Result<ErrorWeight, String> {
    let band_hz = match purpose {
        "motor" => MOTOR_HZ,
        band => {
            parse_band(band).map_err(|error| format!("write motor or a band in Hz: {error}"))?
        }
    };
    Ok(ErrorWeight { band_hz, strength: STRENGTH })
}

/// The weighting matrix of a squared error, as its eigenvectors and eigenvalues.
#[derive(Clone, Debug)]
pub struct Metric {
    /// Eigenvectors, `[value, eigenvector]`.
    vectors: DMatrix<f64>,
    /// Eigenvalues, 1 or more.
    values: DVector<f64>,
}

impl Metric {
    /// Creates the metric for errors of `steps` time steps at `rate_hz`. `tracks` yield the second
    /// moment of the electrodes.
    ///
    /// # Errors
    /// If there is no track, or the signals in the band span less than half of all dimensions.
    pub fn new(
        weight: ErrorWeight,
        tracks: &[Track],
        steps: usize,
        rate_hz: u32,
    ) -> Result<Self, FitError> {
        let rate_hz = f64::from(rate_hz);
        let electrodes = tracks.first().ok_or(FitError::Silent)?.electrodes;
        // Applied twice, the band-pass has the power response of filtering forwards and backwards.
        let sections = [model_gen::band_power_sections(weight.band_hz, rate_hz); 2].concat();
        let mut moment = DMatrix::zeros(electrodes, electrodes);
        for track in tracks {
            let signals = band_passed(track, &sections);
            moment.gemm(1.0, &signals, &signals.transpose(), 1.0);
        }
        let space = SymmetricEigen::new(moment);
        let powers = space.eigenvalues.map(|power| power.max(0.0));
        let floor = FLOOR * median(powers.iter().copied().collect());
        if floor <= 0.0 {
            return Err(FitError::Silent);
        }
        let whitening = powers.map(|power| (power + floor).sqrt().recip());
        let scale = powers.sum() / powers.dot(&whitening);
        let time = SymmetricEigen::new(band(steps, weight.band_hz, rate_hz));
        let in_band = time.eigenvalues.map(|part| part.max(0.0));
        let products = in_band.kronecker(&(whitening * scale));
        Ok(Self {
            vectors: time.eigenvectors.kronecker(&space.eigenvectors),
            values: products.map(|product| 1.0 + weight.strength * product),
        })
    }

    /// Returns the symmetric square root of the metric's matrix. The squared norm of its product
    /// with an error is the weighted error.
    pub fn root(&self) -> DMatrix<f64> {
        self.mapped(f64::sqrt)
    }

    /// Returns the inverse of the metric's matrix.
    pub(crate) fn inverse(&self) -> DMatrix<f64> {
        self.mapped(f64::recip)
    }

    fn mapped(&self, function: fn(f64) -> f64) -> DMatrix<f64> {
        let scaled = DMatrix::from_fn(self.values.len(), self.values.len(), |row, column| {
            self.vectors[(row, column)] * function(self.values[column])
        });
        scaled * self.vectors.transpose()
    }
}

/// Returns the matrix B for which x' B x is the energy in the band of a signal x of `steps` steps.
fn band(steps: usize, [low_hz, high_hz]: [f64; 2], rate_hz: f64) -> DMatrix<f64> {
    DMatrix::from_fn(steps, steps, |k, l| {
        let lag = k as f64 - l as f64;
        let below = |hz: f64| {
            let width = 2.0 * hz / rate_hz;
            let x = PI * width * lag;
            if lag == 0.0 { width } else { width * x.sin() / x }
        };
        below(high_hz) - below(low_hz)
    })
}

#[cfg(test)]
mod tests;
