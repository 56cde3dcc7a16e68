//! The benchmark's pictures: response, group delay and noise against the float64 twin.

use std::path::Path;

use super::impulse::ImpulseResponse;
use super::noise::{BAND_HZ, Measured, Noise};
use super::twin::Twin;
use crate::picture::canvas::{FAINT, PictureError, REFERENCE, RESULT, SOURCE};
use crate::picture::curves::{Chart, Curve, Mark};

/// Points of a curve, evenly over the logarithm of the frequency.
const POINTS: u32 = 600;
/// Of these every so many-th has a circle of the twin.
const CIRCLES: usize = 8;

/// The mains whose filters are drawn, Hz.
const MAINS_HZ: f64 = 50.0;
/// Magnitude down to which the filters are compared with the twin, dB: further down an impulse drowns
/// in rounding, and in what comes after its end.
const COMPARED_DB: f64 = -40.0;

/// Draws them into `folder`.
///
/// # Errors
/// A file cannot be written.
pub(crate) fn draw_all(noise: &Noise, twin: &Twin, folder: &Path) -> Result<(), PictureError> {
    response(twin).draw(&folder.join("filters-response.svg"))?;
    group_delay(twin).draw(&folder.join("filters-group-delay.svg"))?;
    densities(noise).draw(&folder.join("filters-noise.svg"))
}

/// What the filters let pass, beside what the twin does.
pub(crate) fn response(twin: &Twin) -> Chart {
    let value = ImpulseResponse::magnitude_db;
    let nyquist = f64::from(model::ADC_RATE_HZ) / 2.0;
    let compared = Compared::new(twin, value, [0.1, 0.999 * nyquist], COMPARED_DB);
    Chart {
        title: "The filters pass the EEG from 0.5 to 60 Hz, and stop the mains at 50 Hz",
        subtitle: format!(
            "magnitude before the decimation, at {} Hz; integer filters within {:.3} dB of the \
             float64 twin down to −40 dB",
            model::ADC_RATE_HZ,
            compared.worst
        ),
        x_hz: [0.1, nyquist],
        y: [-120.0, 12.0],
        y_words: "magnitude (dB)",
        band_hz: BAND_HZ,
        mains_hz: MAINS_HZ,
        curves: compared.curves(),
    }
}

fn group_delay(twin: &Twin) -> Chart {
    let value = ImpulseResponse::group_delay_ms;
    let mut compared = Compared::new(twin, value, [1.0, 100.0], COMPARED_DB / 2.0);
    // In the middle of the notch there is nothing left to be late.
    compared
        .measured
        .retain(|(hz, _)| (hz - MAINS_HZ).abs() > 0.01);
    Chart {
        title: "How late each frequency leaves the filters",
        subtitle: format!(
            "group delay: {:.1} ms at 10 Hz, more where the filters cut; integer filters within \
             {:.2} ms of the float64 twin down to −20 dB",
            value(&ImpulseResponse::of_the_filters(), 10.0),
            compared.worst
        ),
        x_hz: [1.0, 100.0],
        y: [0.0, 250.0],
        y_words: "group delay (ms)",
        band_hz: BAND_HZ,
        mains_hz: MAINS_HZ,
        curves: compared.curves(),
    }
}

