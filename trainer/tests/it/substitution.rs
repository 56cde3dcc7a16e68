//! Tests of `trainer substitution`, and of what other commands print about its table.

use super::{Folder, LABELS, SMALL, assert_has, write_gdf};
use artifact::Artifact;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const JOIN: &str = "substitution --artifact=model --mains=50";

#[test]
fn a_table_joins_the_artifact_and_other_commands_mention_it() {
    let folder = Folder::with_runs(2, 60);
    folder.train("pca", "--train=run1");
    folder.succeed(&format!("train {SMALL} --mode=pca --out=plain --train=run1"));
    let printed = folder.succeed(&format!("{JOIN} --train=run1 --test=run2"));
    assert_has(&printed, &["NMSE", "median 0.0", "the substitution of bad electrodes converges"]);
    let [model, plain] = ["model", "plain"].map(|name| Artifact::read(&folder.path(name)).unwrap());
    let table = model.substitution.expect("a table");
    let training = &table.description.training;
    assert_eq!(training.train_files, ["run1.gdf"]);
    assert_eq!(training.test_files, ["run2.gdf"]);
    // Eight electrodes record three sources, so the other electrodes predict each electrode except
    // for its noise.
    let figures = training.figures.as_ref().expect("figures");
    assert!(figures.median_nmse < 0.02 && figures.worst_nmse < 0.1, "{figures:?}");
    assert!(LABELS.contains(&figures.worst_electrode.as_str()));
    // Before the filters, which remove a part of it, the noise has a variance of 5^2 / 3.
    for units in &table.innovation {
        let uv2 = f64::from(*units) / 256.0;
        assert!((2.0..15.0).contains(&uv2), "{:?}", table.innovation);
    }
    assert_eq!(model.description, plain.description);
    let shown = folder.succeed("show model");
    assert_has(
        &shown,
        &["bad electrodes are substituted; NMSE", "substitution          8 electrodes"],
    );
    assert_eq!(folder.json("show model --json")["substitution"]["format"], 1);
    assert!(folder.json("show plain --json")["substitution"].is_null());
    assert_has(&folder.succeed("check model"), &["the substitution of bad electrodes converges"]);
    let [differences, _] = folder.run("diff plain model", 1);
    assert_has(
        &differences,
        &["substitution.training.train_files", "tables of substitutions differ"],
    );

    let log = folder.fail(&format!("{JOIN} --train=run2"), 2);
    assert_has(&log, &["has a table of substitutions already", "--force"]);
    let [_, log] = folder.run(&format!("{JOIN} --train=run2 --force"), 0);
    assert_has(&log, &["the errors are those of the training recordings"]);
    let toml = folder.read("model/substitution.toml");
    assert!(!toml.contains("figures") && toml.contains("run2.gdf"), "{toml}");
}

#[test]
fn recordings_that_do_not_determine_a_table_are_refused_and_missing_and_silent_electrodes_are_named()
 {
    let folder = Folder::with_runs(1, 60);
    folder.train("pca", "--train=run1");
    folder.write_recording("short.gdf", &LABELS, 14, 3);
    let log = folder.fail(&format!("{JOIN} --train=short"), 1);
    assert_has(&log, &["have 4 s", "8 electrodes", "at least 8 s"]);
    assert!(!folder.path("model/substitution.toml").exists());
    let silent = folder.path("silent.gdf");
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mix = |at: usize, sources: [f32; 3]| {
        let is_silent = at == 3 || at == 4;
        let own = sources[at % 3] + rng.random_range(-5.0..5.0);
        if is_silent { 0.0 } else { own }
    };
    write_gdf(&silent, &LABELS, (250, 60), (4, 1e-4), mix, &[]);
    let [_, log] = folder.run(&format!("{JOIN} --train=run1,silent --subject=me"), 0);
    for label in ["C4", "P7"] {
        let warning = format!("warning: me: electrode {label} is bad in 1 of 2 recordings");
        assert_has(&log, &[&warning]);
    }
    let toml = folder.read("model/substitution.toml");
    assert_has(&toml, &["subject = \"me\"", "bad = [\"C4\", \"P7\"]"]);
    folder.write_recording("seven.gdf", &LABELS[..7], 60, 5);
    let [printed, log] = folder.run(&format!("{JOIN} --train=run1,seven --force"), 0);
    assert_has(&log, &["warning: training recordings lack O2"]);
    assert!(!printed.contains("(O2)"), "{printed}");
    assert_has(&folder.read("model/substitution.toml"), &["interpolated = [\"O2\"]"]);
}
