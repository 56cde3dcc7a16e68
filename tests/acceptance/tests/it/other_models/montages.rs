//! For each file in `files/montages/`, the batch reference of a model with random weights computes
//! the same codes as numpy. So do the trained models in `signal/model` other than the built-in one.
//! Two models are built into programs, one for the paper's montage and one for the kit: host-sim
//! announces the model and streams codes that equal the batch reference's. host-sim also decodes
//! the codes of the paper's montage, and corticode-node those of the kit.

use std::fs;
use std::path::{Path, PathBuf};

use acceptance::files::Table;
use acceptance::other_model::{OtherModel, fail, succeed};
use acceptance::{numpy_reference, workspace};
use artifact::{Artifact, Golden, IntegerCode, Mode, MontageFile};
use link::{Decoder, MAX_FRAME, ToHost};

use crate::inputs::artifact;

/// Number of values in a code of the models with random weights.
const NUMBERS: usize = 48;
/// Montage of the trained models in `signal/model/kit-250` and `kit-500`, which differ in the rate
/// of the ADC.
const KIT_MONTAGE: &str = "kit-8";
/// Gain of the ADC in the copy of `kit-500` for which host-sim and corticode-node are built; all
/// checked-in models have a gain of 24.
const NODE_GAIN: u32 = 6;
/// Duration of the synthetic EEG that host-sim plays, in seconds.
const SECONDS: u64 = 6;

/// Montage of the trained model in `signal/model/paper`.
const TRAINED_MONTAGE: &str = "paper-61";
/// Montage of the built-in model, whose codes the tests of `pipeline` and `encoder_numpy.rs`
/// compare with their references.
const BUILT_IN_MONTAGE: &str = "ten-ten-61";
/// Montages of models that `variants.rs` builds.
const VARIANTS: [&str; 2] = ["cyton-16", "ten-twenty-32"];
/// Montage of models that `own_cap_page.rs` and `packed_alone.rs` build.
const OWN_CAP: &str = "cyton-8";
/// Montage of the trained model in `signal/model/ironbci`, whose image `cargo xtask board` runs. It
/// has the electrodes of the kit.
const IRONBCI: &str = "ironbci";

/// Arguments of cargo that build, for each model, the test that compares the pipeline with its
/// batch reference.
const BUILD: &str = "build --workspace --test=streaming_equals_batch";
/// Name of the test target that compares the pipeline with its batch reference.
const COMPARISON: &str = "streaming_equals_batch";
/// Arguments in addition to [`BUILD`] that also build host-sim and the tests of the device's
/// producer. A call of cargo for these packages alone would compile most crates again with other
/// features.
const HOST_SIM_AND_DEVICE: &str = " --bin=host-sim --test=producer";
/// Arguments in addition to [`BUILD`] that also build host-sim and the tests of corticode-node.
const HOST_SIM_AND_NODE: &str = " --bin=host-sim --test=node";
/// Part of the name of the test in corticode-node that depends on the model's shape.
const NODE_TEST: &str = "the_program_decodes";

#[test]
fn every_montage_has_the_codes_of_numpy() {
    let streamed = [KIT_MONTAGE, TRAINED_MONTAGE, BUILT_IN_MONTAGE, OWN_CAP, IRONBCI];
    let montages = any_model::montages().expect("the montages");
    assert!(montages.len() >= 6, "{} montages", montages.len());
    let built_in = artifact().description;
    for (seed, montage) in (1..).zip(montages) {
        let name = montage.name.as_str();
        if name == BUILT_IN_MONTAGE {
            assert_eq!(montage.montage(), built_in.montage);
            assert_eq!(montage.grid(), built_in.grid);
        }
        assert!(
            streamed.contains(&name) || VARIANTS.contains(&name),
            "no test streams a model for {name}: add one to variants.rs"
        );
        compare_with_numpy(seed, &model(seed, &montage));
    }
}

#[test]
fn the_models_for_one_converter_are_sound_and_have_the_codes_of_numpy() {
    let models =
        [("kit-250", KIT_MONTAGE, 250), ("kit-500", KIT_MONTAGE, 500), ("ironbci", IRONBCI, 250)];
    for (seed, (name, montage, rate_hz)) in (1..).zip(models) {
        let montages = workspace::root().join("files/montages");
        let montage = MontageFile::read(&montages.join(montage).with_extension("toml"));
        let montage = montage.expect("the montage");
        let artifact = trained(name);
        let description = &artifact.description;
        assert_eq!(description.montage, montage.montage());
        assert_eq!(description.grid, montage.grid());
        let mut adc = montage.adc();
        adc.rate_hz = rate_hz;
        assert_eq!(description.adc, adc);
        assert!(artifact.packed.is_some() && artifact.substitution.is_some());
        let golden = Golden::read(&folder_of(name)).expect("golden codes");
        let model = model_gen::quantise(&artifact).expect("an integer model");
        let windows = golden.windows.iter();
        let codes: Vec<IntegerCode> = windows.map(|w| model.encode_window(w)).collect();
        assert_eq!(codes, golden.codes, "{name}");
        compare_with_numpy(seed, &artifact);
    }
}

