//! Frequency response of the fixed-point filters and of their float64 twin, measured with impulses.

use std::f64::consts::PI;

use artifact::Filters;
use fixed_dsp::{CascadeState, Filter};
use model_gen::{butterworth_band_pass, notch};
use num_complex::Complex64;
use picture::axis::{Axis, Scale};
use picture::canvas::{FAINT, INK, RESULT, SOURCE};
use picture::lines::{Lines, Mark, Series};
use pipeline::Mains;

/// Pass band of the filters: lower and upper corner frequency, Hz.
pub const BAND_HZ: [f64; 2] = [0.5, 60.0];

/// Lowest magnitude of the chart, dB; lower magnitudes are drawn at this level.
const LOWEST_DB: f64 = -120.0;
/// Number of points in a curve, evenly spaced over the logarithm of the frequency.
const POINTS: u32 = 600;
/// Distance between two of the circles that mark the float64 twin's curve, in points of the curve.
const CIRCLE_DISTANCE: usize = 8;

/// Smallest magnitude at which the filters are compared with their float64 twin, dB. At smaller
/// magnitudes, rounding hides the response to an impulse, and the truncated end of the impulse
/// response is significant.
const COMPARED_DB: f64 = -40.0;

/// Impulse responses of the fixed-point filters and of their float64 twin.
#[derive(Debug)]
pub struct Response {
    filters: ImpulseResponse,
    twin: ImpulseResponse,
}

impl Response {
    /// Measures the responses of the filters and of `twin` to an impulse.
    pub fn measure(twin: &Twin) -> Self {
        Self { filters: ImpulseResponse::from_filters(), twin: ImpulseResponse::from_twin(twin) }
    }

    /// Returns the chart of the magnitude of filters and twin in dB over the frequency in Hz.
    pub fn magnitude(&self) -> Lines {
        let nyquist_hz = f64::from(model::ADC_RATE_HZ) / 2.0;
        let compared = self.compare([0.1, 0.999 * nyquist_hz]);
        let difference = largest_difference(&compared);
        let subtitle = format!(
            "magnitude before the decimation, at {} Hz; integer filters within {difference:.3} dB of the \
             float64 twin down to −40 dB",
            model::ADC_RATE_HZ
        );
        let title = "The filters pass the EEG from 0.5 to 60 Hz, and stop the mains at 50 Hz";
        let marks = marks([LOWEST_DB, 6.0]);
        Lines {
            title: title.to_owned(),
            subtitle,
            x: Axis::new("frequency (Hz)", Scale::Logarithmic),
            y: Axis::new("magnitude (dB)", Scale::Linear),
            series: marks.into_iter().chain(curves(&compared)).collect(),
        }
    }

    /// Returns, for each point of a curve, the frequency in Hz, and the magnitude of the filters
    /// and of the twin at this frequency in dB.
    fn compare(&self, [first, last]: [f64; 2]) -> Vec<[f64; 3]> {
        let parts = (0..=POINTS).map(|point| f64::from(point) / f64::from(POINTS));
        let mut frequencies: Vec<f64> =
            parts.map(|part| first * (last / first).powf(part)).collect();
        // Add closely spaced points around the notch, where the curve is steep.
        frequencies.extend((-10..=10).map(|point| MAINS_HZ + 0.04 * f64::from(point)));
        frequencies.sort_by(f64::total_cmp);
        let both = [&self.filters, &self.twin];
        let compared = |hz: f64| {
            let [measured, designed] = both.map(|response| response.magnitude_db(hz));
            [hz, measured, designed]
        };
        frequencies.into_iter().map(compared).collect()
    }
}

/// Returns the largest difference between the filters and the twin among the points at which the
/// twin's magnitude is above [`COMPARED_DB`].
fn largest_difference(compared: &[[f64; 3]]) -> f64 {
    let passed = compared.iter().filter(|[.., db]| *db > COMPARED_DB);
    let differences = passed.map(|[_, measured, designed]| (measured - designed).abs());
    differences.fold(0.0, f64::max)
}

