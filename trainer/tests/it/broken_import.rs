//! Tests of files that cannot be imported: each message states the mistake, its reason and a
//! remedy.

use super::Folder;
use super::export::{Exported, File, SPEC, export, write};
use super::import::{IMPORT, network};
use safetensors::Dtype;

/// Exports a network, changes its tensors by `edit` and the bytes of the file by `damage`, and
/// imports the file with the specification `spec`. The import must fail; returns its error message.
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

/// Sets an element of a tensor of 32-bit floats in a file.
fn set(file: &mut File, name: &str, element: usize, value: f32) {
    let bytes = &mut file.get_mut(name).expect("a tensor").bytes;
    bytes[4 * element..][..4].copy_from_slice(&value.to_le_bytes());
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
        set(file, "encoder.norm2.bias", 3, f32::NAN);
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

/// A change that a test makes to a file before the import.
type Edit<'a> = &'a dyn Fn(&mut File);

#[test]
fn a_file_that_cannot_be_calibrated_or_disagrees_with_its_reference() {
    let without_calibration = |file: &mut File| {
        file.remove("calibration.windows");
    };
    let without_windows = |file: &mut File| {
        for name in ["calibration.windows", "reference.windows"] {
            file.insert(name.to_owned(), Exported::f32(&[0, 1, 16, 10, 9], &[]));
        }
    };
    let with_a_value_in_an_empty_cell = |file: &mut File| {
        // Change the first cell of the second window; a window has 16 steps of 90 cells.
        set(file, "calibration.windows", 16 * 90, 1.0);
    };
    let of_another_network = |file: &mut File| {
        // The sixth number of the third code; a code has 128 numbers.
        set(file, "reference.codes", 2 * 128 + 5, 1e6);
    };
    let cases: [(Edit, &[&str]); 4] = [
        (
            &without_calibration,
            &[
                "calibration.windows is missing, expected with shape [N, 1, 16, 10, 9]: some hundred windows",
            ],
        ),
        (
            &without_windows,
            &[
                "calibration.windows has shape [0, 1, 16, 10, 9], expected [N, 1, 16, 10, 9]",
                "reference.windows has shape [0, 1, 16, 10, 9], expected [N, 1, 16, 10, 9]",
            ],
        ),
        (
            &with_a_value_in_an_empty_cell,
            &[
                "calibration.windows, window 1, has a value in row 0, column 0 (counted from 0), where the montage has no \
                 electrode; expected 0",
            ],
        ),
        (
            &of_another_network,
            &[
                "trainer: code 2 of the reference differs by 1.0",
                "in element 5, more than 2e-3 of the RMS of all codes",
                "training mode instead of `eval()`",
            ],
        ),
    ];
    for (edit, expected) in cases {
        let message = edited(edit);
        for words in expected {
            assert!(message.contains(words), "{words}: {message}");
        }
    }
}

#[test]
fn specifications_with_a_wrong_field_montage_name_or_mode() {
    for (spec, expected) in [
        (SPEC.replace("sd_uv", "sd"), "unknown field `sd`"),
        (SPEC.replace("sd_uv", "sd"), "docs/importing.md has an example"),
        (SPEC.replace("ten-ten-61", "nowhere"), "cannot read the montage"),
        (SPEC.replace("\"shortcut\"", "\"paper\""), "paper-code-only"),
        (
            format!("{SPEC}[names]\n\"encoder.conv9\" = \"x\"\n"),
            "[names] has encoder.conv9, which is no tensor or layer of a model of this mode",
        ),
        (SPEC.replace("47.5", "-1.0"), "sd_uv"),
    ] {
        let message = refusal(&spec, |_| {}, |_| {});
        assert!(message.contains(expected), "{expected}: {message}");
    }
}
