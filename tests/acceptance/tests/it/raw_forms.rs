//! A user gets compressed samples with the same values as uncompressed ones: live, recorded,
//! replayed, converted, and after losses.

use std::path::Path;
use std::time::Duration;

use acceptance::files::Table;
use acceptance::lossy_cable::LossyCable;
use acceptance::port::free_port;
use acceptance::printing::{self, board, values};
use acceptance::process::{Process, SLACK};
use model::{ADC_RATE_HZ, CHANNELS, LSB_NV};

use crate::inputs::synthetic;

/// Duration of the EEG that the board samples, in seconds.
const SECONDS: usize = 6;
/// Smallest value of the status word `flags` in which the highest bit is set; this bit marks a
/// filler, which replaces a lost sample.
const FILLER: f32 = 32_768.0;

/// One sample as the bridge prints it: its values, with the spare channels last, and whether it is
/// a filler.
type Row = (Vec<f32>, bool);

/// Returns the samples of the board's synthetic EEG, in uV.
fn expected() -> Vec<Vec<f32>> {
    let uv = f64::from(LSB_NV) * 1e-3;
    #[expect(clippy::cast_possible_truncation, reason = "as the bridge does")]
    let row = |counts: [i32; CHANNELS]| counts.map(|count| (f64::from(count) * uv) as f32).to_vec();
    let samples = SECONDS * usize::from(ADC_RATE_HZ);
    let samples = synthetic(7).take(samples);
    samples.map(|sample| row(sample.counts)).collect()
}

/// Starts a bridge with `--raw-form` set to `form`; it prints the samples of the board at `port`.
fn print_samples(folder: &Path, port: &str, form: &str) -> Process {
    let form = format!("--raw-form={form}");
    printing::print(folder, port, &["--streams=codes,raw", &form])
}

/// Returns the samples in the JSON lines that a bridge has printed.
fn printed(lines: &str) -> Vec<Row> {
    let mut rows = Vec::new();
    for message in printing::messages(lines, "/neurodata") {
        let [eeg, exg, tri] = ["eeg", "exg", "tri"].map(|name| values(&message, name));
        let samples = tri.len() / 8;
        let parts = eeg.chunks(eeg.len() / samples).zip(exg.chunks(exg.len() / samples));
        for ((eeg, exg), words) in parts.zip(tri.chunks(8)) {
            rows.push(([eeg, exg].concat(), words[0] >= FILLER));
        }
    }
    rows
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
        let mut printing = print_samples(folder, &port, form);
        let ended = board(folder, SECONDS, &format!("pty:{port}")).wait(SLACK);
        assert!(ended.success());
        printing.wait_until("all samples", SLACK, |bridge| {
            printed(&bridge.output()).len() >= expected.len()
        });
        let log = printing.errors();
        assert!(log.contains(asked), "{log}");
        let [lines, _] = printing::stop(printing, folder);
        assert_exact(&printed(&lines), &expected);
    }
}

#[test]
fn a_recording_of_compressed_samples_is_replayed_and_converted() {
    let expected = expected();
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let options = ["--streams=codes,raw", "--raw-form=compressed"];
    let replay = ["--streams=codes,raw", "--raw-form=any"];
    let [_, _, lines] = printing::record_and_replay(folder, SECONDS, &options, &replay);
    assert_exact(&printed(&lines), &expected);
    let table = Table::read(&folder.join("run.raw.csv"));
    let names = model::LABELS.split(' ').chain(["exg1", "exg2", "exg3"]);
    let rows = table.numbers(&names.collect::<Vec<_>>());
    let rows: Vec<Row> = rows.map(|values| (values, false)).collect();
    assert_exact(&rows, &expected);
}

#[test]
fn after_lost_frames_every_sample_is_exact_or_a_filler() {
    let expected = expected();
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let port = free_port().expect("a free port");
    let board = board(folder, SECONDS, &format!("tcp:127.0.0.1:{port}"));
    let cable = LossyCable::new(port, 2).expect("a connection");
    let mut printing = print_samples(folder, &cable.port, "compressed");
    printing.wait_until("most samples", SLACK, |bridge| {
        printed(&bridge.output()).len() + 256 >= expected.len()
    });
    std::thread::sleep(Duration::from_millis(500));
    drop(board);
    let [lines, _] = printing::stop(printing, folder);
    let rows = printed(&lines);
    assert!(rows.len() <= expected.len());
    let fillers = rows.iter().filter(|(_, is_filler)| *is_filler).count();
    println!("{fillers} of {} samples are fillers", rows.len());
    assert!(fillers > 0 && fillers < rows.len(), "{fillers}");
    for (index, ((values, is_filler), expected)) in rows.iter().zip(&expected).enumerate() {
        assert!(*is_filler || values == expected, "sample {index}");
    }
}
