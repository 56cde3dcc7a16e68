//! The program, as a user runs it, on small synthetic recordings.
#![forbid(unsafe_code)]

#[path = "program/crossval.rs"]
mod crossval;
#[path = "program/evaluate.rs"]
mod evaluate;
#[path = "program/packed.rs"]
mod packed;
#[path = "program/picture_file.rs"]
mod picture_file;
#[path = "program/report.rs"]
mod report;
#[path = "program/train.rs"]
mod train;
#[path = "program/values.rs"]
mod values;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use recordings::{FileToWrite, GdfWriter, SignalToWrite};
use std::fs::File;
use std::path::Path;
use std::process::{Command, Output};

/// Electrodes of `files/montages/cyton-8.toml`.
const LABELS: [&str; 8] = ["Fp1", "Fp2", "C3", "C4", "P7", "P8", "O1", "O2"];

/// Writes a GDF file of these electrodes at 250 Hz: three low-pass-filtered sources and noise.
fn write_recording(path: &Path, labels: &[&str], seconds: u32, seed: u64) {
    let signal = |label: &&str| SignalToWrite {
        label: (*label).to_owned(),
        is_microvolt: true,
        is_integer: false,
        range: [-1e4, 1e4],
    };
    let file = FileToWrite {
        signals: labels.iter().map(signal).collect(),
        rate_hz: 250,
        rows_per_record: 250,
        start_ns: 0,
        description: "synthetic".to_owned(),
    };
    let mut writer =
        GdfWriter::new(File::create(path).expect("a new file"), &file).expect("a header");
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut sources = [0.0_f32; 3];
    for _ in 0..seconds {
        let mut rows = Vec::new();
        for _ in 0..250 {
            for source in &mut sources {
                *source = 0.95 * *source + rng.random_range(-20.0..20.0);
            }
            rows.extend((0..labels.len()).map(|at| {
                sources[at % 3] + 0.5 * sources[(at + 1) % 3] + rng.random_range(-5.0..5.0)
            }));
        }
        writer.write_record(&rows).expect("a record");
    }
    writer.finish(&[]).expect("no events");
}

/// Writes `run1.gdf`, `run2.gdf`, ... into a folder.
fn write_runs(folder: &Path, runs: u64, seconds: u32) {
    for run in 1..=runs {
        write_recording(&folder.join(format!("run{run}.gdf")), &LABELS, seconds, run);
    }
}

/// Returns the program with the montage and a small model of a mode.
fn trainer(verb: &str, mode: &str, folder: &Path) -> Command {
    let montage = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../files/montages/cyton-8.toml"
    );
    let mut command = Command::new(env!("CARGO_BIN_EXE_trainer"));
    command
        .args([verb, "--mains=50", "--numbers=16", "--padding=space"])
        .args(["--mode", mode, "--montage", montage, "--data"])
        .arg(folder)
        .current_dir(folder);
    command
}

/// Runs a command that must succeed; returns what it prints to standard output.
fn succeed(command: &mut Command) -> String {
    let output = command.output().expect("the program starts");
    assert!(output.status.success(), "{}", log(&output));
    String::from_utf8(output.stdout).expect("text")
}

/// Runs a command that must end with this status; returns what it prints to standard error.
fn fail(command: &mut Command, status: i32) -> String {
    let output = command.output().expect("the program starts");
    assert_eq!(output.status.code(), Some(status), "{}", log(&output));
    log(&output)
}

fn log(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}
