//! A model with the packed code alone builds, streams the blocks of the batch reference, and host-sim encodes and
//! decodes recordings with it.
#![forbid(unsafe_code)]

use std::fs::{self, File};
use std::path::Path;
use std::process::{Command, Output};

use acceptance::{other_model, workspace};
use any_model::any_packed_alone;
use artifact::{Artifact, MontageFile};
use recordings::{FileToWrite, GdfWriter, SignalToWrite};

const SEED: u32 = 7;
const SECONDS: u32 = 6;

/// Returns a model of `files/montages/cyton-8.toml` with random integers.
fn model() -> Artifact {
    let montage = MontageFile::read(&workspace::root().join("files/montages/cyton-8.toml"));
    any_packed_alone(SEED, &montage.expect("the montage")).expect("a model")
}

/// Writes a recording of the model's electrodes at the rate of its ADC: noise of 20 uV.
fn write_recording(path: &Path, model: &Artifact) {
    let labels = &model.description.montage.electrodes;
    let rate_hz = model.description.adc.rate_hz;
    let signals = labels.iter().map(|label| SignalToWrite {
        label: label.clone(),
        is_microvolt: true,
        is_integer: false,
        range: [-1e4, 1e4],
    });
    let file = FileToWrite {
        signals: signals.collect(),
        rate_hz,
        rows_per_record: rate_hz,
        start_ns: 0,
        description: "noise".to_owned(),
    };
    let writer = GdfWriter::new(File::create(path).expect("a file"), &file);
    let mut writer = writer.expect("a header");
    let mut state = SEED;
    for _ in 0..SECONDS {
        let count = labels.len() * usize::try_from(rate_hz).expect("a rate");
        let mut noise = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f32::from(i16::try_from(state.cast_signed() >> 16).expect("16 bits")) / 1_638.0
        };
        let rows: Vec<f32> = (0..count).map(|_| noise()).collect();
        writer.write_record(&rows).expect("a record");
    }
    writer.finish(&[]).expect("no events");
}

fn succeed(command: &mut Command) -> String {
    let Output {
        status,
        stdout,
        stderr,
    } = command.output().expect("the program starts");
    let stderr = String::from_utf8_lossy(&stderr);
    assert!(status.success(), "{command:?}: {stderr}");
    assert!(!stderr.contains("warning: unused"), "{stderr}");
    format!("{}{stderr}", String::from_utf8_lossy(&stdout))
}

#[test]
fn a_model_without_a_network_encodes_and_decodes_recordings() {
    let model = model();
    let folder = tempfile::tempdir().expect("a folder");
    let artifact = folder.path().join("model");
    model.write(&artifact).expect("a folder to write to");
    for (package, test) in [
        ("pipeline", "packed_equals_batch"),
        ("device", "a_device_offers"),
        ("device", "audits_reach_the_host"),
        ("device", "blocks_of_repeated_steps"),
    ] {
        let mut cargo = other_model::cargo(&artifact);
        cargo.args(["test", "--package", package]);
        let tested = match package {
            "pipeline" => succeed(cargo.args(["--test", test])),
            _ => succeed(cargo.args(["--lib", test])),
        };
        assert!(!tested.contains("0 passed"), "{tested}");
    }
    succeed(other_model::cargo(&artifact).args(["build", "--bin", "host-sim"]));
    write_recording(&folder.path().join("in.gdf"), &model);
    let host_sim = |arguments: &[&str]| {
        let mut program = Command::new(other_model::target().join("debug/host-sim"));
        program.current_dir(folder.path()).args(arguments);
        program
    };
    let run = "run --input synthetic --output file:run.bin --duration 2";
    let made = succeed(&mut host_sim(&run.split(' ').collect::<Vec<_>>()));
    assert!(made.contains("packed blocks made"), "{made}");
    let refused = host_sim(&["encode", "in.gdf", "out.codes", "--stream=codes"]).output();
    let refused = refused.expect("host-sim starts");
    let stderr = String::from_utf8_lossy(&refused.stderr);
    assert!(
        !refused.status.success() && stderr.contains("has no network"),
        "{stderr}"
    );
    // Packed blocks are the default.
    let encoded = succeed(&mut host_sim(&["encode", "in.gdf", "out.codes"]));
    assert!(encoded.contains("packed blocks"), "{encoded}");
    succeed(&mut host_sim(&[
        "decode",
        "out.codes",
        "out.csv",
        "--to",
        "csv",
    ]));
    let text = fs::read_to_string(folder.path().join("out.csv")).expect("text");
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let header = lines.next().expect("a header");
    for electrode in &model.description.montage.electrodes {
        assert!(header.contains(electrode.as_str()), "{electrode}: {header}");
    }
    let steps = SECONDS * model.description.window.rate_hz;
    assert_eq!(lines.count(), usize::try_from(steps).expect("few"));
}
