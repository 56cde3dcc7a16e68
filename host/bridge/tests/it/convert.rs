//! The subcommand `convert`: the rows of events after losses and a restart, and errors.
#![expect(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    reason = "numbers of rows, times and words are small and exact"
)]

use std::collections::HashMap;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use link::Streams;
use recordings::{Block, EventLabel, Recording};
use rustix::process::Signal;

use crate::board::{Board, assert_has};
use crate::device::Device;
use crate::packed_recording::{HOP_US, PackedRecording};
use crate::process::{Bridge, wait_for_bytes};
use crate::synthetic_recording::{Rig, TICKS_PER_SECOND};

/// Starts `convert` on a file.
pub(crate) fn convert(file: &Path, to: &str) -> Bridge {
    Bridge::start(&["convert", file.to_str().unwrap(), "--to", to])
}

/// A CSV file: its rows, and the index of each column by name.
pub(crate) struct Table {
    columns: HashMap<String, usize>,
    pub(crate) rows: Vec<Vec<String>>,
}

impl Table {
    pub(crate) fn read(path: &Path) -> Table {
        let text = std::fs::read_to_string(path).unwrap();
        let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned));
        let names = lines.next().unwrap();
        Table {
            columns: names.enumerate().map(|(at, name)| (name, at)).collect(),
            rows: lines.map(Iterator::collect).collect(),
        }
    }

    pub(crate) fn text(&self, row: usize, column: &str) -> &str {
        &self.rows[row][self.columns[column]]
    }

    pub(crate) fn number(&self, row: usize, column: &str) -> f64 {
        self.text(row, column).parse().unwrap()
    }

    pub(crate) fn is_filler(&self, row: usize) -> bool {
        self.number(row, "flags") >= 32_768.0
    }

    /// Returns the row of each event. A row with several events is returned once for each of them.
    pub(crate) fn events(&self) -> Vec<usize> {
        let rows = (0..self.rows.len()).flat_map(|row| {
            let events = self.text(row, "events").split(';');
            let events = events.filter(|event| !event.is_empty());
            events.map(move |_| row)
        });
        rows.collect()
    }
}

/// Returns the time of the signal in a row, in ticks of 1/512 s, which the simulated board encodes
/// in the row's values; `None` for a filler.
fn tick_of(table: &Table, stream: &str, row: usize) -> Option<f64> {
    if table.is_filler(row) {
        return None;
    }
    if stream != "codes" {
        // The first channel follows four columns and eight status words. 1 count is 22.351742 nV.
        let microvolts: f64 = table.rows[row][12].parse().unwrap();
        return Some((microvolts / 0.022_351_742).round());
    }
    let digits = (0..8).map(|place| {
        // The simulated board's code has scale 0.5 and zero point 1, so a level is 2 z + 1.
        let level = table.number(row, &format!("z{place:03}")) * 2.0 + 1.0;
        level * f64::from(1 << (4 * place))
    });
    Some(digits.sum())
}

fn recording(folder: &Path) -> (PathBuf, Vec<i64>) {
    let mut rig = Rig::new(5);
    rig.run(200, 7);
    rig.restart(1_700_000);
    rig.run(200, 7);
    // The second run began within a frame of samples, so this restart interrupts a frame too.
    rig.restart(777_777);
    rig.run(100, 7);
    assert!(rig.lost > 100, "{}", rig.lost);
    let times = rig.event_times_us.clone();
    (write(folder, rig.finish()), times)
}

