//! Each file in `files/montages/` makes a model that streams: the codes of the pipeline equal those of the batch
//! reference, these equal numpy's, and host-sim, built with the model, announces and streams it.
//! corticode-node builds for a montage with few channels, and decodes its codes. The same holds for the
//! trained model of the paper's montage, whose codes host-sim also decodes.
#![forbid(unsafe_code)]

use std::fs;
use std::path::Path;
use std::process::Command;
use std::sync::{Mutex, MutexGuard, PoisonError};

use acceptance::{numpy_reference, other_model, workspace};
use artifact::{Artifact, Dimensions, IntegerCode, Mode, MontageFile};
use link::{Decoder, MAX_FRAME, ToHost};

/// Numbers in a code of each model.
const NUMBERS: usize = 48;
/// Montage of the model with which corticode-node is built, which has another gain than the others.
const NODE_MONTAGE: &str = "cyton-8";
/// Gain of that model.
const NODE_GAIN: u32 = 6;
/// Seconds that host-sim plays.
const SECONDS: u64 = 6;

/// Lets one test of this file build at a time: each replaces the programs of the other's model.
fn alone() -> MutexGuard<'static, ()> {
    static BUILDS: Mutex<()> = Mutex::new(());
    BUILDS.lock().unwrap_or_else(PoisonError::into_inner)
}

#[test]
fn every_montage_streams_the_codes_of_numpy() {
    let _alone = alone();
    let montages = any_model::montages().expect("the montages");
    assert!(montages.len() >= 5, "{} montages", montages.len());
    for (seed, montage) in (1..).zip(&montages) {
        let folder = tempfile::tempdir().expect("a folder");
        let artifact = model(seed, montage);
        artifact.write(folder.path()).expect("a folder to write to");
        compare_with_numpy(seed, &artifact);
        if artifact.description.dimensions() != paper(NUMBERS) {
            test_build(folder.path(), "pipeline", "streaming_equals_batch", "");
        }
        if montage.name == NODE_MONTAGE {
            test_build(folder.path(), "node", "core", "the_program_decodes");
        }
        let codes = play(folder.path(), &artifact, &folder.path().join("frames"));
        println!("{}: {codes} codes", montage.name);
    }
}

#[test]
fn the_trained_model_of_the_papers_montage_streams_and_decodes() {
    let _alone = alone();
    let folder = workspace::root().join("signal/model/paper");
    let artifact = Artifact::read(&folder).expect("the artifact");
    let paper = MontageFile::read(&workspace::root().join("files/montages/paper-61.toml"));
    let paper = paper.expect("the montage");
    assert_eq!(artifact.description.montage, paper.montage());
    assert_eq!(artifact.description.grid, paper.grid());
    test_build(&folder, "pipeline", "streaming_equals_batch", "");
    let output = tempfile::tempdir().expect("a folder");
    let frames = output.path().join("run.codes");
    let codes = play(&folder, &artifact, &frames);
    println!("{}: {codes} codes", paper.name);

    // The model has no packed code, which the device knows and `encode` says.
    let output_of = |cargo: &mut Command| cargo.output().expect("cargo runs");
    let tested = output_of(other_model::cargo(&folder).args([
        "test",
        "--package=device",
        "--lib",
        "a_device_offers",
    ]));
    let stdout = String::from_utf8_lossy(&tested.stdout);
    assert!(
        tested.status.success() && stdout.contains("1 passed"),
        "{stdout}"
    );
    fs::write(output.path().join("in.edf"), "not read").expect("a file");
    let refused = Command::new(other_model::target().join("debug/host-sim"))
        .current_dir(output.path())
        .args(["encode", "in.edf", "out.codes", "--stream=packed"])
        .output()
        .expect("host-sim starts");
    let stderr = String::from_utf8_lossy(&refused.stderr);
    assert!(
        !refused.status.success() && stderr.contains("has no packed code"),
        "{stderr}"
    );

    // The host-sim that `play` has built decodes with the same model.
    let decoded = Command::new(other_model::target().join("debug/host-sim"))
        .current_dir(output.path())
        .args(["decode", "run.codes", "--to", "csv"])
        .output()
        .expect("host-sim starts");
    let stderr = String::from_utf8_lossy(&decoded.stderr);
    assert!(decoded.status.success(), "{stderr}");
    let csv = fs::read_dir(output.path()).expect("the folder");
    let csv = csv.filter_map(|entry| Some(entry.ok()?.path()));
    let mut csv = csv.filter(|path| path.extension().is_some_and(|end| end == "csv"));
    let text = fs::read_to_string(csv.next().expect("a CSV file")).expect("text");
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let header: Vec<&str> = lines.next().expect("a header").split(',').collect();
    for electrode in &paper.montage().electrodes {
        assert!(
            header.contains(&electrode.as_str()),
            "{electrode}: {header:?}"
        );
    }
    let first = lines.next();
    assert!(lines.any(|line| Some(line) != first), "one row: {first:?}");
}