fn densities(noise: &Noise) -> Chart {
    let line = |label: &str, color, measured: &Measured| Curve {
        label: format!("{label}: {:.1} nV rms", measured.in_band.eeg),
        color,
        mark: Mark::Line,
        points: measured.density.iter().copied().skip(1).collect(),
    };
    let nyquist = f64::from(model::ADC_RATE_HZ) / 2.0;
    // The ADC rounds to whole counts: LSB^2 / 12, evenly over all frequencies.
    let adc = f64::from(model::LSB_NV) / (12.0 * nyquist).sqrt();
    let adc_in_band = adc * (BAND_HZ[1] - BAND_HZ[0]).sqrt();
    let tallest = [&noise.ours, &noise.idsp_dither, &noise.idsp_wide]
        .into_iter()
        .flat_map(|measured| &measured.density)
        .filter(|(hz, _)| *hz >= 0.25)
        .map(|(_, density)| *density)
        .fold(adc, f64::max);
    Chart {
        title: "What integer arithmetic adds to the EEG, beside what rounding in the ADC adds",
        subtitle: "output minus that of a float64 twin, on 20 mV offset, 100 µV mains and 30 µV \
                   EEG; the lower the quieter; rms over 0.5 to 60 Hz"
            .to_owned(),
        x_hz: [0.25, nyquist],
        y: [0.0, 1.2 * tallest],
        y_words: "density (nV per √Hz)",
        band_hz: BAND_HZ,
        mains_hz: MAINS_HZ,
        curves: vec![
            line("idsp dither", RESULT, &noise.idsp_dither),
            line("idsp wide", REFERENCE, &noise.idsp_wide),
            line("ours", SOURCE, &noise.ours),
            Curve {
                label: format!("rounding in the ADC: {adc_in_band:.1} nV rms"),
                color: FAINT,
                mark: Mark::Line,
                points: vec![(0.25, adc), (nyquist, adc)],
            },
        ],
    }
}

/// Something of the integer filters and of the twin, over frequency.
struct Compared {
    measured: Vec<(f64, f64)>,
    designed: Vec<(f64, f64)>,
    /// Largest difference where the twin passes more than asked.
    worst: f64,
}

impl Compared {
    fn new(
        twin: &Twin,
        value: fn(&ImpulseResponse, f64) -> f64,
        [first, last]: [f64; 2],
        least_db: f64,
    ) -> Self {
        let filters = ImpulseResponse::of_the_filters();
        let twin = ImpulseResponse::of_the_twin(twin);
        let frequencies = frequencies(first, last);
        let points = |response: &ImpulseResponse| -> Vec<(f64, f64)> {
            let points = frequencies.iter().map(|hz| (*hz, value(response, *hz)));
            points.collect()
        };
        let (measured, designed) = (points(&filters), points(&twin));
        let differences = measured.iter().zip(&designed);
        let passed = differences.filter(|((hz, _), _)| twin.magnitude_db(*hz) > least_db);
        let worst = passed
            .map(|((_, measured), (_, designed))| (measured - designed).abs())
            .fold(0.0, f64::max);
        Self {
            measured,
            designed,
            worst,
        }
    }

    fn curves(self) -> Vec<Curve> {
        vec![
            Curve {
                label: "measured: impulses through the integer filters".to_owned(),
                color: SOURCE,
                mark: Mark::Line,
                points: self.measured,
            },
            Curve {
                label: "float64 twin, not quantised".to_owned(),
                color: RESULT,
                mark: Mark::Circles,
                points: self.designed.into_iter().step_by(CIRCLES).collect(),
            },
        ]
    }
}

/// Rising, with a closer look at the notch.
fn frequencies(first: f64, last: f64) -> Vec<f64> {
    let steps = (0..=POINTS).map(|step| f64::from(step) / f64::from(POINTS));
    let mut frequencies: Vec<f64> = steps
        .map(|part| first * (last / first).powf(part))
        .collect();
    frequencies.extend((-10..=10).map(|step| MAINS_HZ + 0.04 * f64::from(step)));
    frequencies.sort_by(f64::total_cmp);
    frequencies
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_measured_filters_are_the_designed_ones() {
        let twin = Twin::of_the_model().expect("the artifact");
        let span = [0.1, 255.0];
        let magnitude = Compared::new(&twin, ImpulseResponse::magnitude_db, span, COMPARED_DB);
        // Measured 0.003 dB, near -40 dB.
        assert!(magnitude.worst < 0.01, "{} dB", magnitude.worst);
        let notch = magnitude
            .measured
            .iter()
            .find(|(hz, _)| (hz - MAINS_HZ).abs() < 1e-9);
        assert!(notch.is_some_and(|(_, db)| *db < -60.0), "{notch:?}");
    }
}
