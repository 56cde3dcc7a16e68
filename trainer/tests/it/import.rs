//! Tests of files that can be imported. If PyTorch is installed, one test imports the files written
//! by the program in docs/importing.md.

use super::export::{self, SPEC, WINDOWS, export, insert_all, write};
use super::{Folder, assert_has, skip};
use any_model::{any_artifact, quantised, windows};
use artifact::{Artifact, FloatEncoder, Mode, Padding, Tensors};
use safetensors::Dtype;
use std::process::Command;

/// Returns a random network of the built-in model's shape.
pub(crate) fn network() -> Artifact {
    any_artifact(5, Mode::Shortcut, Padding::None, [2, 2, 2], 8).expect("a model")
}

/// Command that imports `network.safetensors` with the specification `network.toml`.
pub(crate) const IMPORT: &str =
    "import --safetensors=network.safetensors --spec=network.toml --out=model";

/// Exports a network, changes the file by `edit`, and imports it. Returns the imported artifact and
/// the program's output.
fn import(
    folder: &Folder,
    network: &Artifact,
    spec: &str,
    edit: impl FnOnce(&mut export::File),
) -> (Artifact, String) {
    let mut file = export(network);
    edit(&mut file);
    write(folder, &file, spec);
    let printed = folder.succeed(IMPORT);
    folder.succeed("check model");
    let model = Artifact::read(&folder.path("model"));
    (model.expect("a model"), printed)
}

/// Returns the error of the integer codes relative to the float codes, as a ratio of their RMS
/// values, on windows other than the calibration windows.
fn relative_code_error(model: &Artifact) -> f64 {
    let integers = model_gen::quantise(model).expect("integers");
    let encoder = FloatEncoder::new(model).expect("an encoder");
    let (mut error, mut energy) = (0.0, 0.0);
    for window in windows(3, model, WINDOWS) {
        let code = integers.encode_window(&quantised(model, &integers, &window));
        for (integer, float) in integers.dequantise(&code).iter().zip(encoder.encode(&window)) {
            error += f64::from(integer - float).powi(2);
            energy += f64::from(float).powi(2);
        }
    }
    (error / energy).sqrt()
}

fn values<'t>(tensors: &'t Tensors, name: &str) -> &'t [f32] {
    let shapes: Vec<_> = tensors.shapes().collect();
    let (_, shape) = shapes.iter().find(|(found, _)| *found == name).expect("a tensor");
    tensors.tensor(name, shape).expect("its own shape")
}

#[test]
fn an_exported_network_is_imported_with_its_weights_and_codes() {
    let folder = Folder::new();
    let network = network();
    let (model, printed) = import(&folder, &network, SPEC, |_| {});
    assert_eq!(model.weights, network.weights);
    assert_has(&printed, &["The codes of 24 windows equal the exported network's within"]);
    assert_has(&printed, &["their reconstructions within"]);
    let card = &model.description.training;
    assert!(card.note.starts_with("Imported from network.safetensors, SHA-256 "), "{}", card.note);
    assert_eq!((card.optimiser.as_str(), card.dataset.as_str()), ("imported", "random"));
    // The bound is wide, because random networks amplify the rounding of their inputs more than
    // trained networks.
    let error = relative_code_error(&model);
    assert!(error < 0.05, "{error}");
}

#[test]
fn tensors_of_other_names_and_of_64_bits_are_imported_by_the_table_of_names() {
    let folder = Folder::new();
    let network = network();
    let spec = format!(
        "{SPEC}[names]\n\"encoder.conv1\" = \"features.0\"\n\"encoder.conv1.bias\" = \"b\"\n\
         \"encoder.fc.bias\" = \"to_code.offset\"\n"
    );
    let (model, _) = import(&folder, &network, &spec, |file| {
        for (from, to) in [
            ("encoder.conv1.weight", "features.0.weight"),
            // If several entries match a tensor or its layer, the longest entry applies.
            ("encoder.conv1.bias", "b"),
            ("encoder.fc.bias", "to_code.offset"),
        ] {
            let tensor = file.remove(from).expect("a tensor");
            file.insert(to.to_owned(), tensor);
        }
        let wide = file.get_mut("to_code.offset").expect("a tensor");
        let (words, _) = wide.bytes.as_chunks();
        wide.bytes = words
            .iter()
            .flat_map(|word| f64::from(f32::from_le_bytes(*word)).to_le_bytes())
            .collect();
        wide.dtype = Dtype::F64;
    });
    assert_eq!(model.weights, network.weights);
}