#[test]
fn events_stand_at_their_samples_in_spite_of_loss_and_a_restart() {
    let folder = tempfile::tempdir().unwrap();
    let (path, times_us) = recording(folder.path());
    let log = convert(&path, "csv").success();
    assert_has(&log, [&format!("events: {}", times_us.len())]);
    // For each stream, the number of ticks (1/512 s) from one row to the next.
    for (stream, ticks) in [("raw", 1.0), ("filtered", 4.0), ("codes", 32.0)] {
        let table = Table::read(&folder.path().join(format!("session.{stream}.csv")));
        let events = table.events();
        assert_eq!(events.len(), times_us.len(), "{stream}");
        let (mut worst, mut checked) = (0.0_f64, 0);
        for (row, us) in events.into_iter().zip(&times_us) {
            // If the event's own sample is lost, look for the next row that is not a filler.
            let found =
                (row..table.rows.len()).find_map(|at| Some((at, tick_of(&table, stream, at)?)));
            let Some((at, tick)) = found else { continue };
            let tick = tick - (at - row) as f64 * ticks;
            let event = *us as f64 * TICKS_PER_SECOND as f64 / 1e6;
            // The pause of the restart is filled with whole rows, so later rows are off by a
            // fraction of a row.
            worst = worst.max((tick - event).abs() / ticks);
            checked += 1;
        }
        println!("{stream}: worst {worst} rows of {checked} events");
        assert!(checked >= times_us.len() - 1, "{stream}: {checked}");
        assert!(worst <= 1.1, "{stream}: {worst} rows");
        assert!((0..table.rows.len()).any(|row| table.is_filler(row)));
        // In every row, the time that the values encode agrees with the row's index.
        let mut at_start = None;
        for row in 0..table.rows.len() {
            let Some(tick) = tick_of(&table, stream, row) else {
                continue;
            };
            let start = *at_start.get_or_insert(tick - row as f64 * ticks);
            let off = (tick - start) / ticks - row as f64;
            assert!(off.abs() <= 1.0, "{stream}: row {row} is off by {off} rows");
        }
        // Messages arrive up to 9 ms late, and a gap is rounded to whole rows.
        let (start_s, most_s) = (table.number(0, "time_s"), 0.02 + ticks / 512.0);
        for row in 0..table.rows.len() {
            let off_s = table.number(row, "time_s") - start_s - row as f64 * ticks / 512.0;
            assert!(off_s.abs() < most_s, "{stream}: row {row} is stamped {off_s} s off");
        }
    }
}

#[test]
fn events_after_an_outage_longer_than_the_bridge_fills_stand_at_their_samples() {
    let folder = tempfile::tempdir().unwrap();
    let mut rig = Rig::new(5);
    rig.run(200, 7);
    // The bridge would fill only the first 2 minutes of missing samples; `convert` fills all.
    rig.restart(300_000_000);
    rig.run(200, 7);
    let times_us = rig.event_times_us.clone();
    let path = write(folder.path(), rig.finish());
    convert(&path, "gdf").success();
    let mut raw = Recording::open(folder.path().join("session.raw.gdf")).unwrap();
    let events = raw.events().unwrap();
    let events = events.iter();
    let events: Vec<usize> = events.map(|event| (event.onset_s * 512.0).round() as usize).collect();
    let flags = raw.labels().iter().position(|label| *label == "status");
    let (mut block, mut ticks) = (Block::default(), Vec::new());
    while raw.read_block(&mut block).unwrap() {
        let rows = block.samples[0].iter().zip(&block.samples[flags.unwrap()]);
        // The first channel holds the sample's time in ticks, as counts of 22.351742 nV.
        ticks.extend(rows.map(|(microvolts, flags)| {
            (*flags < 32_768.0).then_some((microvolts / 0.022_351_742).round())
        }));
    }
    assert!(ticks.len() > 320 * 512, "{} rows", ticks.len());
    assert_eq!(events.len(), times_us.len());
    for (row, us) in events.into_iter().zip(&times_us) {
        let found = (row..ticks.len()).find_map(|at| Some((at, ticks[at]?)));
        let Some((at, tick)) = found else { continue };
        let event = *us as f64 * TICKS_PER_SECOND as f64 / 1e6;
        let off = tick - (at - row) as f64 - event;
        assert!(off.abs() <= 1.1, "event at {us} us: {off} rows");
    }
}

