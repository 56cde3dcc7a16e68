//! Tests of `trainer show`, `trainer diff` and `trainer check`.

use super::{Folder, assert_has, json};
use any_model::{MONTAGES, any_packed_alone};
use artifact::MontageFile;
use serde_json::Value as Json;
use std::fs;
use std::path::Path;

/// Returns a folder with two copies of the built-in model, `built-in` and `changed`, and a copy of
/// the model with the paper's montage, `paper`.
fn models() -> Folder {
    let folder = Folder::new();
    let models = concat!(env!("CARGO_MANIFEST_DIR"), "/../signal/model");
    for (from, to) in [("artifact", "built-in"), ("artifact", "changed"), ("paper", "paper")] {
        let (from, to) = (Path::new(models).join(from), folder.path(to));
        fs::create_dir(&to).expect("a folder");
        for file in fs::read_dir(from).expect("a folder") {
            let path = file.expect("a file").path();
            fs::copy(&path, to.join(path.file_name().expect("a name"))).expect("a copy");
        }
    }
    folder
}

#[test]
fn show_prints_grid_card_and_integers() {
    let folder = models();
    let printed = folder.succeed("show built-in");
    assert_has(
        &printed,
        &[
            "shortcut mode, decoded from the code alone",
            "a code of 128 numbers (int8-exponent) and a packed block of 218 bits (rate 4) every 62.5 ms",
            "bad electrodes are substituted; NMSE",
            "  F7   F5   F3",
            "61 recorded, 0 interpolated",
            "worst accumulator",
        ],
    );
    let object = folder.json("show built-in --json");
    assert_eq!(object["weights"]["encoder.conv1.weight"], json("[16, 1, 3, 3, 3]"));
    assert_eq!(object["decodable"], true);
    assert_eq!(object["description"]["adc"]["rate_hz"], 512);
    assert!(object["encoder"][0]["flash_bytes"].as_u64() > Some(0));
}

#[test]
fn diff_is_0_for_equal_models_1_for_others_and_2_for_none() {
    let folder = models();
    let [equal, _] = folder.run("diff built-in built-in", 0);
    assert!(equal.starts_with("the models are equal: "), "{equal}");
    let [other, _] = folder.run("diff built-in paper", 1);
    assert!(other.contains("montage.electrodes: "), "{other}");
    assert_has(&other, &["weights: encoder.conv1.weight: 432 of 432 elements differ, by at most"]);
    let [_, none] = folder.run("diff built-in /nowhere", 2);
    assert!(none.contains("/nowhere holds no usable model"), "{none}");
    let path = folder.path("changed/model.toml");
    let toml = fs::read_to_string(&path).expect("a description");
    fs::write(&path, toml.replace("notch_q = 30.0", "notch_q = 35.0")).expect("a description");
    let [one_field, _] = folder.run("diff built-in changed --json", 1);
    let one_field = json(&one_field);
    assert_eq!(
        one_field["fields"],
        json(r#"[{"field": "filters.notch_q", "values": ["30.0", "35.0"]}]"#)
    );
    assert_eq!(one_field["tensors"], json("[]"));
    assert_eq!(one_field["parts"], json("[]"));
}

#[test]
fn diff_finds_a_packed_model_and_golden_codes_that_are_missing_or_differ() {
    let folder = models();
    let path = folder.path("changed/packed.toml");
    let toml = fs::read_to_string(&path).expect("a description");
    fs::write(&path, toml.replacen("\nrate = 4\n", "\nrate = 5\n", 1)).expect("a description");
    let [rate, _] = folder.run("diff built-in changed --json", 1);
    let rate = json(&rate);
    assert_eq!(rate["fields"], json(r#"[{"field": "packed.rate", "values": ["4", "5"]}]"#));
    assert_eq!(rate["parts"], json("[]"));
    let golden = folder.path("changed/golden.safetensors");
    let half = fs::read(&golden).expect("golden codes")[..100].to_vec();
    for file in [&path, &folder.path("changed/packed.safetensors"), &golden] {
        fs::remove_file(file).expect("a file");
    }
    let [missing, _] = folder.run("diff built-in changed", 1);
    assert_has(&missing, &["packed models differ", "golden codes differ"]);
    fs::write(&golden, half).expect("a file");
    let [_, damaged] = folder.run("diff built-in changed", 2);
    assert_has(&damaged, &["golden.safetensors is damaged"]);
}

#[test]
fn check_is_0_for_a_sound_model_1_for_other_golden_codes_and_2_for_a_damaged_one() {
    let folder = models();
    let sound = folder.succeed("check built-in");
    assert_has(&sound, &["28 golden codes equal the integer encoder's"]);
    let object = folder.json("check built-in --json");
    assert_eq!(object["golden_wrong"], json("[]"));
    assert_eq!(object["real_electrodes"], 61);

    // The file ends with a window of 16 * 90 values. Changing a value in its middle changes its
    // code.
    let golden = folder.path("changed/golden.safetensors");
    let mut bytes = fs::read(&golden).expect("golden codes");
    let at = bytes.len() - 16 * 90 / 2;
    bytes[at] ^= 0x40;
    fs::write(&golden, bytes).expect("golden codes");
    let [wrong, _] = folder.run("check changed", 1);
    assert!(wrong.contains("1 of 28 golden codes differ"), "{wrong}");
    let weights = folder.path("changed/weights.safetensors");
    fs::write(&weights, &fs::read(&weights).expect("weights")[..1000]).expect("weights");
    let [_, damaged] = folder.run("check changed", 2);
    assert_has(&damaged, &["weights.safetensors is damaged"]);
}

#[test]
fn a_model_without_a_network_is_shown_and_sound_without_golden_codes() {
    let montage = MontageFile::read(&Path::new(MONTAGES).join("cyton-8.toml"));
    let model = any_packed_alone(1, &montage.expect("a montage")).expect("a model");
    let folder = Folder::new();
    let written = model.write(&folder.path("changed"));
    written.expect("a folder to write to");
    let [shown, _] = folder.run("show changed", 0);
    assert!(
        shown.starts_with(
            "packed mode, no network\n8 electrodes, a packed block (rate 4) every 62.5 ms"
        ),
        "{shown}"
    );
    let object = folder.json("show changed --json");
    assert_eq!(object["decodable"], Json::Null);
    assert_eq!(object["packed"]["rate"], 4);
    let [sound, _] = folder.run("check changed", 0);
    assert!(sound.contains("no golden codes"), "{sound}");
    let object = folder.json("check changed --json");
    assert_eq!(object.get("golden_windows"), None, "{object}");
}
