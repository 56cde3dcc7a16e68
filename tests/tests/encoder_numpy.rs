//! The streaming encoder gives the codes that numpy computes from the integer model, byte for byte.
//!
//! `encoder_numpy.py` beside this file is the other implementation: it shares no line with ours, only
//! the integers that model-gen made of the trained weights, in PyTorch's order.
#![forbid(unsafe_code)]

use std::fs;
use std::path::Path;
use std::process::Command;

use acceptance::{real_data, skip::skipped, workspace};
use artifact::Artifact;
use bench::{hop, stress::Stress};
use host_sim::synthetic::{Generator, SyntheticSpec};
use model::{CODE, HOP, STEPS};
use model_gen::IntegerModel;
use pipeline::{Acquisition, Encoder, Mains, Plane, Sample, Step};

/// Debian's own Python: another one may have no numpy.
const PYTHON: &str = "/usr/bin/python3";

/// Windows over all inputs, unless `CORTICODE_WINDOWS` asks for more.
const WINDOWS: usize = 1_000;

#[test]
fn numpy_computes_the_codes_of_the_streaming_encoder() {
    let test = "codes against numpy";
    if !numpy_is_there(test) {
        return;
    }
    let inputs = inputs(test);
    let codes: Vec<[i8; CODE]> = inputs.iter().flat_map(|planes| streamed(planes)).collect();

    let folder = tempfile::tempdir().expect("a folder");
    let root = workspace::root();
    let artifact = Artifact::read(&root.join("model/artifact")).expect("the artifact");
    let model = model_gen::quantise(&artifact).expect("an integer model");
    write_model(folder.path(), &model);
    let windows = inputs
        .iter()
        .flat_map(|planes| planes.windows(STEPS).step_by(HOP));
    let cells = windows.clone().flatten().flatten();
    write(folder.path(), "windows", cells.copied());
    assert_eq!(windows.count(), codes.len());

    let output = Command::new(PYTHON)
        .arg(root.join("tests/tests/encoder_numpy.py"))
        .arg(folder.path())
        .output()
        .expect("Python starts");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    let bytes = fs::read(folder.path().join("codes.i8")).expect("numpy's codes");
    let theirs = bytes.as_chunks::<CODE>().0;
    let pairs = codes.iter().zip(theirs);
    let different = pairs.filter(|(ours, theirs)| ours.map(i8::cast_unsigned) != **theirs);
    let different = different.count();
    println!(
        "{} windows, {different} different; {}",
        codes.len(),
        String::from_utf8_lossy(&output.stdout).trim()
    );
    assert_eq!((theirs.len(), different), (codes.len(), 0));
    // Silence repeats itself, everything else does not.
    let changes = codes.windows(2).filter(|pair| pair[0] != pair[1]).count();
    assert!(changes > codes.len() / 2, "{changes} of {}", codes.len());
}

/// Whether there is a numpy; says loudly that `test` is skipped when there is not.
///
/// # Panics
/// When there is none and `CORTICODE_REQUIRE_ROS=1`, as in CI.
fn numpy_is_there(test: &str) -> bool {
    let asked = Command::new(PYTHON).args(["-c", "import numpy"]).output();
    if asked.is_ok_and(|output| output.status.success()) {
        return true;
    }
    let why = format!("{PYTHON} has no numpy; `apt-get install python3-numpy`");
    let required = std::env::var("CORTICODE_REQUIRE_ROS").is_ok_and(|value| value == "1");
    assert!(!required, "{test}: CORTICODE_REQUIRE_ROS=1, and {why}");
    skipped(test, &why);
    false
}

/// Planes that no head makes, synthetic EEG, and real EEG where there is some.
fn inputs(test: &str) -> Vec<Vec<Plane>> {
    let asked = std::env::var("CORTICODE_WINDOWS").ok();
    let windows = asked.map_or(WINDOWS, |text| text.parse().expect("a number of windows"));
    let real = real_data::path(test, real_data::EDF_R12);
    let count = Stress::ALL.len() + 1 + usize::from(real.is_some());
    let steps = hop::steps(windows.div_ceil(count));

    let electrodes: Vec<&str> = model::LABELS.split(' ').collect();
    let stress = Stress::ALL.map(|stress| stress.planes().take(steps).collect());
    let mut inputs: Vec<Vec<Plane>> = stress.to_vec();
    let generator = Generator::new(&SyntheticSpec::new(5, electrodes.iter().copied()));
    let synthetic = generator
        .expect("a generator")
        .map(|counts| Sample { counts });
    inputs.push(acquired(Mains::Hz50, synthetic, steps));
    if let Some(path) = real {
        let samples = real_data::samples(&path, &electrodes).expect("samples");
        let samples = samples.map(|sample| sample.expect("a whole recording"));
        inputs.push(acquired(Mains::Hz60, samples, steps));
    }
    assert!(inputs.iter().all(|planes| planes.len() == steps));
    inputs
}

fn acquired(mains: Mains, samples: impl Iterator<Item = Sample>, steps: usize) -> Vec<Plane> {
    let mut acquisition = Acquisition::new(mains);
    samples
        .filter_map(|sample| acquisition.push(&sample))
        .map(|step| step.plane)
        .take(steps)
        .collect()
}

fn streamed(planes: &[Plane]) -> Vec<[i8; CODE]> {
    let mut encoder = Encoder::new();
    let steps = planes.iter().map(|&plane| Step {
        plane,
        ..Step::default()
    });
    steps
        .filter_map(|step| encoder.push(&step))
        .map(|code| code.values)
        .collect()
}

fn write_model(folder: &Path, model: &IntegerModel) {
    for (name, conv) in [("conv1", &model.conv1), ("conv2", &model.conv2)] {
        write(folder, &format!("{name}.weights"), conv.weights.clone());
        write(folder, &format!("{name}.bias"), conv.bias.clone());
        write(
            folder,
            &format!("{name}.multipliers"),
            conv.multipliers.clone(),
        );
    }
    for (name, linear) in [("fc", &model.fc), ("shortcut", &model.shortcut)] {
        write(folder, &format!("{name}.weights"), linear.weights.clone());
        write(
            folder,
            &format!("{name}.multipliers"),
            linear.multipliers.clone(),
        );
    }
    write(folder, "fc.bias", model.fc_bias);
    write(folder, "cells", model.cells);
    write(folder, "zero_point", model.code_zero_point);
}

/// Integers of any width as 64 bits, little endian.
fn write(folder: &Path, name: &str, values: impl IntoIterator<Item: Into<i64>>) {
    let values = values.into_iter().map(Into::<i64>::into);
    let bytes: Vec<u8> = values.flat_map(i64::to_le_bytes).collect();
    fs::write(folder.join(format!("{name}.i64")), bytes).expect("the folder is writable");
}
