//! Audits: comparison of a device's codes with the codes of the float network.
#![allow(clippy::cast_possible_truncation, reason = "scales and zero points within their types")]

use std::path::Path;
use std::sync::{Arc, LazyLock};

use artifact::{Artifact, Golden};
use bridge_core::{AuditResult, AuditedWindow, Device, Model, Settings};
use link::{Audit, CodeValues, Streams, ToHost};

use crate::board::{Board, NUMBERS, model};
use crate::recorder::{Harness, SETTINGS};

const AUDIT: Settings = Settings { streams: Streams::from_bits(0b01001), ..SETTINGS };

/// Folder of the model with the paper's montage. It never changes, so tests can state its figures.
fn folder() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../signal/model/paper"))
}

/// Returns the model in [`folder`]; it is read once per process.
fn paper() -> &'static Model {
    static MODEL: LazyLock<Model> =
        LazyLock::new(|| Model::new(&Artifact::read(folder()).unwrap()).unwrap());
    &MODEL
}

/// Returns the golden windows and codes of the model in `folder`, as audits from a device with this
/// model's scales.
fn golden(folder: &Path) -> Vec<AuditedWindow> {
    let artifact = Artifact::read(folder).unwrap();
    let device = Arc::new(device(&artifact));
    let golden = Golden::read(folder).unwrap();
    let pairs = golden.windows.iter().zip(&golden.codes);
    pairs
        .map(|(window, code)| AuditedWindow {
            device: Arc::clone(&device),
            window: 0,
            planes: window.clone(),
            levels: code.levels(),
            resolution: 1 << code.exponent,
        })
        .collect()
}

/// Returns a device with the scales that model-gen would compute: scales of int8 codes cover twice
/// the calibrated range, scales of other formats cover 16 times the larger end of that range.
fn device(artifact: &Artifact) -> Device {
    let ends = |name| {
        let ends = artifact.calibration.tensor(name, &[NUMBERS]).unwrap();
        ends.iter().map(|end| f64::from(*end)).collect::<Vec<f64>>()
    };
    let (low, high) = (ends("code.min"), ends("code.max"));
    let mut board = Board::new();
    board.code_format = match artifact.description.code.format {
        artifact::CodeFormat::Int8 => link::CodeFormat::Int8,
        artifact::CodeFormat::Int8Exponent => link::CodeFormat::Int8Exponent,
        artifact::CodeFormat::Int16 => link::CodeFormat::Int16,
    };
    for value in 0..NUMBERS {
        let (scale, zero_point) = if board.code_format == link::CodeFormat::Int8 {
            let scale = (high[value] - low[value]) / 2.0 * 2.0 / 127.0;
            let middle = f64::midpoint(high[value], low[value]);
            (scale, (-middle / scale).round() as i8)
        } else {
            (high[value].max(-low[value]) * 16.0 / 32_767.0, 0)
        };
        board.code_scale[value] = scale as f32;
        board.code_zero_point[value] = zero_point;
    }
    let harness = Harness::streaming(SETTINGS, board);
    let device = &harness.recorder.announced[0].device;
    Device::clone(device)
}

/// Compares a device's code for a window with the float network's code.
fn judge(window: &AuditedWindow, model: &Model) -> AuditResult {
    window.compare(model).expect("a code")
}

fn compare(windows: &[AuditedWindow], model: &Model) -> Vec<AuditResult> {
    windows.iter().map(|window| judge(window, model)).collect()
}

#[test]
fn codes_of_the_integer_encoder_are_within_the_limits() {
    let results = compare(&golden(folder()), paper());
    let judged = results.iter().filter(|result| !result.at_rail);
    for result in judged.clone() {
        assert!(!result.is_wrong(), "{result:?}");
        // The difference is mostly rounding error, whose RMS is 1/sqrt(12) = 0.29 levels. The
        // largest measured value is 0.34 levels; for a window of zeros it is 0.01.
        assert!(result.rms < 0.36, "{result:?}");
    }
    assert_eq!(judged.count(), 13, "of 28; the others have cells at the rail");
}

#[test]
fn codes_of_the_built_in_model_are_right_by_its_float_network() {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../signal/model/artifact"));
    let results = compare(&golden(folder), &model());
    let judged = || results.iter().filter(|result| !result.at_rail);
    for result in judged() {
        assert!(!result.is_wrong(), "{result:?}");
    }
    assert!(judged().count() > 0, "all have cells at the rail");
}

