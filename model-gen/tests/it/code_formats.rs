//! Tests of the code formats with the built-in model: how an exponent or 16 bits reduce the error.

use std::path::Path;

use artifact::{Artifact, CodeFormat, FloatEncoder, Golden};
use model_gen::{IntegerModel, integer_code, quantise};

fn folder() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../signal/model/artifact")
}

/// Returns the built-in model, quantised for codes in the format `format`.
fn model(format: CodeFormat) -> IntegerModel {
    let mut artifact = Artifact::read(&folder()).expect("the checked-in artifact is readable");
    artifact.description.code.format = format;
    quantise(&artifact).expect("quantisable in every format")
}

/// Returns the checked-in golden windows: 10 extreme windows, then three windows of noise for each
/// amplitude from 0.01 to 1.5 of the input's range.
fn windows() -> Vec<Vec<i8>> {
    let golden = Golden::read(&folder()).expect("the checked-in golden is readable");
    assert_eq!(golden.windows.len(), 28);
    golden.windows
}

/// Returns the mean squared difference of two codes.
fn distance(a: &[f32], b: &[f32]) -> f32 {
    let squares = a.iter().zip(b).map(|(a, b)| (a - b).powi(2));
    squares.sum::<f32>() / 128.0
}

/// Returns the code that the float encoder computes for a quantised window.
fn float_code(window: &[i8]) -> Vec<f32> {
    let artifact = Artifact::read(&folder()).expect("the checked-in artifact is readable");
    let encoder = FloatEncoder::new(&artifact).expect("a complete network");
    #[expect(clippy::cast_possible_truncation, reason = "a scale")]
    let sd_uv = artifact.description.input.sd_uv as f32;
    let scale = model(CodeFormat::Int8).input_scale_uv / sd_uv;
    let cells: Vec<f32> = window.iter().map(|&q| f32::from(q) * scale).collect();
    encoder.encode(&cells)
}

#[test]
fn with_an_exponent_small_signals_have_a_finer_code_and_large_ones_are_not_clipped() {
    let [int8, exponent, int16] =
        [CodeFormat::Int8, CodeFormat::Int8Exponent, CodeFormat::Int16].map(model);
    for (index, window) in windows().iter().enumerate().skip(10) {
        let float = float_code(window);
        let codes = [&int8, &exponent, &int16].map(|model| model.encode_window(window));
        let errors = [(&int8, 0), (&exponent, 1), (&int16, 2)]
            .map(|(model, place)| distance(&float, &model.dequantise(&codes[place])));
        let [by_int8, by_exponent, by_int16] = errors;
        eprintln!(
            "window {index}: exponent {}, mean squared error of z {by_int8:.4}, with an exponent \
             {by_exponent:.4}, in 16 bits {by_int16:.4}",
            codes[1].exponent
        );
        // The 1 % allows for rounding of the last bit, which can favour either format.
        assert!(by_int16 <= 1.01 * by_exponent, "window {index}");
        if index < 13 {
            assert!(by_exponent < 0.1 * by_int8, "window {index}, small signal");
        }
        let at_rails = |values: &[i16]| values.iter().filter(|v| matches!(v, -128 | 127)).count();
        if index >= 25 {
            assert!(at_rails(&codes[0].values) > 0, "window {index}, large signal");
            assert_eq!(at_rails(&codes[1].values), 0, "window {index}");
            assert!(by_exponent < by_int8, "window {index}");
        }
    }
}

#[test]
fn a_code_with_an_exponent_is_within_half_its_resolution_of_the_16_bit_code() {
    let (exponent, int16) = (model(CodeFormat::Int8Exponent), model(CodeFormat::Int16));
    assert_eq!(exponent.code_scale, int16.code_scale);
    assert_eq!(exponent.code_zero_point, [0; 128]);
    assert_eq!(int16.code_zero_point, [0; 128]);
    for window in &windows() {
        let (short, long) = (exponent.encode_window(window), int16.encode_window(window));
        let half = 2_i32.pow(short.exponent.into()) / 2;
        // Compare only levels within this range: outside it, one or both codes are clipped.
        let pairs = short.levels().into_iter().zip(long.levels());
        let pairs = pairs.filter(|(_, long)| (-32_767..32_640).contains(long));
        let furthest = pairs.map(|(a, b)| (a - b).abs()).max();
        assert!(furthest <= Some(half), "{furthest:?} of {half}");
    }
}

#[test]
fn the_smallest_exponent_that_clips_no_value_is_chosen() {
    let encoded = |level: i64| {
        let code = integer_code(CodeFormat::Int8Exponent, &[level; 128]);
        (code.exponent, code.values[0])
    };
    assert_eq!(encoded(127), (0, 127));
    // 255 / 2 rounds up to 128, which is above 127, so 255 needs the exponent 2.
    assert_eq!((encoded(254), encoded(255)), ((1, 127), (2, 64)));
    assert_eq!((encoded(-257), encoded(-258)), ((1, -128), (2, -64)));
    assert_eq!((encoded(32_639), encoded(32_640)), ((8, 127), (8, 127)));
    assert_eq!((encoded(i64::from(i32::MAX)), encoded(-(1 << 31))), ((8, 127), (8, -128)));
}
