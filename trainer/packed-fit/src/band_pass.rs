//! Band-pass filtering of tracks, and parsing of frequency bands.

use crate::track::Track;
use nalgebra::DMatrix;

/// Factor from a coefficient to its Q32 integer.
const Q32: f64 = 4_294_967_296.0;

/// Lowest and highest edge of a band, Hz: the range that the device's filters pass.
const EDGES_HZ: [f64; 2] = [1.0, 60.0];
/// Least width of a band, Hz.
const LEAST_WIDTH_HZ: f64 = 1.0;

/// Returns the signals of a track's electrodes after the filter `sections`, which starts at rest,
/// in microvolts, `[electrode, step]`. Each section is the device's `[gain, a1, a2]` in Q32.
pub fn band_passed(track: &Track, sections: &[[i64; 3]]) -> DMatrix<f64> {
    let values = track.values.iter().map(|&uv| f64::from(uv));
    let mut signals = DMatrix::from_iterator(track.electrodes, track.steps(), values);
    for section in sections {
        let [gain, a1, a2] = section.map(|coefficient| coefficient as f64 / Q32);
        let mut states = vec![[0.0; 4]; track.electrodes];
        for mut step in signals.column_iter_mut() {
            for (value, [x1, x2, y1, y2]) in step.iter_mut().zip(&mut states) {
                let x = *value;
                *value = gain * (x - *x2) + a1 * *y1 + a2 * *y2;
                (*x2, *x1, *y2, *y1) = (*x1, x, *y1, *value);
            }
        }
    }
    signals
}

/// Parses a band, two frequencies in Hz, such as `8..30`.
///
/// # Errors
/// If the text is not a band, or the device's filters do not pass it.
pub fn parse_band(text: &str) -> Result<[f64; 2], String> {
    let [low, high] = parse_range(text)?;
    let [least, most] = EDGES_HZ;
    if low < least || high > most || high - low < LEAST_WIDTH_HZ {
        return Err(format!(
            "a band is within {least} to {most} Hz, which the filters of the device let through, \
             and at least {LEAST_WIDTH_HZ} Hz wide"
        ));
    }
    Ok([low, high])
}

/// Parses two ascending numbers, such as `0.5..4`.
///
/// # Errors
/// If the text is anything else.
pub fn parse_range(text: &str) -> Result<[f64; 2], String> {
    let numbers = text.split_once("..").map(|(low, high)| [low, high].map(str::parse));
    match numbers {
        Some([Ok(low), Ok(high)]) if f64::is_finite(high - low) && low < high => Ok([low, high]),
        _ => Err("write two ascending numbers, such as 0.5..4".to_owned()),
    }
}