#[test]
fn ranges_can_replace_the_windows_of_the_calibration_and_no_reference_is_a_warning() {
    let folder = Folder::new();
    let network = network();
    let (model, printed) = import(&folder, &network, SPEC, |file| {
        file.retain(|name, _| !name.starts_with("calibration") && !name.starts_with("reference"));
        insert_all(file, "calibration.", &network.calibration);
    });
    assert_eq!(model.calibration, network.calibration);
    assert!(printed.starts_with("warning: the file has no reference.windows"), "{printed}");
    assert!(model.description.training.note.ends_with("Not compared with the exported network."));
}

#[test]
fn a_silent_channel_is_held_constant_and_reported() {
    let folder = Folder::new();
    let mut network = network();
    let channels = values(&network.weights, "encoder.norm2.running_var").len();
    for (name, value) in [("running_var", 0.0), ("running_mean", 0.0)] {
        let name = format!("encoder.norm2.{name}");
        let mut changed = values(&network.weights, &name).to_vec();
        changed[17] = value;
        network.weights.insert(&name, &[channels], changed);
    }
    let mut bias = values(&network.weights, "encoder.conv2.bias").to_vec();
    bias[17] = -1e3;
    network.weights.insert("encoder.conv2.bias", &[channels], bias);
    let (model, printed) = import(&folder, &network, SPEC, |_| {});
    assert_has(&printed, &["warning: 1 channels of the convolutions never vary"]);
    let held = values(&model.weights, "encoder.norm2.weight")[17];
    assert!(held.abs() < f32::EPSILON, "{held}");
}

#[test]
fn a_model_in_the_folder_is_replaced_by_force_only() {
    let folder = Folder::new();
    let network = network();
    let (before, _) = import(&folder, &network, SPEC, |_| {});
    let file = export(&network);
    write(&folder, &file, &SPEC.replace("47.5", "50.0"));
    let out = folder.path("model");
    let error = folder.fail(IMPORT, 2);
    assert_has(
        &error,
        &["holds a model already; choose another folder, or replace it with --force"],
    );
    assert_eq!(Artifact::read(&out).expect("a model"), before);
    folder.succeed(&format!("{IMPORT} --force"));
    assert_ne!(Artifact::read(&out).expect("a model").id, before.id);
}

/// The page that contains the Python program of a test.
const PAGE: &str = include_str!("../../../docs/importing.md");
/// Python interpreters; the first one that has PyTorch is used.
const PYTHONS: [&str; 2] = ["python3", "/usr/bin/python3"];

/// Returns the code block of [`PAGE`] that starts with the line `first_line`.
fn block(first_line: &str) -> &'static str {
    let (_, rest) = PAGE.split_once(&format!("{first_line}\n")).expect("a block of the page");
    rest.split_once("\n```").expect("the end of the block").0
}

#[test]
fn the_pages_program_exports_a_network_that_the_import_accepts() {
    let imports = |python: &&&str| {
        let mut command = Command::new(python);
        let output = command.args(["-c", "import torch, safetensors.torch"]).output();
        output.is_ok_and(|output| output.status.success())
    };
    let Some(python) = PYTHONS.iter().find(imports) else {
        let why = format!("neither {} imports torch and safetensors", PYTHONS.join(" nor "));
        skip("docs/importing.md", &why);
        return;
    };
    let folder = Folder::new();
    folder.write("network.py", block("# network.py"));
    let montages = format!("{}/", any_model::MONTAGES);
    let spec = block("# network.toml").replace("files/montages/", &montages);
    folder.write("network.toml", &spec);
    let mut command = Command::new(python);
    let output = command.arg("network.py").current_dir(folder.path("")).output();
    let output = output.expect("Python starts");
    let log = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{log}");
    let printed = folder.succeed(IMPORT);
    let words = "The codes of 16 windows equal the exported network's within";
    assert!(printed.contains(words), "{printed}");
    folder.succeed("check model");
    let model = Artifact::read(&folder.path("model")).expect("a model");
    assert_eq!(model.description.training.dataset, "noise, for the example");
}