#[test]
fn all_formats_hold_the_rows_and_events_of_csv() {
    let mut rig = Rig::new(5);
    rig.run(60, 7);
    rig.restart(1_700_000);
    rig.run(60, 7);
    all_formats_hold_the_same(rig, &["raw", "filtered", "codes", "reconstructed"]);
}

#[test]
fn rows_of_a_device_that_is_faster_than_the_host_are_whole_and_counted() {
    let mut rig = Rig::with(Streams::CODES | Streams::EVENTS, 100, 2);
    // The board sends 150 s of signal in 1.5 s. Each code, lost or not, is one row of the codes and
    // eight rows of the reconstructed signals.
    rig.run(2_400, 70);
    let lost = rig.lost;
    let log = all_formats_hold_the_same(rig, &["codes", "reconstructed"]);
    assert_has(&log, ["session.codes.npz: 2400 rows", "reconstructed.npz: 19200 rows"]);
    assert_has(&log, [&format!("lost {lost} "), "s of the host's time: "]);
    assert!(lost > 20 && !log.contains("rows are not filled"), "{lost} {log}");
}

/// Converts a recording to all formats, and compares the files of each stream with the CSV file.
/// Returns the log of the last conversion.
fn all_formats_hold_the_same(rig: Rig, streams: &[&str]) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), rig.finish());
    let mut last = String::new();
    for to in ["csv", "gdf", "bdf", "npz"] {
        last = convert(&path, to).success();
    }
    for stream in streams {
        let file = |to| folder.path().join(format!("session.{stream}.{to}"));
        let table = Table::read(&file("csv"));
        assert!(last.contains(&format!("{stream}.npz: {} rows", table.rows.len())), "{last}");
        // The last argument is the tolerance in microvolts: none for GDF, because CSV holds enough
        // digits for a float32; for BDF the rounding to 24 bits of +-187,500 uV.
        compare(&table, Recording::open(file("gdf")).unwrap(), 0, 0.0);
        compare(&table, Recording::open(file("bdf")).unwrap(), 1, 0.012);
        compare_arrays(&table, &file("npz"));
    }
    last
}

/// Compares the first and the last channel, the signals `trigger` and `status`, and the events of a
/// file with a table. The file has `more` further signals after these two.
fn compare(table: &Table, mut recording: Recording, more: usize, tolerance: f64) {
    let rate_hz = recording.signals()[0].rate.unwrap().value();
    let events = recording.events().unwrap().into_iter().map(|event| {
        let text = EventLabel::Text("trigger high".to_owned());
        assert!([EventLabel::Type(1), text].contains(&event.label));
        (event.onset_s * rate_hz).round() as usize
    });
    assert_eq!(events.collect::<Vec<_>>(), table.events());
    let labels: Vec<String> = recording.labels().into_iter().map(str::to_owned).collect();
    let end = labels.len() - more;
    let (mut block, mut row) = (Block::default(), 0);
    while recording.read_block(&mut block).unwrap() {
        let rows = block.samples[0].len();
        assert_eq!(labels[end - 2..end], ["trigger", "status"]);
        for signal in [0, end - 3, end - 2, end - 1] {
            let label = match &*labels[signal] {
                "status" => "flags",
                label => label,
            };
            for (at, value) in (row..).zip(&block.samples[signal]) {
                let written = table.number(at, label);
                let limit = tolerance + 1e-6 * written.abs();
                assert!((value - written).abs() <= limit, "{label} {at}");
            }
        }
        row += rows;
    }
    assert_eq!(row, table.rows.len());
}

