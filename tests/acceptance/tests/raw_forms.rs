//! Compressed samples reach a user as the samples themselves do: live, recorded, replayed, converted, and after
//! losses.
#![forbid(unsafe_code)]

use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use acceptance::lossy_cable::LossyCable;
use acceptance::port::free_port;
use acceptance::process::Process;
use acceptance::programs::programs;
use host_sim::synthetic::{Generator, SyntheticSpec};
use model::{ADC_RATE_HZ, CHANNELS, LSB_NV};
use rustix::process::Signal;
use serde_json::Value;

/// Duration of the EEG in seconds.
const SECONDS: usize = 6;
/// Longest wait for a program on a busy machine.
const SLACK: Duration = Duration::from_mins(1);
/// The flag of a row that replaces a lost one.
const FILLER: f64 = 32_768.0;

/// A sample as a user gets it: its values, those of the spare channels last, and whether it is a filler.
type Row = (Vec<f32>, bool);

/// Returns the samples of the synthetic EEG, uV.
fn expected() -> Vec<Vec<f32>> {
    let spec = SyntheticSpec::new(7, model::LABELS.split(' '));
    let generator = Generator::new(&spec).expect("the model's electrodes");
    let uv = f64::from(LSB_NV) * 1e-3;
    #[expect(clippy::cast_possible_truncation, reason = "as the bridge does")]
    let row = |counts: [i32; CHANNELS]| counts.map(|count| (f64::from(count) * uv) as f32).to_vec();
    let samples = SECONDS * usize::from(ADC_RATE_HZ);
    generator.take(samples).map(row).collect()
}

/// Starts `host-sim run` with the synthetic EEG.
fn board(folder: &Path, output: &str) -> Process {
    let mut board = Command::new(&programs().host_sim);
    let duration = format!("--duration={SECONDS}");
    board.args([
        "run",
        "--input=synthetic",
        "--seed=7",
        "--realtime",
        &duration,
    ]);
    board.arg(format!("--output={output}"));
    Process::start("board", &mut board, folder).expect("host-sim starts")
}

fn bridge(folder: &Path, name: &str, arguments: &[&str]) -> Process {
    let mut bridge = Command::new(&programs().bridge);
    bridge.args(arguments).env("CORTICODE_CONFIG", "/dev/null");
    Process::start(name, &mut bridge, folder).expect("the bridge starts")
}

/// Starts a bridge that prints the samples of the device at `port`.
fn printing(folder: &Path, port: &str, form: &str) -> Process {
    let form = format!("--raw-form={form}");
    let arguments = [
        "--sink=ndjson",
        "--streams=codes,raw",
        &form,
        "--port",
        port,
    ];
    bridge(folder, "printing", &arguments)
}

/// Returns the samples in lines of JSON.
fn printed(lines: &str) -> Vec<Row> {
    let mut rows = Vec::new();
    for line in lines.lines().filter(|line| line.contains("\"/neurodata\"")) {
        let message: Value = serde_json::from_str(line).expect("JSON");
        let block = |name: &str| {
            let data = message["message"][name]["data"].as_array().expect("a list");
            let numbers = data.iter().map(|value| value.as_f64().expect("a number"));
            numbers.collect::<Vec<f64>>()
        };
        let (eeg, exg, tri) = (block("eeg"), block("exg"), block("tri"));
        let samples = tri.len() / 8;
        let parts = eeg
            .chunks(eeg.len() / samples)
            .zip(exg.chunks(exg.len() / samples));
        for ((eeg, exg), words) in parts.zip(tri.chunks(8)) {
            #[expect(clippy::cast_possible_truncation, reason = "printed from a float32")]
            let values = eeg.iter().chain(exg).map(|value| *value as f32);
            rows.push((values.collect(), words[0] >= FILLER));
        }
    }
    rows
}

/// Ends a bridge, and returns the samples that it has printed.
fn stop(bridge: Process, folder: &Path) -> Vec<Row> {
    let log = bridge.errors();
    let status = bridge.stop(Signal::TERM, SLACK);
    assert!(status.success(), "{log}");
    printed(&fs::read_to_string(folder.join("printing.out")).expect("its output"))
}

