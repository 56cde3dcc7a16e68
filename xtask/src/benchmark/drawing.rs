//! The benchmark's pictures: response, group delay and noise against the float64 twin.

use std::path::Path;

use super::impulse::ImpulseResponse;
use super::noise::{Measured, Noise};
use super::twin::Twin;
use crate::picture::canvas::{FAINT, PictureError, REFERENCE, RESULT, SOURCE};
use crate::picture::curves::{Chart, Curve, Mark};

/// Points of a curve, evenly over the logarithm of the frequency.
const POINTS: u32 = 600;
/// Of these every so many-th has a circle of the twin.
const CIRCLES: usize = 8;

/// Draws them into `folder`.
///
/// # Errors
/// A file cannot be written.
pub(crate) fn draw_all(noise: &Noise, twin: &Twin, folder: &Path) -> Result<(), PictureError> {
    let filters = ImpulseResponse::of_the_filters();
    let twin = ImpulseResponse::of_the_twin(twin);
    response(&filters, &twin).draw(&folder.join("filters-response.svg"))?;
    group_delay(&filters, &twin).draw(&folder.join("filters-group-delay.svg"))?;
    densities(noise).draw(&folder.join("filters-noise.svg"))
}

fn response(filters: &ImpulseResponse, twin: &ImpulseResponse) -> Chart {
    let nyquist = f64::from(model::ADC_RATE_HZ) / 2.0;
    let frequencies = frequencies(0.1, 0.999 * nyquist);
    let value = ImpulseResponse::magnitude_db;
    let [measured, designed] = [filters, twin].map(|from| points(from, &frequencies, value));
    let worst = worst_difference(filters, twin, &frequencies, value, -40.0);
    Chart {
        title: "The filters for 50 Hz mains: magnitude",
        subtitle: format!("fixed point within {worst:.3} dB of the float64 twin down to −40 dB"),
        x_hz: [0.1, nyquist],
        y: [-120.0, 8.0],
        y_words: "magnitude (dB)",
        curves: against_twin(measured, designed),
    }
}

fn group_delay(filters: &ImpulseResponse, twin: &ImpulseResponse) -> Chart {
    let frequencies = frequencies(1.0, 60.0);
    let value = ImpulseResponse::group_delay_ms;
    let [measured, designed] = [filters, twin].map(|from| points(from, &frequencies, value));
    let worst = worst_difference(filters, twin, &frequencies, value, -20.0);
    Chart {
        title: "The filters for 50 Hz mains: group delay",
        subtitle: format!(
            "fixed point within {worst:.3} ms of the float64 twin down to −20 dB; at 10 Hz {:.2} ms",
            filters.group_delay_ms(10.0)
        ),
        x_hz: [1.0, 60.0],
        y: [0.0, 250.0],
        y_words: "group delay (ms)",
        curves: against_twin(measured, designed),
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
    let tallest = [&noise.ours, &noise.idsp_dither, &noise.idsp_wide]
        .into_iter()
        .flat_map(|measured| &measured.density)
        .filter(|(hz, _)| *hz >= 0.25)
        .map(|(_, density)| *density)
        .fold(adc, f64::max);
    Chart {
        title: "What the arithmetic adds: noise against the float64 twin",
        subtitle: "20 mV offset, 100 µV mains, 30 µV EEG; figures in 0.5 to 60 Hz".to_owned(),
        x_hz: [0.25, nyquist],
        y: [0.0, 1.1 * tallest],
        y_words: "density (nV per √Hz)",
        curves: vec![
            line("idsp dither", RESULT, &noise.idsp_dither),
            line("idsp wide", REFERENCE, &noise.idsp_wide),
            line("ours", SOURCE, &noise.ours),
            Curve {
                label: "rounding to ADC counts".to_owned(),
                color: FAINT,
                mark: Mark::Line,
                points: vec![(0.25, adc), (nyquist, adc)],
            },
        ],
    }
}

fn against_twin(measured: Vec<(f64, f64)>, designed: Vec<(f64, f64)>) -> Vec<Curve> {
    vec![
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
    ]
}

/// Rising, with a closer look at the notch.
fn frequencies(first: f64, last: f64) -> Vec<f64> {
    let steps = (0..=POINTS).map(|step| f64::from(step) / f64::from(POINTS));
    let mut frequencies: Vec<f64> = steps
        .map(|part| first * (last / first).powf(part))
        .collect();
    frequencies.extend((-10..=10).map(|step| 50.0 + 0.04 * f64::from(step)));
    frequencies.sort_by(f64::total_cmp);
    frequencies
}

fn points(
    response: &ImpulseResponse,
    frequencies: &[f64],
    value: fn(&ImpulseResponse, f64) -> f64,
) -> Vec<(f64, f64)> {
    let points = frequencies.iter().map(|hz| (*hz, value(response, *hz)));
    points.collect()
}

/// Largest difference where the twin passes more than so many dB; below, an impulse drowns in rounding.
fn worst_difference(
    filters: &ImpulseResponse,
    twin: &ImpulseResponse,
    frequencies: &[f64],
    value: fn(&ImpulseResponse, f64) -> f64,
    least_db: f64,
) -> f64 {
    let passed = frequencies
        .iter()
        .filter(|hz| twin.magnitude_db(**hz) > least_db);
    passed
        .map(|hz| (value(filters, *hz) - value(twin, *hz)).abs())
        .fold(0.0, f64::max)
}