/// Compares an NPZ file with a table: times, one status word and the first channel of all rows.
fn compare_arrays(table: &Table, path: &Path) {
    let mut archive = zip::ZipArchive::new(File::open(path).unwrap()).unwrap();
    assert_eq!(archive.len(), 5);
    let mut read = |name| {
        let mut bytes = Vec::new();
        let mut file = archive.by_name(name).unwrap();
        file.read_to_end(&mut bytes).unwrap();
        assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00");
        let start = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        assert!(start.is_multiple_of(64) && bytes[start - 1] == b'\n');
        let header = String::from_utf8(bytes[10..start].to_vec()).unwrap();
        (header, bytes.split_off(start))
    };
    let (header, rows) = read("rows.npy");
    let count = table.rows.len();
    assert!(header.contains(&format!("'shape': ({count},)")), "{header}");
    let width = rows.len() / count;
    assert_eq!(width * count, rows.len());
    // A row has 16 bytes of times, 16 bytes of status words, and 4 bytes for each value. Of the
    // table's columns, twelve are not values: four, and the eight status words.
    assert_eq!(width, 16 + 16 + 4 * (table.columns.len() - 12));
    for (row, bytes) in rows.chunks(width).enumerate() {
        let time_ns = i64::from_le_bytes(bytes[..8].try_into().unwrap());
        let whole = format!("{}.{:09}", time_ns / 1_000_000_000, time_ns % 1_000_000_000);
        assert_eq!(whole, table.text(row, "time_s"));
        let flags = u16::from_le_bytes(bytes[16..18].try_into().unwrap());
        assert_eq!(f64::from(flags), table.number(row, "flags"));
        let value = f32::from_le_bytes(bytes[32..36].try_into().unwrap());
        assert_eq!(value.to_string(), table.rows[row][12]);
    }
    let (header, events) = read("events.npy");
    assert_has(&header, [&format!("'shape': ({},)", table.events().len())]);
    let rows = events.chunks(26).map(|event| {
        let row = u64::from_le_bytes(event[..8].try_into().unwrap());
        usize::try_from(row).unwrap()
    });
    assert_eq!(rows.collect::<Vec<_>>(), table.events());
}

#[test]
fn a_file_that_was_cut_off_is_converted_to_its_last_whole_record() {
    let folder = tempfile::tempdir().unwrap();
    let (path, _) = recording(folder.path());
    let bytes = std::fs::read(&path).unwrap();
    let path = folder.path().join("cut.wire");
    std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    let log = convert(&path, "csv").success();
    assert!(log.contains("was not ended: its last"), "{log}");
    let log = convert(&path, "csv").failure(2);
    assert!(log.contains("cut.codes.csv exists already"), "{log}");
    let codes = folder.path().join("cut.codes.csv");
    let whole = std::fs::read(&codes).unwrap();
    std::fs::write(&codes, "mine").unwrap();
    let file = path.to_str().unwrap();
    let again = Bridge::start(&["convert", file, "--to", "csv", "--force"]);
    again.success();
    assert_eq!(std::fs::read(&codes).unwrap(), whole);
    let files = std::fs::read_dir(folder.path()).unwrap().flatten();
    let names: Vec<_> = files.map(|file| file.file_name()).collect();
    let is_temporary = |name: &std::ffi::OsString| name.to_string_lossy().starts_with('.');
    assert!(!names.iter().any(is_temporary), "{names:?}");
}

#[test]
fn what_is_no_recording_has_an_error_that_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("file");
    let header = Rig::new(0).finish()[..28].to_vec();
    let mut newer = header.clone();
    newer[8] = 9;
    let edf = b"0       a recording in EDF";
    for (content, expected) in [
        (&edf[..], "is not a recording of corticode-bridge"),
        (&header[..20], "ended before it could write"),
        (&newer[..], "version 9"),
        (&header[..], "no codes or samples"),
    ] {
        std::fs::write(&path, content).unwrap();
        let log = convert(&path, "csv").failure(2);
        assert!(log.contains(expected), "{log}");
    }
    let log = convert(&folder.path().join("absent"), "csv").failure(2);
    assert!(log.contains("No such file"), "{log}");
}