/// Returns the paper's dimensions with another length of the codes, whose streaming `variants.rs` checks.
const fn paper(numbers: usize) -> Dimensions {
    Dimensions {
        steps: 16,
        rows: 10,
        columns: 9,
        electrodes: 61,
        numbers,
    }
}

/// Returns a model of mode `pca` with random weights for a montage.
fn model(seed: u32, montage: &MontageFile) -> Artifact {
    let mut montage = montage.clone();
    if montage.name == NODE_MONTAGE {
        montage.adc.gain = NODE_GAIN;
    }
    any_model::any_artifact_for(seed, &montage, Mode::Pca, NUMBERS).expect("a model")
}

/// Compares the batch reference with numpy on random windows.
fn compare_with_numpy(seed: u32, artifact: &Artifact) {
    if !numpy_reference::available("montages against numpy") {
        return;
    }
    let model = model_gen::quantise(artifact).expect("an integer model");
    let windows = any_model::windows(!seed, artifact, 20);
    let quantise = |window| any_model::quantised(artifact, &model, window);
    let windows: Vec<Vec<i8>> = windows.iter().map(quantise).collect();
    let theirs = numpy_reference::integer_codes(&model, windows.iter().map(Vec::as_slice));
    let ours: Vec<IntegerCode> = windows.iter().map(|w| model.encode_window(w)).collect();
    assert_eq!(ours, theirs.expect("numpy's codes"));
    assert_ne!(ours[0], ours[1]);
}

/// Runs the tests of a package whose names contain `filter`, in a build with the model.
fn test_build(folder: &Path, package: &str, test: &str, filter: &str) {
    let output = other_model::cargo(folder)
        .args(["test", "--package", package, "--test", test, filter])
        .output()
        .expect("cargo runs");
    let stdout = String::from_utf8_lossy(&output.stdout);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{stdout}\n{stderr}");
    assert!(!stdout.contains(" 0 passed"), "no test ran: {stdout}");
}

/// Plays synthetic EEG with a host-sim that is built with the model, and checks what it sends to the file
/// `frames`. Returns the number of codes.
fn play(folder: &Path, artifact: &Artifact, frames: &Path) -> usize {
    let build = other_model::cargo(folder)
        .args(["build", "--package=host-sim"])
        .output()
        .expect("cargo runs");
    let stderr = String::from_utf8_lossy(&build.stderr);
    assert!(build.status.success(), "{stderr}");
    let played = Command::new(other_model::target().join("debug/host-sim"))
        .args(["run", "--input=synthetic", "--mains=50"])
        .arg(format!("--duration={SECONDS}"))
        .arg(format!("--output=file:{}", frames.display()))
        .output()
        .expect("host-sim starts");
    let stderr = String::from_utf8_lossy(&played.stderr);
    assert!(played.status.success(), "{stderr}");

    let description = &artifact.description;
    let bytes = fs::read(frames).expect("frames");
    let mut input = bytes.as_slice();
    let mut decoder = Decoder::<MAX_FRAME>::new();
    let (mut codes, mut announced) = (Vec::new(), 0);
    while let Some(frame) = decoder.next::<ToHost<'_>>(&mut input) {
        match frame.expect("a sound frame").message {
            ToHost::Capabilities(capabilities) => {
                announced += 1;
                assert_eq!(u32::from(capabilities.adc_rate_hz), description.adc.rate_hz);
                assert_eq!(usize::from(capabilities.channels), description.adc.channels);
                let labels: Vec<&str> = capabilities.labels.split(' ').collect();
                assert_eq!(labels, description.montage.electrodes);
                assert_eq!(capabilities.code_scale.len(), description.code.numbers);
                let lsb_nv = description.adc.lsb_uv() * 1_000.0;
                assert!((f64::from(capabilities.lsb_nv) - lsb_nv).abs() < 1e-5 * lsb_nv);
            }
            ToHost::Code(code) => {
                assert_eq!((code.model_id, code.saturated), (artifact.id.0, 0));
                let flags = code.flags;
                assert!(!flags.contains(link::Flags::ADC_STATUS_BAD), "{flags:?}");
                codes.push(code.values.levels().collect::<Vec<i32>>());
            }
            _ => {}
        }
    }
    assert!(announced > 0, "no Capabilities");
    let steps = SECONDS * u64::from(description.window.rate_hz);
    let window = &description.window;
    let expected = (steps - window.steps as u64) / window.hop as u64 + 1;
    assert_eq!(codes.len() as u64, expected);
    assert!(
        codes
            .iter()
            .all(|levels| levels.len() == description.code.numbers)
    );
    let changes = codes.windows(2).filter(|pair| pair[0] != pair[1]).count();
    assert!(changes > codes.len() / 2, "{changes} of {}", codes.len());
    codes.len()
}
