//! An integrator at a real roscore receives the predictions that the library computes from the
//! pipeline's features. A recording of features is converted to the same predictions.

use std::path::Path;
use std::process::Command;

use acceptance::chain::Chain;
use acceptance::printing::board_with;
use acceptance::process::{Process, SLACK};
use acceptance::programs::programs;
use acceptance::{ros, workspace};
use any_model::any_classifier;
use demo::closed_loop::{features, predictions};
use model::{ADC_RATE_HZ, HOP, STEP_RATE_HZ};
use pipeline::{Mains, Sample};
use rustix::process::Signal;
use serde::Deserialize;

use crate::inputs::synthetic;

/// Duration of the EEG in seconds, in the first ten of which the filters settle.
const SECONDS: usize = 14;
const HOPS: usize = SECONDS * STEP_RATE_HZ as usize / HOP;

/// Prediction as the integrator prints it.
#[derive(Debug, Deserialize)]
struct Printed {
    seq: u32,
    flags: String,
    soft: Vec<f64>,
    hard: Vec<i32>,
    classes: Vec<i32>,
}

/// Returns the board's synthetic EEG.
fn samples() -> impl Iterator<Item = Sample> {
    synthetic(7).take(SECONDS * usize::from(ADC_RATE_HZ))
}

/// Starts `integrate.py` on the bridge's default topic.
fn integrate(chain: &Chain<'_>, folder: &Path) -> Process {
    let script = workspace::root().join("tests/acceptance/ros/integrate.py");
    let mut python = chain.ros.command("python3");
    python.arg(script.canonicalize().expect("the script exists"));
    python.args(["/smr/neuroprediction/raw", "/smr/neuroprediction/integrated"]);
    let mut integrator = Process::start("integrator", &mut python, folder).expect("python3 starts");
    integrator
        .wait_until("rospy subscribes", SLACK, |integrator| integrator.output().contains("ready"));
    integrator
}

#[test]
fn an_integrator_gets_the_predictions_that_the_library_computes() {
    if !ros::available("predictions to an integrator") {
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let classifier = any_classifier(model::LABELS.split(' '));
    let file = folder.path().join("classifier.toml");
    let text = classifier.to_toml().expect("finite numbers");
    std::fs::write(&file, text).expect("a free disk");
    let file = file.display().to_string();
    let chain = Chain::start_with(folder.path(), &["--classifier", &file]);
    let mut integrator = integrate(&chain, folder.path());
    let duration = SECONDS.to_string();
    let mut board = chain.board(&["--input=synthetic", "--seed=7", "--duration", &duration]);
    assert!(board.wait(SLACK).success(), "{}", board.log());
    integrator.wait_until("all predictions", SLACK, |integrator| {
        integrator.output().lines().count() > HOPS
    });

    let output = integrator.output();
    let printed = output.lines().skip(1);
    let printed: Vec<Printed> =
        printed.map(|line| serde_json::from_str(line).expect("a prediction")).collect();
    let features = features(samples(), Mains::Hz50, &classifier);
    let expected = predictions(&features, &classifier);
    assert_eq!((printed.len(), features.len()), (HOPS, HOPS));
    for ((number, printed), (features, expected)) in
        (1..).zip(&printed).zip(features.iter().zip(&expected))
    {
        assert_eq!((printed.seq, &printed.classes[..]), (number, &[773, 771][..]));
        assert_eq!(printed.flags.contains("settling"), features.settling);
        for (soft, probability) in printed.soft.iter().zip(&expected.probabilities) {
            assert!((soft - f64::from(*probability)).abs() < 1e-6, "{printed:?}");
        }
        let hard = [0, 1].map(|class| i32::from(expected.class == Some(class)));
        assert_eq!(printed.hard, hard);
    }
    let chosen = expected.iter().filter(|of| of.class.is_some()).count();
    assert!(chosen > 16, "{chosen} hops with a chosen class");
    chain.stop();
}

#[test]
fn a_recording_of_features_is_converted_to_the_same_predictions() {
    let folder = tempfile::tempdir().expect("a folder");
    let [port, classifier_file, wire] =
        ["board", "classifier.toml", "run.wire"].map(|name| folder.path().join(name));
    let classifier = any_classifier(model::LABELS.split(' '));
    let text = classifier.to_toml().expect("finite numbers");
    std::fs::write(&classifier_file, text).expect("a free disk");
    let bridge = |word: &str| {
        let mut command = Command::new(&programs().bridge);
        command.arg(word).arg(&wire).env("CORTICODE_CONFIG", "/dev/null");
        command.arg("--classifier").arg(&classifier_file);
        command
    };
    let mut record = bridge("record");
    record.args(["--streams", "features", "--port"]).arg(&port);
    let recorder = Process::start("record", &mut record, folder.path()).expect("it starts");
    let output = format!("pty:{}", port.display());
    let options = ["--seed=7", "--fast", "--duration=14"];
    let mut board = board_with(folder.path(), &output, &options);
    assert!(board.wait(SLACK).success(), "{}", board.log());
    assert!(recorder.stop(Signal::TERM, SLACK).success());
    let convert = bridge("convert").args(["--to", "csv"]).output();
    let printed = String::from_utf8_lossy(&convert.expect("it starts").stderr).into_owned();
    assert!(printed.contains("; predictions: "), "{printed}");

    let table = std::fs::read_to_string(wire.with_extension("predictions.csv")).expect(&printed);
    let mut lines = table.lines();
    let classes = &classifier.decision.classes;
    let labels = format!(",{},{},decision", classes[0].event, classes[1].event);
    assert!(lines.next().is_some_and(|head| head.ends_with(&labels)), "{table}");
    let expected = predictions(&features(samples(), Mains::Hz50, &classifier), &classifier);
    // The last hops may still be on their way when the recorder is stopped.
    assert!(lines.clone().count() > HOPS - 16, "{printed}");
    for (line, expected) in lines.zip(&expected) {
        let values: Vec<f32> = line.split(',').skip(12).filter_map(|x| x.parse().ok()).collect();
        #[expect(clippy::cast_precision_loss, reason = "a small code")]
        let decision = expected.class.map_or(0.0, |class| classes[class].code as f32);
        assert_eq!(values, [&expected.probabilities[..], &[decision]].concat(), "{line}");
    }
}
