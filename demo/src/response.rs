//! Magnitude response of the integer filters, measured, against their float64 design.

use std::f64::consts::PI;
use std::path::Path;

use artifact::{Artifact, Filters};
use fixed_dsp::{CascadeState, Filter};
use model_gen::design::{butterworth_band_pass, notch};
use num_complex::Complex64;
use picture::canvas::{RESULT, SOURCE};
use picture::curves::{Curve, Curves, Mark};
use pipeline::Mains;

use crate::failure::Failure;

/// Mains frequency of the drawn filters, Hz.
const MAINS_HZ: f64 = 50.0;
/// Size of the impulse, Q27.5: twice the ADC's full scale, so that rounding is small in comparison.
/// A node whose worst-case gain is 6.8 (model/manifest.txt) sees far less of a single impulse, and has
/// room for 8 times full scale.
const IMPULSE: i32 = 1 << 29;
/// Length of the impulse response, s: the slowest poles, 0.97 / s, have decayed by e^-10.
const SECONDS: usize = 10;
/// Points of a curve, evenly spaced over the logarithm of the frequency.
const POINTS: u32 = 600;
/// Distance of the circles that show the design, points.
const CIRCLES: usize = 8;
/// Lowest magnitude of the design at which the two are compared, dB: below it rounding dominates.
const COMPARED_DB: f64 = -40.0;

/// Frequency in Hz, measured and designed magnitude in dB.
pub(crate) struct Response(Vec<[f64; 3]>);

impl Response {
    /// Measures the filters of the firmware and computes their design from the model's artifact.
    ///
    /// # Errors
    /// The artifact cannot be read.
    pub(crate) fn from_artifact() -> Result<Self, Failure> {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../model/artifact");
        let artifact = Artifact::read(&folder).map_err(|error| Failure::Check {
            what: "reading the model's artifact".to_owned(),
            why: error.to_string(),
            next: "`git status model/artifact`".to_owned(),
        })?;
        let filters = &artifact.description.filters;
        let impulse = impulse_response();
        let points = frequencies(0.1, 0.999 * nyquist()).into_iter().map(|hz| {
            let z = Complex64::from_polar(1.0, 2.0 * PI * hz / f64::from(model::ADC_RATE_HZ));
            [hz, db(measured(&impulse, z)), db(designed(filters, z))]
        });
        Ok(Self(points.collect()))
    }

    /// Largest difference of the two where the design is above [`COMPARED_DB`], dB.
    fn worst_db(&self) -> f64 {
        let compared = self.0.iter().filter(|[_, _, design]| *design > COMPARED_DB);
        let differences = compared.map(|[_, measured, design]| (measured - design).abs());
        differences.fold(0.0, f64::max)
    }

    /// Chart of both curves.
    pub(crate) fn curves(&self) -> Curves {
        let [measured, designed] = [1, 2].map(|column| {
            let points = self.0.iter().map(|point| (point[0], point[column]));
            points.collect::<Vec<_>>()
        });
        Curves {
            title: "The filters pass the EEG from 0.5 to 60 Hz, and stop the mains at 50 Hz",
            subtitle: format!(
                "magnitude before the decimation, at {} Hz; integer filters within {:.3} dB of the \
                 float64 twin down to −40 dB",
                model::ADC_RATE_HZ,
                self.worst_db()
            ),
            x_hz: [0.1, nyquist()],
            y: [-120.0, 12.0],
            y_label: "magnitude (dB)",
            band_hz: [0.5, 60.0],
            mains_hz: MAINS_HZ,
            curves: vec![
                Curve {
                    label: "measured: impulses through the integer filters".to_owned(),
                    color: SOURCE,
                    mark: Mark::Line,
                    points: measured,
                },
                Curve {
                    label: "float64 twin, not quantised".to_owned(),
                    color: RESULT,
                    mark: Mark::Circles,
                    points: designed.into_iter().step_by(CIRCLES).collect(),
                },
            ],
        }
    }
}