fn curves(compared: &[[f64; 3]]) -> [Series; 2] {
    let shown = |hz: f64, db: f64| (hz, db.max(LOWEST_DB));
    let measured = compared.iter().map(|[hz, db, _]| shown(*hz, *db)).collect();
    let designed = compared.iter().step_by(CIRCLE_DISTANCE);
    let designed = designed.map(|[hz, _, db]| shown(*hz, *db)).collect();
    let label = "measured: impulses through the integer filters";
    [
        Series::new(label, SOURCE, Mark::Line, measured),
        Series::new("float64 twin, not quantised", RESULT, Mark::Rings, designed),
    ]
}

/// Returns the outline of the pass band and a line at the mains frequency, from `low` to `high` dB.
fn marks([low, high]: [f64; 2]) -> [Series; 2] {
    let [from, to] = BAND_HZ;
    let band = vec![(from, low), (from, high), (to, high), (to, low)];
    let mains = vec![(MAINS_HZ, low), (MAINS_HZ, high)];
    let label = format!("pass band, {from} to {to} Hz");
    [
        Series::new(label, INK, Mark::ThinLine, band),
        Series::new(format!("mains, {MAINS_HZ} Hz"), FAINT, Mark::ThinLine, mains),
    ]
}

/// Height of the impulse, Q27.5: twice the ADC's full scale, so that rounding is small relative to
/// the response. No intermediate value of the filters wraps: each has room for 8 times full scale,
/// and even the worst input within full scale drives no value beyond 6.8 times full scale
/// (signal/model/manifest.txt). A single impulse, even of twice full scale, drives them far less.
const IMPULSE: i32 = 1 << 29;
/// Length of the recorded response, s. The slowest poles decay at 0.96 / s, so after 10 s their
/// response has decayed to about e^-10. Later values are mostly rounding errors.
const SECONDS: usize = 10;

/// Response of a filter to a unit impulse, at the ADC's rate.
#[derive(Debug)]
struct ImpulseResponse(Vec<f64>);

impl ImpulseResponse {
    /// Measures the response of the fixed-point filters: half the difference between the responses
    /// to an impulse and to its negative. In this difference, the initial value of the carried
    /// rounding error cancels.
    fn from_filters() -> Self {
        let mut states = [CascadeState::REST; 2];
        let response = (0..samples()).map(|n| {
            let x = if n == 0 { IMPULSE } else { 0 };
            let up = f64::from(Mains::Hz50.apply(&mut states[0], x));
            let down = f64::from(Mains::Hz50.apply(&mut states[1], -x));
            (up - down) / 2.0 / f64::from(IMPULSE)
        });
        Self(response.collect())
    }

    /// Computes the response of the float64 twin to an impulse.
    fn from_twin(twin: &Twin) -> Self {
        let mut twin = twin.clone();
        let response = (0..samples()).map(|n| twin.apply(if n == 0 { 1.0 } else { 0.0 }));
        Self(response.collect())
    }

    /// Returns the magnitude of the filter's response at the frequency `hz`, dB.
    fn magnitude_db(&self, hz: f64) -> f64 {
        let z = Complex64::from_polar(1.0, -2.0 * PI * hz / f64::from(model::ADC_RATE_HZ));
        // The sum of h[n] z^n, with the impulse response h, by Horner's rule.
        let response = self.0.iter().rev().fold(Complex64::ZERO, |sum, h| sum * z + h);
        10.0 * response.norm_sqr().log10()
    }
}

fn samples() -> usize {
    SECONDS * usize::from(model::ADC_RATE_HZ)
}

/// Mains frequency that the filters stop, Hz.
pub const MAINS_HZ: f64 = 50.0;

/// The band-pass and the notches in float64, as a reference for the fixed-point filters.
#[derive(Debug, Clone)]
pub struct Twin {
    /// Coefficients `b0, b1, b2, a1, a2` of each section.
    sections: Vec<[f64; 5]>,
    /// Previous inputs and outputs `x1, x2, y1, y2` of each section.
    states: Vec<[f64; 4]>,
}

