//! On real EEG, the fixed-point filters and scipy's floating-point filters have equal outputs,
//! within the ADC's rounding.

use std::path::Path;

use acceptance::{numpy_reference, real_data, workspace};
use artifact::MontageFile;
use pipeline::{FrontEnd, Mains};

/// Largest error from rounding a sample to whole counts: half a count, in uV.
const HALF_COUNT_UV: f64 = 0.5 * model::LSB_NV as f64 / 1000.0;

/// Number of levels of a filtered sample per ADC count.
const LEVELS_PER_COUNT: f64 = (1_u32 << model::GUARD_BITS) as f64;

/// Compares the filters with scipy's `sosfilt`, started from zero states, with `iirnotch(50, 30,
/// 512)` followed by `butter(5, [0.5, 60], 'bandpass', fs=512, output='sos')`. The reference
/// archive holds every fourth sample of scipy's output as float32, and scipy's coefficients; its
/// electrodes and grid are the paper's.
#[test]
fn filtered_eeg_equals_scipys_within_the_adcs_rounding() {
    let test = "filters against scipy";
    let Some(recording) = real_data::path(test, real_data::GDF_F32) else {
        return;
    };
    let Some(reference) = real_data::path(test, real_data::SCIPY_WINDOWS) else {
        return;
    };
    if !numpy_reference::available(test) {
        return;
    }
    let windows = array(&reference, "windows");
    assert_eq!(windows.len(), 240 * 16 * 10 * 9);
    let worst_gain = l1_norm(&sections(&reference));

    let paper = MontageFile::read(&workspace::root().join("files/montages/paper-61.toml"));
    let paper = paper.expect("the paper's montage");
    let (cells, montage) = (paper.grid().cells.concat(), paper.montage());
    let electrodes: Vec<&str> = montage.electrodes.iter().map(String::as_str).collect();
    assert_eq!(electrodes.len(), model::ELECTRODES);
    let samples = real_data::samples(&recording, &electrodes);
    let mut front_end = FrontEnd::new(Mains::Hz50, &model::RESAMPLER);
    let filtered: Vec<_> =
        samples.filter_map(|sample| Some(front_end.filter_sample(&sample)?.0)).collect();
    assert_eq!(filtered.len(), 240 * 16);

    let uv_per_level = f64::from(model::LSB_NV) / 1000.0 / LEVELS_PER_COUNT;
    let [mut worst, mut largest, mut squares] = [0.0_f64; 3];
    for (plane, electrodes) in windows.chunks_exact(90).zip(&filtered) {
        for (value, label) in electrodes.iter().zip(&montage.electrodes) {
            let cell = cells.iter().position(|cell| cell == label);
            let expected = plane[cell.expect("in the grid")];
            let error = (f64::from(*value) * uv_per_level - expected).abs();
            worst = worst.max(error);
            largest = largest.max(expected.abs());
            squares += error * error;
        }
    }
    let rms = (squares / (240.0 * 16.0 * 61.0)).sqrt();
    // Bound of the error from rounding: half a count in every input sample, each with the sign that
    // makes the output's error largest, plus rounding of the reference to float32.
    let rounding = worst_gain * HALF_COUNT_UV + largest * f64::from(f32::EPSILON);
    // Add one count for rounding inside the filters. The largest total error measured is 0.0177 uV.
    let bound = rounding + LEVELS_PER_COUNT * uv_per_level;
    println!(
        "filters against scipy: max error {worst:.4} uV (bound {bound:.4}), rms {rms:.4} uV, of \
         at most {largest:.1} uV; worst-case gain {worst_gain:.3}"
    );
    assert!(worst <= bound);
    // The output must not be zero, because then any two filters would agree.
    assert!(largest > 50.0);
}

/// Returns scipy's filter sections: the notch, then the band-pass. Each section consists of b0, b1,
/// b2, a0, a1 and a2, and a0 is 1.
fn sections(reference: &Path) -> Vec<[f64; 6]> {
    let [band_pass, notch] = ["sos", "notch"].map(|name| array(reference, name));
    assert_eq!([band_pass.len(), notch.len()], [5 * 6, 2 * 3]);
    [notch, band_pass].concat().as_chunks().0.to_vec()
}

fn array(reference: &Path, name: &str) -> Vec<f64> {
    numpy_reference::array(reference, name).unwrap_or_else(|error| panic!("{error}"))
}

/// Returns the sum of the magnitudes of the cascade's impulse response: the largest ratio of the
/// output's peak to the input's peak for any bounded input.
fn l1_norm(sections: &[[f64; 6]]) -> f64 {
    let mut states = vec![[0.0; 2]; sections.len()];
    // Sum over 20 s: the slowest poles decay at 0.96 / s, so the response has by then decayed by
    // about e^-19.
    let impulse = std::iter::once(1.0).chain(std::iter::repeat_n(0.0, 20 * 512));
    impulse
        .map(|input| {
            let cascade = sections.iter().zip(&mut states);
            cascade.fold(input, |x: f64, ([b0, b1, b2, _, a1, a2], [s1, s2])| {
                let y = b0 * x + *s1;
                *s1 = b1 * x - a1 * y + *s2;
                *s2 = b2 * x - a2 * y;
                y
            })
        })
        .map(f64::abs)
        .sum()
}
