//! Files that cannot be imported: each message says what, why and what to do next.

use super::Folder;
use super::export::{Exported, File, SPEC, export, write};
use super::import::{IMPORT, network};
use safetensors::Dtype;

/// Imports a file and a specification after a change; returns the message.
fn refusal(spec: &str, edit: impl FnOnce(&mut File), damage: impl FnOnce(&mut Vec<u8>)) -> String {
    let folder = Folder::new();
    let mut file = export(&network());
    edit(&mut file);
    write(&folder, &file, spec);
    let path = folder.path("network.safetensors");
    let mut bytes = std::fs::read(&path).expect("the file");
    damage(&mut bytes);
    std::fs::write(&path, bytes).expect("the file");
    let error = folder.fail(IMPORT, 2);
    assert!(!folder.path("model").exists(), "{error}");
    error
}

fn edited(edit: impl FnOnce(&mut File)) -> String {
    refusal(SPEC, edit, |_| {})
}

#[test]
fn a_truncated_file() {
    let message = refusal(SPEC, |_| {}, |bytes| bytes.truncate(bytes.len() / 2));
    assert!(
        message.starts_with(
            "trainer: network.safetensors is damaged or no safetensors file; export it again, with \
             `safetensors.torch.save_file`"
        ),
        "{message}"
    );
}

#[test]
fn wrong_names_shapes_element_types_and_values_are_listed_at_once() {
    let message = edited(|file| {
        let renamed = file.remove("encoder.conv1.weight").expect("a tensor");
        file.insert("features.0.weight".to_owned(), renamed);
        let zeros = Exported::f32(&[128, 1024], &vec![0.0; 128 * 1024]);
        file.insert("encoder.fc.weight".to_owned(), zeros);
        let half = file.get_mut("decoder.fc.bias").expect("a tensor");
        half.dtype = Dtype::F16;
        half.bytes.truncate(half.bytes.len() / 2);
        let diverged = file.get_mut("encoder.norm2.bias").expect("a tensor");
        diverged.bytes[12..16].copy_from_slice(&f32::NAN.to_le_bytes());
        file.remove("reference.codes");
    });
    assert_eq!(
        message,
        "\
trainer: network.safetensors and network.toml do not fit together:
  encoder.conv1.weight is missing, expected with shape [16, 1, 3, 3, 3]; features.0.weight of the file has this shape: \
if it is the same tensor, add it to [names]
  encoder.norm2.bias, element 3, is NaN, expected a finite number; the training diverged
  encoder.fc.weight has shape [128, 1024], expected [128, 1152]
  decoder.fc.bias has elements of type F16, expected F32 or F64; export `model.float()`
  reference.codes is missing; reference.windows and reference.codes are checked together
  features.0.weight is no part of a model of this mode; rename it in [names], or leave it out of the file
"
    );
}

#[test]
fn a_file_without_calibration() {
    let message = edited(|file| {
        file.remove("calibration.windows");
    });
    assert!(
        message.contains("calibration.windows is missing, expected with shape [N, 1, 16, 10, 9]: some hundred windows"),
        "{message}"
    );
}

#[test]
fn a_batch_without_windows() {
    let message = edited(|file| {
        for name in ["calibration.windows", "reference.windows"] {
            file.insert(name.to_owned(), Exported::f32(&[0, 1, 16, 10, 9], &[]));
        }
    });
    for name in ["calibration.windows", "reference.windows"] {
        let words = format!("{name} has shape [0, 1, 16, 10, 9], expected [N, 1, 16, 10, 9]");
        assert!(message.contains(&words), "{message}");
    }
}

#[test]
fn a_value_where_the_montage_has_no_electrode() {
    let message = edited(|file| {
        let windows = file.get_mut("calibration.windows").expect("a tensor");
        // The second window's first cell, which is empty.
        let at = 4 * 16 * 90;
        windows.bytes[at..at + 4].copy_from_slice(&1.0_f32.to_le_bytes());
    });
    assert!(
        message.contains(
            "calibration.windows, window 1, has a value in row 0, column 0 (counted from 0), where the montage has no \
             electrode; expected 0"
        ),
        "{message}"
    );
}

#[test]
fn a_reference_of_another_network() {
    let message = edited(|file| {
        let codes = file.get_mut("reference.codes").expect("a tensor");
        // The third window's sixth number.
        let at = 4 * (2 * 128 + 5);
        codes.bytes[at..at + 4].copy_from_slice(&1e6_f32.to_le_bytes());
    });
    assert!(
        message.starts_with("trainer: code 2 of the reference differs by 1.0"),
        "{message}"
    );
    assert!(
        message.contains("in element 5, more than 2e-3 of the RMS of all codes"),
        "{message}"
    );
    assert!(
        message.contains("training mode instead of `eval()`"),
        "{message}"
    );
}

#[test]
fn specifications_with_a_wrong_field_montage_name_or_mode() {
    let wrong = |spec: &str| refusal(spec, |_| {}, |_| {});
    let field = wrong(&SPEC.replace("sd_uv", "sd"));
    assert!(field.contains("unknown field `sd`"), "{field}");
    assert!(
        field.contains("docs/importing.md has an example"),
        "{field}"
    );
    let montage = wrong(&SPEC.replace("ten-ten-61", "nowhere"));
    assert!(montage.contains("cannot read the montage"), "{montage}");
    let mode = wrong(&SPEC.replace("\"shortcut\"", "\"paper\""));
    assert!(mode.contains("paper-code-only"), "{mode}");
    let name = wrong(&format!("{SPEC}[names]\n\"encoder.conv9\" = \"x\"\n"));
    assert!(
        name.contains(
            "[names] has encoder.conv9, which is no tensor or layer of a model of this mode"
        ),
        "{name}"
    );
    let scale = wrong(&SPEC.replace("47.5", "-1.0"));
    assert!(scale.contains("sd_uv"), "{scale}");
}
