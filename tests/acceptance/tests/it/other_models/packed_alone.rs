//! A model that has only the packed code builds, its pipeline streams the same blocks as the batch
//! reference, and host-sim encodes and decodes recordings with it.

use acceptance::files::{Table, noise, write_gdf};
use acceptance::other_model::{OtherModel, fail, succeed};
use acceptance::workspace;
use any_model::any_packed_alone;
use artifact::{Artifact, MontageFile};

const SEED: u32 = 7;
const SECONDS: u32 = 6;

/// Returns a model for the montage `cyton-8` that has only the packed code, with random integers.
fn model() -> Artifact {
    let montage = MontageFile::read(&workspace::root().join("files/montages/cyton-8.toml"));
    any_packed_alone(SEED, &montage.expect("the montage")).expect("a model")
}

#[test]
fn a_model_without_a_network_encodes_and_decodes_recordings() {
    let model = model();
    assert!(model.substitution.is_some(), "a table, for the test of the device");
    let folder = tempfile::tempdir().expect("a folder");
    let artifact = folder.path().join("model");
    model.write(&artifact).expect("a folder to write to");
    let tests = "build --workspace --bin=host-sim --test=packed_equals_batch --test=producer";
    let built = OtherModel::build(&artifact, tests);
    built.test("packed_equals_batch", "");
    for test in [
        "a_device_offers",
        "audits_reach_the_host",
        "blocks_of_repeated_steps",
        "a_railed_electrode_is_reported_and_filled",
    ] {
        built.test("producer", test);
    }
    let labels = &model.description.montage.electrodes;
    let rate_hz = model.description.adc.rate_hz;
    let count = labels.len() * usize::try_from(SECONDS * rate_hz).expect("few");
    let mut noise = noise(SEED);
    let noise = std::iter::repeat_with(|| 20.0 * noise()).take(count);
    write_gdf(&folder.path().join("in.gdf"), labels, rate_hz, noise, &[]);
    let host_sim = |words: &str| {
        let mut program = built.program("host-sim");
        program.current_dir(folder.path()).args(words.split(' '));
        program
    };
    let run = "run --input synthetic --output file:run.bin --duration 2";
    let made = succeed(&mut host_sim(run));
    assert!(made.contains("packed blocks made"), "{made}");
    let refusal = fail(&mut host_sim("encode in.gdf out.codes --stream=codes"));
    assert!(refusal.contains("has no network"), "{refusal}");
    // Without an option, `encode` writes packed blocks.
    let encoded = succeed(&mut host_sim("encode in.gdf out.codes"));
    assert!(encoded.contains("packed blocks"), "{encoded}");
    succeed(&mut host_sim("decode out.codes out.csv --to csv"));
    let table = Table::read(&folder.path().join("out.csv"));
    let electrodes: Vec<&str> = labels.iter().map(String::as_str).collect();
    let steps = SECONDS * model.description.window.rate_hz;
    let rows = table.numbers(&electrodes).count();
    assert_eq!(rows, usize::try_from(steps).expect("few"));
}
