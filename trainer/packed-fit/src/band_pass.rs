//! Electrodes after the band-pass of a classifier.

use crate::track::Track;
use nalgebra::DMatrix;

/// Factor from a coefficient to Q32.
const Q32: f64 = 4_294_967_296.0;

/// Returns the electrodes of a track in microvolts after `sections`, `[electrode, step]`. A section
/// is gain, a1 and a2, Q32, as a device has them; its filter starts at rest.
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
