//! Frequency response of the filters: measured with impulses, and computed by a float64 twin.

mod impulse;
mod twin;

use picture::canvas::{RESULT, SOURCE};
use picture::curves::{Curve, Curves, Mark};

use self::impulse::ImpulseResponse;
pub use self::twin::{MAINS_HZ, Twin};

/// Pass band of the filters, Hz.
pub const BAND_HZ: [f64; 2] = [0.5, 60.0];

/// Points of a curve, evenly spaced over the logarithm of the frequency.
const POINTS: u32 = 600;
/// Distance of the twin's circles, in points of the curve.
const CIRCLE_DISTANCE: usize = 8;

/// Magnitude down to which the filters are compared with the twin, dB. Further down, rounding hides the
/// response to an impulse, and the part after the impulse response's end is missing.
const COMPARED_DB: f64 = -40.0;

/// Impulse responses of the fixed-point filters and of their float64 twin.
#[derive(Debug)]
pub struct Response {
    filters: ImpulseResponse,
    twin: ImpulseResponse,
}

impl Response {
    /// Measures both impulse responses.
    pub fn measure(twin: &Twin) -> Self {
        Self {
            filters: ImpulseResponse::from_filters(),
            twin: ImpulseResponse::from_twin(twin),
        }
    }

    /// Chart of the magnitude over frequency.
    pub fn magnitude(&self) -> Curves {
        let nyquist_hz = f64::from(model::ADC_RATE_HZ) / 2.0;
        let compared = self.compare(ImpulseResponse::magnitude_db, [0.1, 0.999 * nyquist_hz]);
        Curves {
            title: "The filters pass the EEG from 0.5 to 60 Hz, and stop the mains at 50 Hz",
            subtitle: format!(
                "magnitude before the decimation, at {} Hz; integer filters within {:.3} dB of the \
                 float64 twin down to −40 dB",
                model::ADC_RATE_HZ,
                self.largest_difference(&compared, COMPARED_DB)
            ),
            x_hz: [0.1, nyquist_hz],
            y: [-120.0, 12.0],
            y_label: "magnitude (dB)",
            band_hz: BAND_HZ,
            mains_hz: MAINS_HZ,
            curves: curves(compared),
        }
    }

    /// Chart of the group delay over frequency.
    pub fn group_delay(&self) -> Curves {
        let mut compared = self.compare(ImpulseResponse::group_delay_ms, [1.0, 100.0]);
        let largest_difference = self.largest_difference(&compared, COMPARED_DB / 2.0);
        // In the middle of the notch no signal passes that could be delayed.
        for point in &mut compared {
            if (point.hz - MAINS_HZ).abs() <= 0.01 {
                point.measured = f64::NAN;
            }
        }
        Curves {
            title: "How late each frequency leaves the filters",
            subtitle: format!(
                "group delay: {:.1} ms at 10 Hz, more where the filters cut; integer filters within \
                 {largest_difference:.2} ms of the float64 twin down to −20 dB",
                self.filters.group_delay_ms(10.0),
            ),
            x_hz: [1.0, 100.0],
            y: [0.0, 250.0],
            y_label: "group delay (ms)",
            band_hz: BAND_HZ,
            mains_hz: MAINS_HZ,
            curves: curves(compared),
        }
    }

    /// Evaluates `quantity` of both responses at frequencies of a span.
    fn compare(
        &self,
        quantity: fn(&ImpulseResponse, f64) -> f64,
        [first_hz, last_hz]: [f64; 2],
    ) -> Vec<Compared> {
        let frequencies = frequencies(first_hz, last_hz).into_iter();
        let compared = frequencies.map(|hz| Compared {
            hz,
            measured: quantity(&self.filters, hz),
            designed: quantity(&self.twin, hz),
        });
        compared.collect()
    }

    /// Largest difference where the twin's magnitude exceeds `least_db`.
    fn largest_difference(&self, compared: &[Compared], least_db: f64) -> f64 {
        let passed = compared
            .iter()
            .filter(|point| self.twin.magnitude_db(point.hz) > least_db);
        passed
            .map(|point| (point.measured - point.designed).abs())
            .fold(0.0, f64::max)
    }
}

/// One quantity of both responses at one frequency.
struct Compared {
    hz: f64,
    /// Of the fixed-point filters.
    measured: f64,
    /// Of the float64 twin.
    designed: f64,
}

fn curves(compared: Vec<Compared>) -> Vec<Curve> {
    let measured = compared.iter().map(|point| (point.hz, point.measured));
    let designed = compared.iter().map(|point| (point.hz, point.designed));
    vec![
        Curve {
            label: "measured: impulses through the integer filters".to_owned(),
            color: SOURCE,
            mark: Mark::Line,
            points: measured.filter(|(_, value)| !value.is_nan()).collect(),
        },
        Curve {
            label: "float64 twin, not quantised".to_owned(),
            color: RESULT,
            mark: Mark::Circles,
            points: designed.step_by(CIRCLE_DISTANCE).collect(),
        },
    ]
}

/// Ascending frequencies of a curve in Hz, with more of them around the notch.
fn frequencies(first: f64, last: f64) -> Vec<f64> {
    let parts = (0..=POINTS).map(|point| f64::from(point) / f64::from(POINTS));
    let mut frequencies: Vec<f64> = parts
        .map(|part| first * (last / first).powf(part))
        .collect();
    frequencies.extend((-10..=10).map(|point| MAINS_HZ + 0.04 * f64::from(point)));
    frequencies.sort_by(f64::total_cmp);
    frequencies
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use artifact::Artifact;

    use super::*;

    fn response() -> Response {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../model/artifact");
        let artifact = Artifact::read(&folder).expect("the artifact");
        Response::measure(&Twin::new(&artifact.description.filters))
    }

    #[test]
    fn the_measured_filters_are_the_designed_ones() {
        let response = response();
        let magnitude = response.compare(ImpulseResponse::magnitude_db, [0.1, 255.0]);
        // Measured 0.003 dB, near -40 dB.
        let difference = response.largest_difference(&magnitude, COMPARED_DB);
        assert!(difference < 0.01, "{difference} dB");
        let notch = magnitude
            .iter()
            .find(|point| (point.hz - MAINS_HZ).abs() < 1e-9);
        let notch = notch.expect("a point at the notch").measured;
        assert!(notch < -60.0, "{notch} dB");
    }

    /// Reference: `scipy.signal.freqz` of `butter(5, [0.5, 60], 'bandpass', fs=512)` times
    /// `iirnotch(50, 30, 512)`.
    #[test]
    fn the_twin_is_scipys() {
        let twin = response().twin;
        let scipy = [
            (0.3, -22.432_107_5),
            (30.0, -0.006_695_2),
            (49.0, -2.703_321_9),
            (100.0, -26.399_503_5),
        ];
        for (hz, expected) in scipy {
            let db = twin.magnitude_db(hz);
            // The impulse response is cut off after 10 s; measured 4e-4 dB at most.
            assert!((db - expected).abs() < 1e-3, "{hz} Hz: {db}");
        }
    }
}
