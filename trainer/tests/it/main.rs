//! Tests of the program as a user runs it, on small synthetic recordings and random networks.
#![forbid(unsafe_code)]

mod broken_import;
mod classify;
mod crossval;
mod export;
mod files;
mod import;
mod models;
mod montage;
mod packed;
mod people;
mod report;
mod substitution;
mod train;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use recordings::{FileToWrite, GdfWriter, SignalToWrite};
use serde_json::Value as Json;
use std::fs::{self, File};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use tempfile::TempDir;

/// Labels of the electrodes in `files/montages/cyton-8.toml`.
const LABELS: [&str; 8] = ["Fp1", "Fp2", "C3", "C4", "P7", "P8", "O1", "O2"];

/// Options of a small model whose electrodes are [`LABELS`], with recordings in the program's
/// working directory.
const SMALL: &str = "--mains=50 --numbers=16 --padding=space --montage=cyton-8.toml --data=.";

/// A temporary folder in which the program runs, with a copy of the montage file `cyton-8.toml`.
struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        let folder = Self(tempfile::tempdir().expect("a folder"));
        let montage = Path::new(any_model::MONTAGES).join("cyton-8.toml");
        fs::copy(montage, folder.path("cyton-8.toml")).expect("a montage");
        folder
    }

    /// Returns a folder with `runs` recordings `run1.gdf`, `run2.gdf`, ..., of `seconds` seconds.
    fn with_runs(runs: u64, seconds: u32) -> Self {
        let folder = Self::new();
        for run in 1..=runs {
            folder.write_recording(&format!("run{run}.gdf"), &LABELS, seconds, run);
        }
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    fn write(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).expect("a file");
    }

    /// Returns the command that runs the program in the folder; `arguments` are separated by
    /// spaces.
    fn command(&self, arguments: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_trainer"));
        command.args(arguments.split_whitespace()).current_dir(&self.0);
        command
    }

    /// Runs the program, which must exit with status `status`; returns stdout and stderr.
    fn run(&self, arguments: &str, status: i32) -> [String; 2] {
        let output = self.command(arguments).output().expect("the program");
        let [out, err] =
            [output.stdout, output.stderr].map(|text| String::from_utf8(text).expect("text"));
        assert_eq!(output.status.code(), Some(status), "{arguments}: {out}{err}");
        [out, err]
    }

    /// Runs the program, which must succeed; returns what it prints to standard output.
    fn succeed(&self, arguments: &str) -> String {
        let [out, _] = self.run(arguments, 0);
        out
    }

    /// Runs the program, which must succeed and print JSON; returns the JSON.
    fn json(&self, arguments: &str) -> Json {
        json(&self.succeed(arguments))
    }

    /// Runs the program, which must exit with status `status`; returns its standard error.
    fn fail(&self, arguments: &str, status: i32) -> String {
        let [_, err] = self.run(arguments, status);
        err
    }

    /// Trains a small model of a mode, in the folder `model` unless the arguments name another
    /// folder.
    fn train(&self, mode: &str, arguments: &str) -> String {
        self.succeed(&format!("train {SMALL} --mode={mode} --out=model {arguments}"))
    }

    /// Writes a GDF file of `labels` at 250 Hz: three low-pass-filtered sources, mixed, plus noise.
    fn write_recording(&self, name: &str, labels: &[&str], seconds: u32, seed: u64) {
        let mix = |at: usize, sources: [f32; 3]| sources[at % 3] + 0.5 * sources[(at + 1) % 3];
        write_gdf(&self.path(name), labels, (250, seconds), (seed, 5.0), mix, &[]);
    }
}

/// Writes a GDF file of `seconds` seconds: for each electrode index, `mix` mixes three
/// low-pass-filtered sources, and noise of the given amplitude is added. `events` are pairs of
/// sample index (from 0) and GDF event type.
fn write_gdf(
    path: &Path,
    labels: &[impl AsRef<str>],
    (rate_hz, seconds): (u32, u32),
    (seed, noise): (u64, f32),
    mut mix: impl FnMut(usize, [f32; 3]) -> f32,
    events: &[(u64, u16)],
) {
    let signal = |label: &_| SignalToWrite {
        label: AsRef::<str>::as_ref(label).to_owned(),
        is_microvolt: true,
        is_integer: false,
        range: [-1e4, 1e4],
    };
    let header = FileToWrite {
        signals: labels.iter().map(signal).collect(),
        rate_hz,
        rows_per_record: rate_hz,
        start_ns: None,
        description: "synthetic".to_owned(),
    };
    let file = File::create(path).expect("a new file");
    let mut writer = GdfWriter::new(file, &header).expect("a header");
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut sources = [0.0_f32; 3];
    for _ in 0..seconds {
        let mut rows = Vec::new();
        for _ in 0..rate_hz {
            for source in &mut sources {
                *source = 0.95 * *source + rng.random_range(-20.0..20.0);
            }
            let electrodes = 0..labels.len();
            rows.extend(electrodes.map(|at| mix(at, sources) + rng.random_range(-noise..noise)));
        }
        writer.write_record(&rows).expect("a record");
    }
    writer.finish(events).expect("an event table");
}

/// Asserts that a text contains all `words`.
#[track_caller]
fn assert_has(text: &str, words: &[&str]) {
    for words in words {
        assert!(text.contains(words), "{words} is not in\n{text}");
    }
}

fn json(text: &str) -> Json {
    serde_json::from_str(text).expect("JSON")
}

/// Reports a skipped test on standard error directly, because the test harness captures print
/// macros.
fn skip(test: &str, why: &str) {
    let line = format!("SKIPPED: {test}: {why}\n");
    let _ = std::io::stderr().write_all(line.as_bytes());
}