#[test]
fn codes_that_replaced_refused_packed_blocks_are_decoded() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("session.wire");
    let without_packed = Streams::ALL.without(Streams::PACKED);
    let device = Device::tcp(Board::supporting(without_packed));
    let file = path.to_str().unwrap();
    let options = ["--streams=packed", "--packed-rate=4"];
    let arguments = ["record", file, "--port", &device.port];
    let recorder = Bridge::start(&[arguments.as_slice(), &options].concat());
    wait_for_bytes(&path, 20_000);
    let log = recorder.end(Signal::TERM);
    let refused = "refuses the rate 4 of the packed code";
    assert_has(&log, ["WARN", refused, "choose no rate"]);
    let log = convert(&path, "csv").success();
    let [codes, signals] = ["codes", "reconstructed"]
        .map(|stream| Table::read(&folder.path().join(format!("session.{stream}.csv"))));
    assert!(codes.rows.len() > 50, "{log}");
    assert_eq!(signals.rows.len(), 8 * codes.rows.len(), "{log}");
}

fn write(folder: &Path, bytes: Vec<u8>) -> PathBuf {
    let path = folder.join("session.wire");
    std::fs::write(&path, bytes).unwrap();
    path
}

/// Converts the file of a recording, and returns the rows of its reconstructed signals.
fn signals(file: Vec<u8>) -> Table {
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), file);
    convert(&path, "csv").success();
    Table::read(&folder.path().join("session.reconstructed.csv"))
}

#[test]
fn a_recording_of_another_model_has_an_error_that_names_the_model() {
    let mut recording = PackedRecording::new(Board::of_another_model(), Streams::PACKED);
    for _ in 0..20 {
        recording.hop();
    }
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), recording.finish());
    let log = convert(&path, "csv").failure(2);
    assert_has(&log, ["--model and the folder of model 0909090909090909"]);
    assert!(!log.contains("record again"), "{log}");
}

#[test]
fn every_block_has_rows_also_where_the_recording_was_not_ended() {
    let recording = || {
        let mut recording = PackedRecording::new(Board::new(), Streams::PACKED);
        for _ in 0..20 {
            recording.hop();
        }
        recording
    };
    assert_eq!(signals(recording().finish()).rows.len(), 160);
    assert_eq!(signals(recording().cut_off()).rows.len(), 160);
}

#[test]
fn events_beside_a_restart_stand_at_their_rows() {
    let streams = Streams::PACKED | Streams::EVENTS;
    let mut recording = PackedRecording::new(Board::new(), streams);
    for _ in 0..20 {
        recording.hop();
    }
    // The filters delay the signal, so the last row belongs to the time 10 ms ago. Rows are 7.8 ms
    // apart, so an event 20 ms ago belongs to an earlier row.
    recording.event(20_000);
    recording.restart(8 * HOP_US);
    for _ in 0..20 {
        recording.hop();
        recording.event(0);
    }
    let table = signals(recording.finish());
    let fillers = (0..table.rows.len()).filter(|row| table.is_filler(*row));
    assert!(fillers.eq(160..224));
    // The last event is later than every row, so no row has it.
    let after = (0..19).map(|block| 224 + 8 * block + 9);
    let expected: Vec<usize> = std::iter::once(158).chain(after).collect();
    assert_eq!(table.events(), expected);
}

#[test]
fn a_bdf_file_states_its_start_in_local_time() {
    let folder = tempfile::tempdir().unwrap();
    // The recordings of these tests start at 22:13:20 UTC on 14 November 2023.
    for (zone, start) in
        [("UTC0", "14.11.2322.13.2"), ("EST5", "14.11.2317.13.2"), ("Nowhere/City", "")]
    {
        let mut rig = Rig::with(Streams::CODES, 1, 0);
        rig.run(20, 10);
        let path = write(folder.path(), rig.finish());
        let arguments = ["convert", path.to_str().unwrap(), "--to", "bdf", "--force"];
        let bridge = Bridge::start_with(&arguments, &[("TZ", zone)]);
        if start.is_empty() {
            assert_has(&bridge.failure(2), ["the variable TZ names is not known"]);
            continue;
        }
        bridge.success();
        let file = std::fs::read(path.with_extension("codes.bdf")).unwrap();
        assert_eq!(&file[168..183], start.as_bytes(), "{zone}");
    }
}