/// Response of the fixed-point filters to an impulse of 1: half the difference of the responses to an
/// impulse and to its negative, in which the initial rounding error cancels.
fn impulse_response() -> Vec<f64> {
    let mut states = [CascadeState::REST; 2];
    let samples = 0..SECONDS * usize::from(model::ADC_RATE_HZ);
    let response = samples.map(|n| {
        let x = if n == 0 { IMPULSE } else { 0 };
        let up = f64::from(Mains::Hz50.apply(&mut states[0], x));
        let down = f64::from(Mains::Hz50.apply(&mut states[1], -x));
        (up - down) / 2.0 / f64::from(IMPULSE)
    });
    response.collect()
}

/// `sum h[n] z^-n`, by Horner's rule.
fn measured(impulse_response: &[f64], z: Complex64) -> Complex64 {
    let backwards = impulse_response.iter().rev();
    backwards.fold(Complex64::ZERO, |sum, h| sum / z + h)
}

/// Transfer function of the band-pass and the notches as designed, before quantisation.
fn designed(filters: &Filters, z: Complex64) -> Complex64 {
    let rate_hz = f64::from(model::ADC_RATE_HZ);
    let [low, high] = filters.band_hz;
    let order = usize::try_from(filters.order).unwrap_or(usize::MAX);
    let band_pass = butterworth_band_pass(order, low, high, rate_hz);
    let zeros = ((z - 1.0) * (z + 1.0)).powu(filters.order);
    let poles: Complex64 = band_pass.poles.iter().map(|pole| z - pole).product();
    let notches = (1..=filters.harmonics + 1).map(|multiple| {
        let notch = notch(MAINS_HZ * f64::from(multiple), filters.notch_q, rate_hz);
        let numerator = notch.gain * (z * z + notch.cosine * z + 1.0);
        numerator / (z * z + notch.gain * notch.cosine * z + 2.0 * notch.gain - 1.0)
    });
    band_pass.gain * zeros / poles * notches.product::<Complex64>()
}

fn db(gain: Complex64) -> f64 {
    10.0 * gain.norm_sqr().log10()
}

fn nyquist() -> f64 {
    f64::from(model::ADC_RATE_HZ) / 2.0
}

/// Frequencies in ascending order, denser around the mains, Hz.
fn frequencies(first: f64, last: f64) -> Vec<f64> {
    let parts = (0..=POINTS).map(|point| f64::from(point) / f64::from(POINTS));
    let grid = parts.map(|part| first * (last / first).powf(part));
    let notch = (-10..=10).map(|point| MAINS_HZ + 0.04 * f64::from(point));
    let mut frequencies: Vec<f64> = grid.chain(notch).collect();
    frequencies.sort_by(f64::total_cmp);
    frequencies
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_measured_filters_are_the_designed_ones() {
        let response = Response::from_artifact().expect("the artifact");
        // Measured 0.003 dB, near -40 dB.
        assert!(response.worst_db() < 0.01, "{} dB", response.worst_db());
        let mut points = response.0.iter();
        let notch = points.find(|[hz, ..]| (hz - MAINS_HZ).abs() < 1e-9);
        assert!(notch.is_some_and(|[_, db, _]| *db < -60.0), "{notch:?}");
    }

    /// `scipy.signal.freqz` of `butter(5, [0.5, 60], 'bandpass', fs=512)` times `iirnotch(50, 30, 512)`.
    #[test]
    fn the_design_is_scipys() {
        let response = Response::from_artifact().expect("the artifact");
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../model/artifact");
        let filters = Artifact::read(&folder)
            .expect("the artifact")
            .description
            .filters;
        for (hz, expected) in [
            (0.3, -22.432_107_5),
            (30.0, -0.006_695_2),
            (49.0, -2.703_321_9),
            (100.0, -26.399_503_5),
        ] {
            let z = Complex64::from_polar(1.0, 2.0 * PI * hz / 512.0);
            assert!(
                (db(designed(&filters, z)) - expected).abs() < 1e-6,
                "{hz} Hz"
            );
        }
        assert_eq!(response.0.len(), 622);
    }
}
