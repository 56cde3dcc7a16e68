//! Every file in `files/montages/`: its check, and a PCA model fitted to a synthetic recording.

use artifact::{Artifact, CodeFormat, Mode, MontageFile, Padding};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use recordings::{FileToWrite, GdfWriter, SignalToWrite};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::Command;
use trainer::card::Shape;
use trainer::comparison::Comparison;
use trainer::montage_check::MontageCheck;
use trainer::progress::{EpochReport, ProgressObserver};
use trainer::recording_check::RecordingCheck;
use trainer::session::{self, TrainOptions};
use trainer::training::Settings;

/// Number of independent signals in the synthetic recordings; a linear code can hold them all.
const SOURCES: usize = 3;

struct Silent;

impl ProgressObserver for Silent {
    fn message(&mut self, _: &str) {}
    fn epoch_started(&mut self, _: u32, _: u32, _: usize, _: usize) {}
    fn batch_finished(&mut self, _: usize, _: f64) {}
    fn epoch_finished(&mut self, _: EpochReport) {}
    fn is_interrupted(&self) -> bool {
        false
    }
}

fn montage(name: &str) -> MontageFile {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../files/montages");
    MontageFile::read(&folder.join(name)).expect("a montage")
}

/// Writes 16 s of mixed low-pass-filtered sources at 256 Hz.
fn write_recording(path: &Path, labels: &[String], seed: u64) {
    let signal = |label: &String| SignalToWrite {
        label: label.clone(),
        is_microvolt: true,
        is_integer: false,
        range: [-1e4, 1e4],
    };
    let file = FileToWrite {
        signals: labels.iter().map(signal).collect(),
        rate_hz: 256,
        rows_per_record: 256,
        start_ns: 0,
        description: "synthetic".to_owned(),
    };
    let mut writer =
        GdfWriter::new(File::create(path).expect("a new file"), &file).expect("a header");
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut weights = ChaCha8Rng::seed_from_u64(0);
    let mix: Vec<[f32; SOURCES]> = labels
        .iter()
        .map(|_| std::array::from_fn(|_| weights.random_range(-1.0..1.0)))
        .collect();
    let mut sources = [0.0_f32; SOURCES];
    for _ in 0..16 {
        let mut rows = Vec::new();
        for _ in 0..256 {
            for source in &mut sources {
                *source = 0.95 * *source + rng.random_range(-20.0..20.0);
            }
            rows.extend(mix.iter().map(|mix| -> f32 {
                let mixed: f32 = mix.iter().zip(sources).map(|(m, s)| m * s).sum();
                mixed + rng.random_range(-0.5..0.5)
            }));
        }
        writer.write_record(&rows).expect("one record");
    }
    writer.finish(&[]).expect("no events");
}

/// Fits a PCA model of 48 numbers in `folder`, and returns its figures.
fn fit(montage: MontageFile, folder: &Path) -> Comparison {
    let labels = montage.montage().electrodes;
    write_recording(&folder.join("R1.gdf"), &labels, 1);
    write_recording(&folder.join("R2.gdf"), &labels, 2);
    let options = TrainOptions {
        data: folder.to_owned(),
        train: vec!["R1".to_owned()],
        test: vec!["R2".to_owned()],
        montage,
        shape: Shape {
            mode: Mode::Pca,
            numbers: 48,
            steps: 16,
            hop: 8,
            padding: Padding::None,
            format: CodeFormat::Int8,
        },
        mains_hz: 50,
        dataset: "synthetic".to_owned(),
        citation: "none".to_owned(),
        settings: Settings {
            epochs: 0,
            batch: 1,
            peak_rate: 1e-3,
            seed: 1,
        },
        checkpoint: PathBuf::from("unused"),
        resume: false,
        force: false,
        out: folder.join("model"),
        report: None,
    };
    session::train(&options, &mut Silent)
        .expect("a model")
        .expect("a test recording")
}

/// Fits a model for the montage of a file in `files/montages/` and checks it.
fn check(name: &str) {
    let montage = montage(name);
    assert_eq!(MontageCheck::new(&montage).mistakes, []);
    let folder = tempfile::tempdir().expect("a folder");
    let Comparison { codes, .. } = fit(montage.clone(), folder.path());
    let network = codes.expect("a network").network;
    let model = Artifact::read(&folder.path().join("model")).expect("an artifact");
    assert_eq!(model.description.montage, montage.montage());
    assert_eq!(model.description.adc, montage.adc());
    let device = model_gen::DeviceModel::new(&model).expect("integers");
    assert_eq!(device.integers.code_scale.len(), 48);
    // Three sources in 16 steps span at most 48 dimensions, which 48 numbers hold; what is left is the
    // noise of each electrode, 0.3 uV. Measured: at most 0.7 %, and with int8 codes 3.0 %.
    assert!(network.float.prd_percent < 1.0, "{network:?}");
    assert!(network.integer.prd_percent < 5.0, "{network:?}");
}

#[test]
fn the_paper_s_montage_becomes_a_device_s_model() {
    check("paper-61.toml");
}

#[test]
fn the_ten_ten_montage_becomes_a_device_s_model() {
    check("ten-ten-61.toml");
}

#[test]
fn the_ten_twenty_montage_becomes_a_device_s_model() {
    check("ten-twenty-32.toml");
}

#[test]
fn the_montage_of_two_cytons_becomes_a_device_s_model() {
    check("cyton-16.toml");
}

#[test]
fn the_montage_of_one_cyton_becomes_a_device_s_model() {
    check("cyton-8.toml");
}

#[test]
fn every_file_in_the_folder_has_a_test() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../files/montages");
    let tests = include_str!("montages.rs");
    for entry in std::fs::read_dir(folder).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        assert!(tests.contains(&format!("check(\"{name}\")")), "{name}");
    }
}

#[test]
fn a_recording_is_compared_by_electrode_not_by_spelling() {
    let montage = montage("cyton-8.toml");
    let labels = ["Fp1.", "C3", "C4", "T5", "T6", "O1", "O2", "ECG"].map(str::to_owned);
    let check = RecordingCheck::new("r.edf".to_owned(), labels.to_vec(), &montage).unwrap();
    let printed = check.to_string();
    for line in [
        "recorded: 7 Fp1 (as Fp1.) C3 C4 P7 (as T5) P8 (as T6) O1 O2",
        "missing, would be interpolated: 1 Fp2",
        "no electrode of the montage: 1 ECG",
    ] {
        assert!(printed.contains(line), "{printed}");
    }
}

#[test]
fn shapes_that_do_not_fit_are_refused_before_recordings_are_read() {
    let montage = Path::new(env!("CARGO_MANIFEST_DIR")).join("../files/montages/cyton-8.toml");
    for (options, expected) in [
        (&["--mode", "pca", "--numbers", "132"][..], "at most 128"),
        (&["--mode", "shortcut"], "choose network.padding"),
        (&["--mode", "pca", "--hop", "5"], "4, 8 or 16"),
        (&["--mode", "pca", "--rate", "300"], "250, 256, 500"),
        (&["--mode", "paper"], "use paper-code-only"),
    ] {
        let output = Command::new(env!("CARGO_BIN_EXE_trainer"))
            .args([
                "train", "--data", "/nowhere", "--train", "R1", "--test", "R2",
            ])
            .args(["--mains", "50", "--out", "/nowhere/model", "--montage"])
            .arg(&montage)
            .args(options)
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(2), "{options:?}");
        let printed = String::from_utf8(output.stderr).unwrap();
        assert!(printed.contains(expected), "{options:?}: {printed}");
    }
}