fn assert_exact(rows: &[Row], expected: &[Vec<f32>]) {
    assert_eq!(rows.len(), expected.len());
    for (index, ((values, is_filler), expected)) in rows.iter().zip(expected).enumerate() {
        assert!(!is_filler, "sample {index}");
        assert_eq!(values, expected, "sample {index}");
    }
}

#[test]
fn both_forms_of_the_samples_yield_the_same_frames() {
    let expected = expected();
    for (form, asked) in [("compressed", "compressed-raw"), ("any", " raw")] {
        let folder = tempfile::tempdir().expect("a folder");
        let folder = folder.path();
        let port = folder.join("board").display().to_string();
        let mut printing = printing(folder, &port, form);
        let ended = board(folder, &format!("pty:{port}")).wait(SLACK);
        assert!(ended.success());
        printing.wait_until("all samples", SLACK, |bridge| {
            printed(&bridge.output()).len() >= expected.len()
        });
        let log = printing.errors();
        assert!(log.contains(asked), "{log}");
        assert_exact(&stop(printing, folder), &expected);
    }
}

#[test]
fn a_recording_of_compressed_samples_is_replayed_and_converted() {
    let expected = expected();
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let port = folder.join("board").display().to_string();
    let file = folder.join("run.wire").display().to_string();
    let recording = bridge(
        folder,
        "recording",
        &[
            "record",
            &file,
            "--streams=codes,raw",
            "--raw-form=compressed",
            "--port",
            &port,
        ],
    );
    assert!(board(folder, &format!("pty:{port}")).wait(SLACK).success());
    // The last bytes are on their way.
    std::thread::sleep(Duration::from_secs(1));
    assert!(recording.stop(Signal::INT, SLACK).success());

    let output = format!("pty:{port}");
    let mut replaying = bridge(folder, "replaying", &["replay", &file, "--output", &output]);
    replaying.wait_until("a port", SLACK, |_| Path::new(&port).exists());
    let printing = printing(folder, &port, "any");
    assert!(replaying.wait(SLACK).success(), "{}", replaying.log());
    assert_exact(&stop(printing, folder), &expected);

    let mut converting = bridge(folder, "converting", &["convert", &file, "--to=csv"]);
    assert!(converting.wait(SLACK).success(), "{}", converting.log());
    let table = fs::read_to_string(folder.join("run.raw.csv")).expect("a table");
    let mut lines = table.lines();
    let names: Vec<&str> = lines.next().expect("names").split(',').collect();
    let labels = model::LABELS.split(' ').chain(["exg1", "exg2", "exg3"]);
    let columns = labels.map(|label| names.iter().position(|name| *name == label));
    let columns: Vec<usize> = columns.map(|column| column.expect("a column")).collect();
    let rows = lines.map(|line| {
        let cells: Vec<&str> = line.split(',').collect();
        let values = columns
            .iter()
            .map(|column| cells[*column].parse().expect("a number"));
        (values.collect(), false)
    });
    assert_exact(&rows.collect::<Vec<Row>>(), &expected);
}

#[test]
fn after_lost_frames_every_sample_is_exact_or_a_filler() {
    let expected = expected();
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let port = free_port().expect("a free port");
    let board = board(folder, &format!("tcp:127.0.0.1:{port}"));
    let cable = LossyCable::new(port, 2).expect("a connection");
    let mut printing = printing(folder, &cable.port, "compressed");
    printing.wait_until("most samples", SLACK, |bridge| {
        printed(&bridge.output()).len() + 256 >= expected.len()
    });
    std::thread::sleep(Duration::from_millis(500));
    drop(board);
    let rows = stop(printing, folder);
    assert!(rows.len() <= expected.len());
    let fillers = rows.iter().filter(|(_, is_filler)| *is_filler).count();
    println!("{fillers} of {} samples are fillers", rows.len());
    assert!(fillers > 0 && fillers < rows.len(), "{fillers}");
    for (index, ((values, is_filler), expected)) in rows.iter().zip(&expected).enumerate() {
        assert!(*is_filler || values == expected, "sample {index}");
    }
}