/// Returns the model in [`folder`] with one weight of the shortcut changed by 128 int8 levels, the
/// value of the weight's sign bit. A correct device differs from this model just as a device with
/// that bit flipped differs from the correct model.
fn flipped(value: usize, feature: usize) -> Model {
    let mut artifact = Artifact::read(folder()).unwrap();
    let (name, shape) = ("encoder.shortcut.weight", [NUMBERS, 976]);
    let mut weights = artifact.weights.tensor(name, &shape).unwrap().to_vec();
    let row = &mut weights[value * 976..(value + 1) * 976];
    let largest = row.iter().fold(0.0_f32, |largest, weight| largest.max(weight.abs()));
    let sign = if row[feature] < 0.0 { 1.0 } else { -1.0 };
    row[feature] += sign * largest * 128.0 / 127.0;
    artifact.weights.insert(name, &shape, weights);
    Model::new(&artifact).unwrap()
}

#[test]
fn a_flipped_sign_bit_is_found_only_at_the_value_that_it_changes() {
    let windows = golden(folder());
    let loudest = windows.iter().filter(|window| !judge(window, paper()).at_rail);
    let loudest =
        loudest.max_by_key(|window| window.planes.iter().map(|step| step.unsigned_abs()).max());
    let loudest = std::slice::from_ref(loudest.unwrap());
    let before = compare(loudest, paper())[0];
    let (mut found, mut moved) = (0, 0);
    for index in 0..24 {
        let (value, feature) = (index * 37 % NUMBERS, index * 131 % 976);
        let after = compare(loudest, &flipped(value, feature))[0];
        assert!(!after.is_wrong() || after.value == value, "{after:?}");
        moved += usize::from(after.largest > 2.0 * before.largest.max(0.5));
        found += usize::from(after.is_wrong());
    }
    println!(
        "of 24 flipped sign bits {moved} change a code by more than rounding, {found} are found"
    );
    assert!(found > 0 && found <= moved, "{found} of {moved}");
}

#[test]
fn a_code_of_another_window_is_found_on_every_window() {
    let windows = golden(folder());
    // Give each window the code of the window after it.
    for pair in windows.windows(2) {
        let mut wrong = pair[0].clone();
        wrong.levels.clone_from(&pair[1].levels);
        let result = judge(&wrong, paper());
        if !result.at_rail && pair[0].levels != pair[1].levels {
            assert!(result.is_wrong(), "{result:?}");
        }
    }
}

#[test]
fn the_limits_widen_with_the_exponent_of_a_code() {
    let mut window = golden(folder()).swap_remove(0);
    let narrow = judge(&window, paper());
    window.resolution = 16;
    let wide = judge(&window, paper());
    assert!((wide.rms_limit - narrow.rms_limit - 7.5).abs() < 1e-9);
    assert!((wide.largest_limit - narrow.largest_limit - 7.5).abs() < 1e-9);
}

fn audit<'p>(model_id: [u8; 8], planes: &'p [u8], values: &CodeValues<'p>) -> ToHost<'p> {
    ToHost::Audit(Audit { model_id, window: 3, planes, values: *values })
}

#[test]
fn audits_that_cannot_be_compared_are_counted_and_not_passed_on() {
    let mut harness = Harness::streaming(AUDIT, Board::new());
    let (id, values) = (model().id(), CodeValues::int8(&[5; NUMBERS]));
    let planes = [0xFE; 1440];
    harness.send(0, &audit(id, &planes, &values));
    let [audited] = &harness.recorder.audits[..] else { panic!("{:?}", harness.recorder.audits) };
    assert_eq!((audited.window, audited.resolution), (3, 1));
    assert_eq!((&audited.planes[..], audited.levels[127]), (&[-2; 1440][..], 5));
    let wide = CodeValues::int16(&[5; 2 * NUMBERS]);
    for wrong in [
        audit([9; 8], &planes, &values),
        audit(id, &planes[1..], &values),
        audit(id, &[], &values),
        audit(id, &planes, &wide),
    ] {
        harness.send(0, &wrong);
    }
    assert_eq!(harness.recorder.audits.len(), 1);
    let key = "audits of another model or size";
    assert_eq!(harness.figure("device", key), "4");
}

#[test]
fn without_the_devices_model_no_audit_is_compared() {
    let mut harness = Harness::connected(AUDIT, Board::of_another_model());
    let values = CodeValues::int8(&[5; NUMBERS]);
    harness.send(0, &audit([9; 8], &[0; 1440], &values));
    assert!(harness.recorder.audits.is_empty());
}
