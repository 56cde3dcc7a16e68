//! Tests of `trainer classify`.

use super::{Folder, LABELS, assert_has, write_gdf};
use artifact::classifier::Classifier;

const RATE: u64 = 250;
/// Number of rows (samples of all electrodes) from one event to the next.
const PERIOD: u64 = RATE * 9 / 2;

/// Writes a recording of 120 s with an event of type 769 or 770 every 4.5 s. C3 is large in trials
/// of type 769, C4 in trials of type 770.
fn write_trials(folder: &Folder, name: &str, seed: u64) {
    let events = (0..26).map(|n: u64| (n * PERIOD, 769 + (n * n / 3 % 2) as u16));
    let events: Vec<(u64, u16)> = events.collect();
    let mut count = 0;
    let mix = |at: usize, [a, b, c]: [f32; 3]| {
        let row = count / LABELS.len() as u64;
        count += 1;
        let class = events.get((row / PERIOD) as usize).map_or(769, |event| event.1);
        let [left, right] = if class == 769 { [3.0, 1.0] } else { [1.0, 3.0] };
        match LABELS[at] {
            "C3" => left * a + c,
            "C4" => right * b + c,
            _ => c + 0.2 * (a + b),
        }
    };
    write_gdf(&folder.path(name), &LABELS, (250, 120), (seed, 5.0), mix, &events);
}

#[test]
fn an_evaluation_states_what_classifiers_lose_and_less_with_a_weighted_code() {
    let folder = Folder::new();
    for run in 1..=2 {
        write_trials(&folder, &format!("run{run}.gdf"), run);
    }
    let figures = |weight: &str| {
        let packed = "packed --montage=cyton-8.toml --out=model --force --mains=50";
        folder.succeed(&format!("{packed} --coefficients=32 --train=run1,run2 {weight}"));
        let evaluate = "evaluate --artifact=model --test=run1,run2 --json";
        let without = folder.json(evaluate);
        let row = &without["classifiers"]["codes"][4];
        assert!(row["auc"].is_null() && row["snr_db"].is_number(), "{without}");
        let json = folder.json(&format!("{evaluate} --events=769,770"));
        let classifiers = &json["classifiers"];
        assert!(classifiers["original_auc"].as_f64().is_some_and(|auc| auc > 0.95));
        let figure = |rate: usize, name: &str| classifiers["codes"][rate][name].as_f64();
        // The finest rate allows good decisions; at the coarsest rate, the error has more than half
        // the power of the signal.
        assert!(figure(0, "auc").is_some_and(|auc| auc > 0.95), "{json}");
        assert!(figure(15, "snr_db").is_some_and(|snr| snr < 3.0), "{json}");
        [2, 4].map(|rate| figure(rate, "snr_db").expect("a ratio"))
    };
    let plain = figures("");
    let weighted = figures("--for=motor");
    for (weighted, plain) in weighted.iter().zip(plain) {
        assert!(*weighted > plain, "{weighted} {plain}");
    }
    folder
        .fail("packed --montage=cyton-8.toml --out=model --mains=50 --train=run1 --strength=2", 2);
    let show = folder.succeed("show model");
    assert_has(&show, &["errors at 8 to 30 Hz weighted by 3"]);
}

#[test]
fn recordings_with_events_become_a_classifier_with_a_report() {
    let folder = Folder::new();
    for run in 1..=3 {
        write_trials(&folder, &format!("run{run}.gdf"), run);
    }
    folder.train("pca", "--train=run1");
    let classify = "classify --artifact=model --mains=50 --out=classifier.toml";
    let json = folder.json(&format!(
        "{classify} --events=769,770 --train=run1,run2 --test=run3 --json --report=report"
    ));
    let classifier = Classifier::read(&folder.path("classifier.toml")).expect("a classifier");
    assert_eq!(json["id"], format!("{:08x}", classifier.id()));
    assert_eq!(classifier.electrodes, LABELS);
    assert_eq!(classifier.filters.len(), 6);
    let training = &classifier.training;
    assert_eq!(training.train_files, ["run1.gdf", "run2.gdf"]);
    for figures in [&training.cross_validation, &training.test] {
        let figures = figures.as_ref().expect("figures");
        assert!(figures.accuracy > 0.9, "{figures:?}");
    }
    let page = folder.read("report/index.html");
    for name in ["patterns", "probability"] {
        assert!(page.contains(&format!("{name}.svg")));
        assert!(folder.read(&format!("report/{name}.svg")).contains("<svg"));
    }
    for text in ["Each left out in turn", "Test", "run1.gdf", "run3.gdf"] {
        assert!(page.contains(text), "{text} in {page}");
    }
    // The trials of a single recording are divided into blocks.
    let printed = folder.succeed(&format!("{classify} --force --events=769=1,770=2 --train=run1"));
    assert_has(&printed, &["block 5 of 5", "without quantisation"]);

    for (arguments, status, words) in [
        ("--events=769,770", 2, "exists"),
        (
            "--force --events=769,771",
            2,
            "no recording of --train has the event 771; they have: 769 (14 times), 770",
        ),
        ("--force --events=769", 2, "two or more classes"),
        ("--force --events=769,T1", 2, "T1 is no code"),
        ("--force --events=769,770 --filters=5", 2, "cannot be divided among 2 classes"),
        ("--force --events=769,770 --filters=10", 2, "at most 8"),
        ("--force --events=769,770 --band=0.2..30", 2, "1 to 60 Hz"),
        ("--force --events=769,770 --band=20..20", 2, "ascending"),
        ("--force --events=769,770 --window=4", 2, "--window 4"),
        ("--force --events=769,770 --trial=0..60", 1, "at least 10 are needed"),
    ] {
        let error = folder.fail(&format!("{classify} {arguments} --train=run1"), status);
        assert_has(&error, &[words]);
    }
}
