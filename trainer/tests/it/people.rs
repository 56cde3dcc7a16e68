//! Tests of models trained on several people.

use super::{Folder, LABELS, SMALL, assert_has, write_gdf};
use artifact::{Artifact, Person};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;
use std::fs;

/// Writes a recording to the person's own folder. `gain` multiplies all electrodes; C4 gets
/// additional noise of the amplitude `noise`.
fn write(folder: &Folder, (subject, run): (&str, u64), gain: f32, noise: f32) {
    let place = folder.path(subject);
    fs::create_dir_all(&place).expect("a folder");
    let mut rng = ChaCha8Rng::seed_from_u64(run);
    let mix = |at: usize, sources: [f32; 3]| {
        let random = rng.random_range(-1.0..1.0);
        let own = if at == 3 { noise * random } else { 0.0 };
        gain * (sources[at % 3] + 0.5 * sources[(at + 1) % 3] + own)
    };
    let path = place.join(format!("{subject}R{run:02}.gdf"));
    write_gdf(&path, &LABELS, (250, 60), (run, 5.0 * gain), mix, &[]);
}

/// Returns a folder with recordings of three people: B equals A at eight times the amplitude, and C
/// equals B except for a bad electrode C4.
pub(super) fn three() -> Folder {
    let folder = Folder::new();
    for run in [1, 2, 3] {
        write(&folder, ("A1", run), 1.0, 0.0);
        write(&folder, ("B1", run), 8.0, 0.0);
        write(&folder, ("C1", run), 8.0, 2000.0);
    }
    folder
}

/// Trains network, packed model and table of substitutions in the folder `out`; also returns the
/// messages of the last command.
fn train(folder: &Folder, out: &str, data: &str) -> (Artifact, String) {
    let options = format!("--mains=50 --data={data} --train=R01,R02 --test=R03");
    let small = SMALL.replace("--data=.", "").replace("--mains=50", "");
    folder.succeed(&format!("train {small} --mode=pca --out={out} {options}"));
    folder.succeed(&format!("packed --artifact={out} --coefficients=16 {options}"));
    let [_, log] = folder.run(&format!("substitution --artifact={out} {options}"), 0);
    (Artifact::read(&folder.path(out)).expect("a model"), log)
}

fn person(subject: &str, people: &[Person]) -> Person {
    let person = people.iter().find(|person| person.subject == subject);
    person.expect("the person").clone()
}

#[test]
fn a_loud_person_counts_as_much_as_a_quiet_one() {
    let folder = three();
    let (alone, _) = train(&folder, "alone", "A1");
    let (both, log) = train(&folder, "both", "[AB]1");
    assert_has(&log, &["standard deviation of A1", "scaled to the median"]);
    assert_eq!(alone.description.training.people, []);
    let people = &both.description.training.people;
    let [a, b] = ["A1", "B1"].map(|subject| person(subject, people).sd_uv);
    assert!((b / a - 8.0).abs() < 0.01, "{people:?}");
    assert!((both.description.input.sd_uv - f64::midpoint(a, b)).abs() < 0.02 * b);
    // Both people have the same correlations, so the model of both equals the model of one, except
    // for rounding such as the ADC's.
    let weights = |model: &Artifact| {
        let shape = [16, 128];
        let tensor = model.weights.tensor("encoder.shortcut.weight", &shape);
        tensor.expect("a matrix").to_vec()
    };
    let pairs = weights(&alone).into_iter().zip(weights(&both));
    let difference = pairs.map(|(one, both)| (one - both).abs()).fold(0.0, f32::max);
    assert!(difference < 2e-3, "{difference}");
    let [one, two] = [&alone, &both].map(|model| &model.substitution.as_ref().unwrap().weights);
    let difference = one.iter().zip(two).map(|(one, two)| one.abs_diff(*two)).max();
    assert!(difference <= Some(1), "{one:?} {two:?}");
    // The calibrated input range must contain the louder person's signals.
    let largest = |model: &Artifact| {
        let tensor = model.calibration.tensor("input.max_abs", &[1]);
        tensor.expect("a range")[0]
    };
    assert!((largest(&both) / largest(&alone) - 8.0).abs() < 0.01);
    // Each person's error equals the error of A's model on A, because both people have the same
    // correlations.
    let alone = alone.description.training.prd_percent.expect("figures");
    let tested = &both.description.training.tested;
    assert_eq!(tested.len(), 2);
    for tested in tested {
        let [one, both] = [alone, tested.prd_percent].map(|figures| figures.pca_float);
        assert!((one / both - 1.0).abs() < 0.01, "{tested:?} {one}");
    }
    let packed = both.packed.expect("a packed model").description.training;
    let table = both.substitution.expect("a table").description.training;
    assert_eq!([&packed.people, &table.people], [people, people]);
}

