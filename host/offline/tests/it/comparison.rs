//! The reported error of each electrode is the written file's error against the filtered recording.

use offline::{ElectrodeOrigin, SignalFormat};
use pipeline::{FrontEnd, Mains};

use crate::recording::{Fixture, labels, values};

#[test]
fn errors_are_those_of_the_settled_steps() {
    let fixture = Fixture::settled();
    fixture.encode();
    let decoded = fixture.decode(&fixture.codes(), "decoded.gdf", SignalFormat::Gdf, true);
    let comparison = decoded.expect("decoded").comparison.expect("an original");
    let written = values(&fixture.path("decoded.gdf"));
    let original = filtered(&fixture);
    let settling = usize::try_from(Mains::Hz50.filter().settling_samples).expect("few");
    let settled = settling.div_ceil(usize::from(model::ADC_RATE_HZ / model::STEP_RATE_HZ));
    // A hop is left out if a window that contains it has a step at which the filters were settling.
    let first = settled.next_multiple_of(model::HOP) + model::STEPS - model::HOP;
    let compared = usize::try_from(comparison.steps).expect("few steps");
    assert!(compared > 100, "{compared} steps");
    assert_eq!(compared, written[0].len() - first);
    for (electrode, error) in comparison.electrodes.iter().enumerate() {
        let rows = (first..written[0].len())
            .map(|row| (original[row][electrode], written[electrode][row]));
        let signal: f64 = rows.clone().map(|(x, _)| x * x).sum();
        let squared: f64 = rows.map(|(x, y)| (x - y).powi(2)).sum();
        assert!((error.signal / signal - 1.0).abs() < 1e-5, "{electrode}");
        assert!((error.error / squared - 1.0).abs() < 1e-3, "{electrode}");
        let prd = 100.0 * (squared / signal).sqrt();
        assert!((error.prd_percent() / prd - 1.0).abs() < 1e-3, "{electrode}");
    }
    let measured = vec![ElectrodeOrigin::Measured; labels().len()];
    assert_eq!(comparison.origins, measured);
    let excerpt = &comparison.excerpt;
    assert_eq!(excerpt.original_uv.len(), 4 * 128);
    let row = usize::try_from(excerpt.first_row).expect("few rows");
    assert!((f64::from(excerpt.decoded_uv[7][3]) - written[3][row + 7]).abs() < 1e-9);
    assert!((f64::from(excerpt.original_uv[7][3]) - original[row + 7][3]).abs() < 1e-3);
}

#[test]
fn a_recording_in_which_the_filters_settle_to_the_end_has_no_error() {
    let fixture = Fixture::new();
    fixture.encode();
    let decoded = fixture.decode(&fixture.codes(), "decoded.gdf", SignalFormat::Gdf, true);
    let comparison = decoded.expect("decoded").comparison.expect("an original");
    assert_eq!(comparison.steps, 0);
    assert!(!comparison.total().prd_percent().is_finite());
}

/// Returns the filtered values of all electrodes at each step, uV.
pub(crate) fn filtered(fixture: &Fixture) -> Vec<Vec<f64>> {
    let mut front_end = FrontEnd::new(Mains::Hz50, &model::RESAMPLER);
    let steps = fixture.samples().filter_map(|sample| {
        let (electrodes, _) = front_end.filter_sample(&sample)?;
        let uv =
            electrodes.map(|value| f64::from(value) / 32.0 * f64::from(model::LSB_NV) / 1000.0);
        Some(uv.to_vec())
    });
    steps.collect()
}
