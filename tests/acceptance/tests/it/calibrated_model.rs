//! The bridge fits a packed model to the signal of a board, and later streams with this model.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use acceptance::files::{noise, write_gdf};
use acceptance::port::free_address;
use acceptance::printing::{self, board_with, bridge};
use acceptance::process::Process;
use artifact::Artifact;
use rustix::process::Signal;

use crate::inputs;

/// Time limit for a condition, enough on a busy machine.
const SLACK: Duration = Duration::from_mins(2);

/// Returns the paths of all entries in the folder of a subject's models, including hidden ones.
fn models(folder: &Path, subject: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder.join("data/corticode/models").join(subject));
    let entries = entries.into_iter().flatten();
    entries.map(|entry| entry.expect("an entry").path()).collect()
}

/// Returns two errors at `rate` from the printed table, in percent: the error of the person's model
/// and the error of the built-in one.
fn errors_at(rate: &str, table: &str) -> [f64; 2] {
    let mut rows = table.lines().map(|line| line.split_whitespace().collect::<Vec<_>>());
    let row = rows.find(|row| row.first() == Some(&rate)).expect("the rate");
    [row[2], row[4]].map(|error| error.parse().expect("a number"))
}

#[test]
fn a_model_is_fitted_to_a_board_s_signal_and_the_bridge_streams_with_it() {
    let built_in = inputs::artifact();
    if built_in.packed.is_none() {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();

    let port = free_address();
    let fast = board_with(folder, &port, &["--seed=7", "--fast"]);
    let arguments = ["calibrate", "--subject=ada", "--seconds=20", "--port", &port];
    let mut calibrating = bridge(folder, "calibrating", &arguments);
    assert!(calibrating.wait(SLACK).success(), "{}", calibrating.log());
    drop(fast);
    let [personal] = &models(folder, "ada")[..] else {
        panic!("{}", calibrating.log());
    };
    let artifact = Artifact::read(personal).expect("a model");
    let id = artifact.id.to_string();
    let table = calibrating.output();
    let [own, other] = errors_at("4", &table);
    assert!(own < 0.8 * other, "{table}");
    assert!(table.contains(&id) && table.contains("--subject ada --streams packed"), "{table}");
    let network = |artifact: &Artifact| artifact.network_id().expect("files");
    assert_eq!(network(&artifact), network(&built_in));
    let people = &artifact.packed.as_ref().expect("a packed model").description.training.people;
    assert_eq!(people[0].subject, "ada");
    assert_eq!(people[0].bad, [""; 0]);
    let log = calibrating.errors();
    assert!(log.contains(&format!("the device uses model {id}")), "{log}");

    let port = free_address();
    let faults = ["--realtime", "--duration=120", "--fault=lead-off@1s:Cz"];
    let _faulty = board_with(folder, &port, &faults);
    let arguments = ["calibrate", "--subject=ada", "--port", &port];
    let mut interrupted = bridge(folder, "interrupted", &arguments);
    interrupted.wait_until("a report of the electrode", SLACK, |bridge| {
        bridge.errors().contains("the device finds flat: Cz; at the rail: Cz")
    });
    interrupted.signal(Signal::INT);
    assert_eq!(interrupted.wait(SLACK).code(), Some(1));
    let log = interrupted.errors();
    assert!(log.contains("nothing was written"), "{log}");
    assert_eq!(models(folder, "ada"), std::slice::from_ref(personal));

    let mut printing = printing::print(folder, &port, &["--streams=packed", "--subject=ada"]);
    let frames = |bridge: &Process| bridge.output().contains("/neurodata_reconstructed");
    printing.wait_until("frames", SLACK, frames);
    let [_, log] = printing::stop(printing, folder);
    let before = format!("the device uses model {}; it is sent", built_in.id);
    let after = format!("the device uses model {id}");
    assert!(log.contains(&before) && log.contains(&after), "{log}");
}

/// Writes 35 s of a recording with these electrodes: four slow sources, which reach all electrodes,
/// and noise. With `is_bad`, the first electrode has much noise of its own.
fn write_recording(path: &Path, labels: &[String], is_bad: bool) {
    let mut random = noise(5);
    let mut sources = [0.0; 4];
    let weights: Vec<[f32; 4]> = labels.iter().map(|_| std::array::from_fn(|_| random())).collect();
    let values = (0..35 * 256).flat_map(|_| {
        for source in &mut sources {
            *source = 0.95 * *source + 20.0 * random();
        }
        let mut values: Vec<f32> = weights
            .iter()
            .map(|weights| {
                let sum: f32 = weights.iter().zip(sources).map(|(w, source)| w * source).sum();
                sum + 2.0 * random()
            })
            .collect();
        if is_bad {
            values[0] += 500.0 * random();
        }
        values
    });
    write_gdf(path, labels, 256, values, &[]);
}

#[test]
fn a_model_is_fitted_to_a_recording_and_what_cannot_be_used_is_refused() {
    let built_in = inputs::artifact();
    if built_in.packed.is_none() {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let path = |name: &str| folder.join(name).display().to_string();
    let labels = &built_in.description.montage.electrodes;
    write_recording(&folder.join("bad.gdf"), labels, true);
    write_recording(&folder.join("few.gdf"), &labels[..8], false);
    fs::create_dir(folder.join("mine")).expect("a folder");
    let without_packed = built_in.clone().with_packed(None).expect("a model");
    let network = folder.join("network");
    without_packed.write(&network).expect("written");
    let run = |arguments: &[&str], status| {
        let arguments = [&["calibrate", "--subject=bob", "--mains=50"], arguments].concat();
        let mut calibrating = bridge(folder, "calibrating", &arguments);
        assert_eq!(calibrating.wait(SLACK).code(), Some(status), "{}", calibrating.log());
        [calibrating.output(), calibrating.errors()]
    };
    let (bad, few) = (path("bad.gdf"), path("few.gdf"));
    let (output, mine) = (path("models/bob"), path("mine"));
    let numbers = model::HAS_SHORTCUT.then_some("--numbers");
    let mut arguments = vec!["--seconds=20", "--recording", &bad, "--output", &output];
    arguments.extend(numbers);
    let [table, log] = run(&arguments, 0);
    let [own, other] = errors_at("4", &table);
    assert!(own < other && table.contains("--upload-model"), "{table}");
    if numbers.is_some() {
        let row = table.lines().find(|line| line.starts_with("numbers"));
        let row: Vec<_> = row.expect("a row").split_whitespace().collect();
        let [own, other] = [row[3], row[5]].map(|error| error.parse::<f64>().expect("a number"));
        assert!(own < other, "{table}");
    }
    let warning = format!("electrode {} is bad in ", labels[0]);
    assert!(log.contains(&warning), "{log}");
    let artifact = Artifact::read(Path::new(&output)).expect("a model");
    if numbers.is_some() {
        assert_eq!(artifact.description.training.train_files, ["bad.gdf"]);
        let [own, base] =
            [&artifact, &built_in].map(|model| model.input_scale_uv().expect("a scale"));
        assert!((own / base - 1.0).abs() < 1e-12);
    }
    let packed = &artifact.packed.as_ref().expect("a packed model").description;
    assert_eq!(packed.training.train_files, ["bad.gdf"]);
    assert_eq!(packed.training.people[0].bad, [labels[0].as_str()]);

    let bad_first = format!("; bad were {}", labels[0]);
    let lacks = format!("lacks {} of the {} electrodes", labels.len() - 8, labels.len());
    for (arguments, words) in [
        (&["--recording", &bad][..], &*bad_first),
        (&["--seconds=20", "--recording", &few], &lacks),
        (&["--seconds=20", "--recording", &bad, "--output", &mine], "exists"),
        (&["--seconds=20", "--recording", "none.gdf"], "none.gdf"),
        (&["--model", &path("network")], "no packed code"),
    ] {
        let [_, log] = run(arguments, 2);
        assert!(log.contains(words), "{words}: {log}");
    }
    assert!(models(folder, "bob").is_empty());
    let unread = path("network");
    for (option, words) in [
        ("--subject=eve", "has no model of eve; there is none of anybody yet"),
        (
            &*format!("--upload-model={unread}"),
            "the person's model has no effect: it has no numbers for codes",
        ),
    ] {
        let mut refused = bridge(folder, "refused", &["--sink=ndjson", option]);
        assert_eq!(refused.wait(SLACK).code(), Some(2));
        let log = refused.errors();
        assert!(log.contains(words), "{words}: {log}");
    }
}