#[test]
fn a_bad_electrode_of_one_person_is_left_out_and_named_in_every_card() {
    let folder = three();
    let (model, log) = train(&folder, "model", "[A-C]1");
    let warning = "warning: C1: electrode C4 is bad in 2 of 2 recordings";
    assert_has(&log, &[warning]);
    let training = &model.description.training;
    assert_eq!(person("C1", &training.people).bad, ["C4"]);
    let packed = &model.packed.as_ref().unwrap().description.training;
    let table = model.substitution.as_ref().unwrap();
    for people in [&packed.people, &table.description.training.people] {
        assert_eq!(people, &training.people);
        for subject in ["A1", "B1"] {
            assert_eq!(person(subject, people).bad, [""; 0]);
        }
    }
    assert_eq!(training.tested[2].bad, ["C4"]);
    // `evaluate` interpolates as training does, so the error equals the card's. The noise of C4
    // spoils the codes of all electrodes unless C4 is filled from the others.
    let [printed, log] = folder.run(
        "evaluate --artifact=model --data=[A-C]1 --test=R03 --mains=50 --json --report=report",
        0,
    );
    assert_has(&log, &["warning: C1: electrode C4 is bad in 1 of 1 recordings"]);
    let json: Value = serde_json::from_str(&printed).expect("an object");
    let mse = training.mse.expect("a test");
    let evaluated = json["mse_int8"].as_f64().expect("a number");
    assert!((evaluated - mse.autoencoder_int8).abs() < 1e-6, "{evaluated}");
    let people = json["people"].as_array().expect("a list");
    for (person, tested) in people.iter().zip(&training.tested) {
        assert_eq!(person["subject"], *tested.subject);
        let number = |key: &str| person[key].as_f64().expect("a number");
        let [on, off] = ["good_mse_uv2_on", "good_mse_uv2_off"].map(number);
        let of_electrodes = person["by_electrode"].as_array().expect("a list");
        assert_eq!(of_electrodes.len(), LABELS.len());
        if tested.bad.is_empty() {
            assert!((number("prd_percent_on") - tested.prd_percent.autoencoder_int8).abs() < 1e-4);
            assert!((off / on - 1.0).abs() < 1e-9);
        } else {
            // The measured ratio is 5.3.
            assert!(off > 3.0 * on, "{off} {on}");
        }
    }
    assert!(folder.path("report/substitution-C1.svg").exists());
    assert!(!folder.path("report/substitution-A1.svg").exists());
    // A model trained without C is hardly better for A and B. If the noise of C's electrode C4 were
    // used for training, the errors of A and B would be several times as large.
    let (clean, _) = train(&folder, "clean", "[AB]1");
    for (with, clean) in training.tested.iter().zip(&clean.description.training.tested) {
        assert_eq!(with.subject, clean.subject);
        let [with, clean] = [with, clean].map(|tested| tested.prd_percent.pca_float);
        assert!(with < 1.1 * clean, "{with} {clean}");
    }
}
