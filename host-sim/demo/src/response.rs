//! Frequency response of the filters, measured with impulses, and that of their float64 twin.

mod impulse;
mod twin;

use picture::canvas::{RESULT, SOURCE};
use picture::curves::{Curve, Curves, Mark};

use self::impulse::ImpulseResponse;
pub use self::twin::{MAINS_HZ, Twin};

/// Pass band of the filters, Hz.
pub const BAND_HZ: [f64; 2] = [0.5, 60.0];

/// Number of points in a curve, evenly spaced over the logarithm of the frequency.
const POINTS: u32 = 600;
/// Distance between two circles on the twin's curve, in points of the curve.
const CIRCLE_DISTANCE: usize = 8;

/// Smallest magnitude at which the filters are compared with the twin, dB. At smaller magnitudes,
/// rounding hides the response to an impulse, and the truncated end of the impulse response is
/// significant.
const COMPARED_DB: f64 = -40.0;

/// Impulse responses of the fixed-point filters and of their float64 twin.
#[derive(Debug)]
pub struct Response {
    filters: ImpulseResponse,
    twin: ImpulseResponse,
}

impl Response {
    /// Passes an impulse through the filters and through `twin`.
    pub fn measure(twin: &Twin) -> Self {
        Self {
            filters: ImpulseResponse::from_filters(),
            twin: ImpulseResponse::from_twin(twin),
        }
    }

    /// Returns the chart of the magnitude in dB over the frequency in Hz.
    pub fn magnitude(&self) -> Curves {
        let nyquist_hz = f64::from(model::ADC_RATE_HZ) / 2.0;
        let compared = self.compare(ImpulseResponse::magnitude_db, [0.1, 0.999 * nyquist_hz]);
        let difference = self.largest_difference(&compared, COMPARED_DB);
        let subtitle = format!(
            "magnitude before the decimation, at {} Hz; integer filters within {difference:.3} dB of the \
             float64 twin down to −40 dB",
            model::ADC_RATE_HZ
        );
        Curves {
            title: "The filters pass the EEG from 0.5 to 60 Hz, and stop the mains at 50 Hz",
            subtitle,
            x_hz: [0.1, nyquist_hz],
            y: [-120.0, 12.0],
            y_label: "magnitude (dB)",
            band_hz: BAND_HZ,
            mains_hz: MAINS_HZ,
            curves: curves(&compared),
        }
    }

    /// Returns the chart of the group delay in ms over the frequency in Hz.
    pub fn group_delay(&self) -> Curves {
        let mut compared = self.compare(ImpulseResponse::group_delay_ms, [1.0, 100.0]);
        let difference = self.largest_difference(&compared, COMPARED_DB / 2.0);
        // At the centre of the notch no signal passes, so it has no delay.
        for [hz, measured, _] in &mut compared {
            if (*hz - MAINS_HZ).abs() <= 0.01 {
                *measured = f64::NAN;
            }
        }
        let subtitle = format!(
            "group delay: {:.1} ms at 10 Hz, more where the filters cut; integer filters within \
             {difference:.2} ms of the float64 twin down to −20 dB",
            self.filters.group_delay_ms(10.0)
        );
        Curves {
            title: "How late each frequency leaves the filters",
            subtitle,
            x_hz: [1.0, 100.0],
            y: [0.0, 250.0],
            y_label: "group delay (ms)",
            band_hz: BAND_HZ,
            mains_hz: MAINS_HZ,
            curves: curves(&compared),
        }
    }

    /// Returns, for each point of a curve, the frequency in Hz, and `quantity` of the filters and of
    /// the twin at this frequency.
    fn compare(
        &self,
        quantity: fn(&ImpulseResponse, f64) -> f64,
        [first, last]: [f64; 2],
    ) -> Vec<[f64; 3]> {
        let parts = (0..=POINTS).map(|point| f64::from(point) / f64::from(POINTS));
        let mut frequencies: Vec<f64> = parts
            .map(|part| first * (last / first).powf(part))
            .collect();
        // Add points around the notch.
        frequencies.extend((-10..=10).map(|point| MAINS_HZ + 0.04 * f64::from(point)));
        frequencies.sort_by(f64::total_cmp);
        let compared = |hz: f64| [hz, quantity(&self.filters, hz), quantity(&self.twin, hz)];
        frequencies.into_iter().map(compared).collect()
    }

    /// Returns the largest difference between the filters and the twin, among the points at which the
    /// twin's magnitude exceeds `least_db`.
    fn largest_difference(&self, compared: &[[f64; 3]], least_db: f64) -> f64 {
        let compared = compared.iter();
        let passed = compared.filter(|[hz, ..]| self.twin.magnitude_db(*hz) > least_db);
        let differences = passed.map(|[_, measured, designed]| (measured - designed).abs());
        differences.fold(0.0, f64::max)
    }
}

fn curves(compared: &[[f64; 3]]) -> Vec<Curve> {
    let measured = compared.iter().map(|[hz, measured, _]| (*hz, *measured));
    let designed = compared.iter().map(|[hz, _, designed]| (*hz, *designed));
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
        let magnitude = response.compare(ImpulseResponse::magnitude_db, [0.1, 255.0]);
        // The largest difference measured is 0.003 dB, at a magnitude near -40 dB.
        let difference = response.largest_difference(&magnitude, COMPARED_DB);
        assert!(difference < 0.01, "{difference} dB");
        let notch = magnitude
            .iter()
            .find(|[hz, ..]| (hz - MAINS_HZ).abs() < 1e-9);
        assert!(notch.is_some_and(|[_, db, _]| *db < -60.0), "{notch:?}");
    }

    /// The reference values are those of `scipy.signal.freqz` for `butter(5, [0.5, 60], 'bandpass',
    /// fs=512)` times `iirnotch(50, 30, 512)`.
    #[test]
    fn the_twin_is_scipys() {
        if model::ADC_RATE_HZ != 512 {
            eprintln!("SKIPPED: the twin against scipy: the built-in model has another rate");
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
