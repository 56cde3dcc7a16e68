//! The integer encoder's codes are close to the float encoder's, for networks in which every layer,
//! every padding and every sign of a batch norm's scale matters.

use any_model::{any_artifact, every_variant, quantised, windows};
use artifact::{Artifact, CodeFormat, FloatEncoder, Mode, Padding};
use model_gen::{IntegerModel, ModelGenError, quantise};

/// Number of windows that each variant encodes, none of which was used to calibrate it.
const WINDOWS: usize = 6;

/// Returns the codes of the same windows twice: as the float encoder computes them, and as the
/// integer encoder computes them, dequantised.
fn codes(artifact: &Artifact, model: &IntegerModel, seed: u32) -> (Vec<Vec<f32>>, Vec<Vec<f32>>) {
    let encoder = FloatEncoder::new(artifact).expect("a complete network");
    windows(seed, artifact, WINDOWS)
        .iter()
        .map(|window| {
            let integers = model.encode_window(&quantised(artifact, model, window));
            (encoder.encode(window), model.dequantise(&integers))
        })
        .unzip()
}

/// Returns the ratio of signal to quantisation noise over all codes, in dB. The signal of a code's
/// dimension is its deviation from the dimension's mean over all codes.
fn sqnr_db((float, integer): &(Vec<Vec<f32>>, Vec<Vec<f32>>)) -> f32 {
    let (mut signal, mut noise) = (0.0, 0.0);
    for j in 0..float[0].len() {
        #[expect(clippy::cast_precision_loss, reason = "a few windows")]
        let mean = float.iter().map(|z| z[j]).sum::<f32>() / float.len() as f32;
        for (a, b) in float.iter().zip(integer) {
            signal += (a[j] - mean).powi(2);
            noise += (a[j] - b[j]).powi(2);
        }
    }
    10.0 * (signal / noise).log10()
}

#[test]
fn integer_codes_follow_the_float_codes_in_every_variant() {
    for (seed, (mode, padding, pool)) in (1..).zip(every_variant()) {
        let artifact = any_artifact(seed, mode, padding, pool, 8).expect("an artifact");
        let model = quantise(&artifact).expect("a quantisable network");
        let sqnr = sqnr_db(&codes(&artifact, &model, seed));
        println!("{mode:?}, {padding:?}, {pool:?}: {sqnr:.1} dB");
        // The lowest SQNR measured is 29.5 dB for modes with a shortcut and 22.2 dB for others.
        let floor_db = if mode.has_shortcut() { 27.0 } else { 21.0 };
        assert!(sqnr > floor_db, "{mode:?}, {padding:?}, {pool:?}: {sqnr:.1} dB");
    }
}

#[test]
fn zeros_in_place_of_the_padding_degrade_the_codes() {
    for padding in [Padding::Space, Padding::All] {
        let artifact = any_artifact(7, Mode::PaperCodeOnly, padding, [2, 2, 2], 8);
        let artifact = artifact.expect("an artifact");
        let mut model = quantise(&artifact).expect("a quantisable network");
        let right = sqnr_db(&codes(&artifact, &model, 7));
        model.hidden_padding.fill(0);
        let wrong = sqnr_db(&codes(&artifact, &model, 7));
        println!("{padding:?}: {right:.1} dB, with zeros {wrong:.1} dB");
        // With padding by zeros, the measured SQNR was 26 dB lower than with the correct padding.
        assert!(wrong < right - 20.0, "{padding:?}: {right:.1}, {wrong:.1}");
    }
}

#[test]
fn a_padding_beyond_16_bits_is_refused_naming_its_channel() {
    let mut artifact =
        any_artifact(5, Mode::Shortcut, Padding::Space, [2, 2, 2], 8).expect("an artifact");
    let mut bias = vec![0.0; 16];
    bias[9] = 1e5;
    artifact.weights.insert("encoder.norm1.bias", &[16], bias);
    let error = quantise(&artifact).expect_err("cannot be padded");
    assert!(matches!(error, ModelGenError::HiddenPadding { channel: 9, .. }), "{error}");
}

#[test]
fn a_dimension_far_from_zero_keeps_its_resolution() {
    let mut artifact =
        any_artifact(4, Mode::Shortcut, Padding::None, [2, 2, 2], 8).expect("an artifact");
    // Of the three formats, only Int8 has a zero point.
    artifact.description.code.format = CodeFormat::Int8;
    let raise = |name: &str, by: f32| {
        let values = artifact.calibration.tensor(name, &[128]);
        let values = values.expect("calibrated").iter();
        values.map(|v| v + by).collect::<Vec<f32>>()
    };
    let (low, high) = (raise("code.min", 100.0), raise("code.max", 100.0));
    artifact.calibration.insert("code.min", &[128], low);
    artifact.calibration.insert("code.max", &[128], high.clone());
    let model = quantise(&artifact).expect("a quantisable network");
    for (j, high) in high.iter().enumerate() {
        let q = high / model.code_scale[j] + f32::from(model.code_zero_point[j]);
        assert!(q <= 127.0, "dimension {j}: {q}");
    }
}