#[test]
fn a_model_for_few_channels_streams_in_every_program() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut artifact = trained("kit-500");
    artifact.description.adc.gain = NODE_GAIN;
    artifact.write(folder.path()).expect("a folder to write to");
    let artifact = Artifact::read(folder.path()).expect("the artifact");
    let build = BUILD.to_owned() + HOST_SIM_AND_NODE;
    let built = OtherModel::build(folder.path(), &build);
    built.test(COMPARISON, "");
    built.test("node", NODE_TEST);
    let codes = play(&built, &artifact, &folder.path().join("frames"));
    println!("{KIT_MONTAGE}: {codes} codes");
}

#[test]
fn the_trained_model_of_the_papers_montage_streams_and_decodes() {
    let root = workspace::root().canonicalize().expect("the root");
    let model = root.join("signal/model/paper");
    let artifact = Artifact::read(&model).expect("the artifact");
    let paper = MontageFile::read(&root.join("files/montages/paper-61.toml"));
    let paper = paper.expect("the montage");
    assert_eq!(artifact.description.montage, paper.montage());
    assert_eq!(artifact.description.grid, paper.grid());
    compare_with_numpy(1, &artifact);
    let built = OtherModel::build(&model, &(BUILD.to_owned() + HOST_SIM_AND_DEVICE));
    built.test(COMPARISON, "");
    let output = tempfile::tempdir().expect("a folder");
    let codes = play(&built, &artifact, &output.path().join("run.codes"));
    println!("{}: {codes} codes", paper.name);

    // The model has no packed code: the tests of `device` check that the device does not offer it,
    // and `encode` must report that it is missing.
    built.test("producer", "a_device_offers");
    let host_sim = |words: &str| {
        let mut program = built.program("host-sim");
        program.current_dir(output.path()).args(words.split(' '));
        program
    };
    fs::write(output.path().join("in.edf"), "not read").expect("a file");
    let refusal = fail(&mut host_sim("encode in.edf out.codes --stream=packed"));
    assert!(refusal.contains("has no packed code"), "{refusal}");

    succeed(&mut host_sim("decode run.codes run.csv --to csv"));
    let table = Table::read(&output.path().join("run.csv"));
    let electrodes = paper.montage().electrodes;
    let electrodes: Vec<&str> = electrodes.iter().map(String::as_str).collect();
    let rows: Vec<Vec<f32>> = table.numbers(&electrodes).collect();
    assert!(rows.iter().any(|row| *row != rows[0]), "one row: {rows:?}");
}

/// Returns a trained model of `signal/model`.
fn trained(name: &str) -> Artifact {
    Artifact::read(&folder_of(name)).expect("the artifact")
}

fn folder_of(name: &str) -> PathBuf {
    workspace::root().join("signal/model").join(name)
}

/// Returns a model in mode `pca` with random weights for a montage; `seed` selects the weights.
fn model(seed: u32, montage: &MontageFile) -> Artifact {
    any_model::any_artifact_for(seed, montage, Mode::Pca, NUMBERS).expect("a model")
}

/// Compares the batch reference's codes with numpy's codes on random windows.
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

/// Encodes synthetic EEG with host-sim, which writes its output to the file `frames`. Checks the
/// model that host-sim announces there and the codes. Returns the number of codes.
fn play(built: &OtherModel, artifact: &Artifact, frames: &Path) -> usize {
    let mut host_sim = built.program("host-sim");
    host_sim.args(["run", "--input=synthetic", "--mains=50"]);
    host_sim.arg(format!("--duration={SECONDS}"));
    host_sim.arg(format!("--output=file:{}", frames.display()));
    succeed(&mut host_sim);

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
    assert!(codes.iter().all(|levels| levels.len() == description.code.numbers));
    let changes = codes.windows(2).filter(|pair| pair[0] != pair[1]).count();
    assert!(changes > codes.len() / 2, "{changes} of {}", codes.len());
    codes.len()
}