impl Twin {
    /// Designs the filters for 50 Hz mains at the model's ADC rate, with all states zero.
    pub fn new(filters: &Filters) -> Self {
        let rate_hz = model::ADC_RATE_HZ.into();
        let notches = (1..=filters.harmonics + 1).map(|multiple| {
            let notch = notch(MAINS_HZ * f64::from(multiple), filters.notch_q, rate_hz);
            let cosine = notch.gain * notch.cosine;
            [notch.gain, cosine, notch.gain, cosine, 2.0 * notch.gain - 1.0]
        });
        let [low, high] = filters.band_hz;
        let order = usize::try_from(filters.order).unwrap_or(usize::MAX);
        let band_pass = butterworth_band_pass(order, low, high, rate_hz);
        let (real, complex): (Vec<Complex64>, Vec<Complex64>) =
            band_pass.poles.iter().partition(|pole| pole.im.abs() < 1e-9);
        let above = complex.into_iter().filter(|pole| pole.im > 0.0);
        let pairs = above.map(|pole| [pole, pole.conj()]);
        // Each pair of poles gets one zero at DC and one at the Nyquist frequency.
        let pairs = pairs.chain(real.as_chunks().0.iter().copied());
        let pairs = pairs.map(|[p, q]| [1.0, 0.0, -1.0, -(p + q).re, (p * q).re]);
        let mut sections: Vec<[f64; 5]> = pairs.chain(notches).collect();
        for b in &mut sections[0][..3] {
            *b *= band_pass.gain;
        }
        Self { states: vec![[0.0; 4]; sections.len()], sections }
    }

    /// Filters one sample: advances the states and returns the output.
    pub fn apply(&mut self, x: f64) -> f64 {
        let sections = self.sections.iter().zip(&mut self.states);
        sections.fold(x, |x, ([b0, b1, b2, a1, a2], state)| {
            let [x1, x2, y1, y2] = *state;
            let y = b0 * x + b1 * x1 + b2 * x2 - a1 * y1 - a2 * y2;
            *state = [x, x1, y, y1];
            y
        })
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use artifact::Artifact;

    use super::*;

    fn response() -> Response {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../signal/model/artifact");
        let artifact = Artifact::read(&folder).expect("the artifact");
        Response::measure(&Twin::new(&artifact.description.filters))
    }

    #[test]
    fn the_measured_filters_are_the_designed_ones() {
        let response = response();
        let magnitude = response.compare([0.1, 255.0]);
        // The largest difference measured is 0.003 dB, at a magnitude near -40 dB.
        let difference = largest_difference(&magnitude);
        assert!(difference < 0.01, "{difference} dB");
        let notch = magnitude.iter().find(|[hz, ..]| (hz - MAINS_HZ).abs() < 1e-9);
        assert!(notch.is_some_and(|[_, db, _]| *db < -60.0), "{notch:?}");
    }

    /// The reference values come from `scipy.signal.freqz` for `butter(5, [0.5, 60], 'bandpass',
    /// fs=512)` times `iirnotch(50, 30, 512)`.
    #[test]
    fn the_twin_is_scipys() {
        if model::ADC_RATE_HZ != 512 {
            new_file::message!(
                "SKIPPED: the twin against scipy: the built-in model has another rate"
            );
            return;
        }
        let scipy = [
            (0.3, -22.432_107_5),
            (30.0, -0.006_695_2),
            (49.0, -2.703_321_9),
            (100.0, -26.399_503_5),
        ];
        let twin = response().twin;
        for (hz, expected) in scipy {
            let db = twin.magnitude_db(hz);
            // The impulse response ends after 10 s, which changes the magnitude by at most 4e-4 dB
            // (measured).
            assert!((db - expected).abs() < 1e-3, "{hz} Hz: {db}");
        }
    }
}
