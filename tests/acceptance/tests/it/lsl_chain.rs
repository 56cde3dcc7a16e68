//! The streams of `--sink lsl`, as pylsl receives them and pyxdf reads them back from a file.

use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use acceptance::lsl_recording::{LslRecording, LslSignal, start as python, unique};
use acceptance::printing::{bridge, messages};
use acceptance::process::Process;
use acceptance::programs::programs;
use acceptance::wheels::{self, liblsl};
use lsl::{Library, Lsl, LslOptions, StampPoint, StreamKind};
use neuro_ros::{NeuroDataInfo, NeuroFrame, Sink};
use rustix::process::Signal;
use serde_json::Value;

/// Longest wait for a program to end or to reach a condition, enough on a busy machine.
const SLACK: Duration = Duration::from_mins(1);
/// Duration of each of the two runs of the board, seconds.
const SECONDS: [&str; 2] = ["9", "8"];
/// Largest permitted error of the time of a frame's first sample, seconds.
const FIRST_TOLERANCE_S: f64 = 1e-3;
/// Largest permitted error of any sample's time, and of the offset between the clocks, seconds. The
/// times of the samples after the first one of a frame follow from the measured rate, which is up
/// to 4 % wrong while the fit of the board's clock settles; that takes long on a busy machine.
const TOLERANCE_S: f64 = 5e-3;
/// Flag of a sample that replaces a lost one.
const FILLER: u64 = 0x8000;
/// Streams with regular samples: name, topic, rate in Hz.
const SIGNALS: [(&str, &str, f64); 4] = [
    ("codes", "/encoded", 16.0),
    ("reconstructed", "/neurodata_reconstructed", 128.0),
    ("filtered", "/neurodata_corticode", 128.0),
    ("raw", "/neurodata", 512.0),
];

/// Starts a simulated board on a pseudoterminal.
fn board(folder: &Path, name: &str, port: &str, seconds: &str, more: &[&str]) -> Process {
    let mut board = Command::new(&programs().host_sim);
    board
        .args(["run", "--input=synthetic", "--seed=7", "--realtime"])
        .args(["--duration", seconds, "--output", &format!("pty:{port}")])
        .args(more);
    Process::start(name, &mut board, folder).expect("host-sim starts")
}

/// Starts a bridge whose streams have names that start with `name`.
fn streaming(folder: &Path, liblsl: &Path, name: &str, port: &str, more: &[&str]) -> Process {
    let library = liblsl.display().to_string();
    let arguments = ["--port", port, "--liblsl", &library, "--lsl-name", name];
    bridge(folder, name, &[&arguments[..], more].concat())
}

/// One sample of a frame in a JSON line.
struct Row {
    wall_s: f64,
    /// Whether the sample is the first of its frame.
    is_first: bool,
    values: Vec<f32>,
    is_filler: bool,
}

/// Returns the samples of a topic, each with its wall-clock time: its frame's stamp plus its offset
/// in the frame at the nominal rate. A rate error of 300 ppm changes this offset by up to 19 us.
fn rows(lines: &str, topic: &str, rate_hz: f64) -> Vec<Row> {
    let numbers = |block: &Value| -> Vec<f32> {
        let values = block["data"].as_array().into_iter().flatten();
        #[expect(clippy::cast_possible_truncation, reason = "printed from a float32")]
        values.map(|value| value.as_f64().expect("a number") as f32).collect()
    };
    let frames = messages(lines, topic).map(|frame| {
        let stamp = &frame["header"]["stamp"];
        let part = |name: &str| stamp[name].as_f64().expect("a number");
        let stamp_s = part("secs") + part("nsecs") * 1e-9;
        let tri = frame["tri"]["data"].as_array().expect("words");
        let [eeg, exg] = ["eeg", "exg"].map(|block| numbers(&frame[block]));
        let samples = tri.len() / 8;
        let rows = tri.chunks(8).zip(0_u32..).map(|(words, row)| {
            let of = |values: &[f32]| {
                let width = values.len() / samples;
                values[row as usize * width..][..width].to_vec()
            };
            Row {
                wall_s: stamp_s + f64::from(row) / rate_hz,
                is_first: row == 0,
                values: [of(&eeg), of(&exg)].concat(),
                is_filler: words[0].as_u64().expect("a word") & FILLER != 0,
            }
        });
        rows.collect::<Vec<Row>>()
    });
    frames.flatten().collect()
}

/// Checks one stream against the JSON lines. Returns the number of recorded samples, and the
/// largest error of the time of a frame's first sample, seconds.
fn check_signal(
    recording: &LslRecording,
    lines: &str,
    (stream, topic, rate_hz): (&str, &str, f64),
) -> (u32, f64) {
    let recorded = &recording.described;
    let described = &recorded["streams"][stream];
    assert_eq!(described["rate"], rate_hz, "{stream}");
    let sent = rows(lines, topic, rate_hz);
    let LslSignal { times, values, channels } = recording.signal(stream);

    // Find the first recorded sample by its time and values; from there on, none may be missing.
    let offset_s = recorded["wall_minus_lsl"].as_f64().expect("a number");
    let correction_s = described["corrections"][0].as_f64().expect("a number");
    assert!(correction_s.abs() < TOLERANCE_S, "{correction_s} s on one machine");
    // Do not apply the correction: both programs use one clock, so it is only a measurement error.
    let wall_s = |time: f64| time + offset_s;
    let near = |row: &Row| {
        let error_s = (row.wall_s - wall_s(times[0])).abs();
        error_s < 0.05 && row.values == values[..channels]
    };
    let first = sent.iter().position(near).expect("the first sample");
    let sent = &sent[first..];
    assert_eq!(times.len(), sent.len(), "{stream}: samples since the first one");
    let mut worst_s: f64 = 0.0;
    let mut newest_s = f64::NEG_INFINITY;
    for ((row, time), values) in sent.iter().zip(&times).zip(values.chunks(channels)) {
        assert_eq!(row.values, values, "{stream} at {time}");
        assert!(*time > newest_s, "{stream}: {time} after {newest_s}");
        // A sample before which the clock's fit has stepped back is moved to the one before it.
        let error_s = (row.wall_s.max(wall_s(newest_s)) - wall_s(*time)).abs();
        newest_s = *time;
        // Fillers are closer to each other where a gap is shorter than they would be.
        let is_placed = row.is_first || !row.is_filler;
        assert!(!is_placed || error_s < TOLERANCE_S, "{stream} at {time}: {error_s} s");
        if row.is_first {
            worst_s = worst_s.max(error_s);
        }
    }
    assert!(worst_s < FIRST_TOLERANCE_S, "{stream}: {worst_s} s");
    let samples = u32::try_from(times.len()).expect("some thousand");
    (samples, worst_s)
}

/// Checks the labels, units and positions of a stream of electrodes.
fn check_channels(described: &Value) {
    let channels = described["channels"].as_array().expect("channels");
    let labels = model::LABELS.split(' ');
    for (channel, label) in channels.iter().zip(labels) {
        assert_eq!(channel["label"], label);
        assert_eq!(channel["unit"], "microvolts");
        assert_eq!(channel["type"], "EEG");
        let axis = |name| channel["location"][name].as_f64().expect("millimetres");
        let radius = ["X", "Y", "Z"].map(axis).map(|mm| mm * mm).iter().sum::<f64>();
        assert!((radius.sqrt() - 95.0).abs() < 0.1, "{label}: {radius}");
    }
    let axis = |label: &str, name: &str| {
        let channel = channels.iter().find(|channel| channel["label"] == label);
        channel.expect("an electrode")["location"][name].as_f64().expect("mm")
    };
    // X is positive to the right, Y to the front and Z to the top.
    assert!(axis("C4", "X") > 40.0 && axis("C3", "X") < -40.0);
    assert!(axis("Fz", "Y") > 40.0 && axis("Pz", "Y") < -40.0);
    assert!((axis("Cz", "Z") - 95.0).abs() < 0.1);
    assert_eq!(described["drops"], "false");
    assert_eq!(described["model"], "host-sim");
}

/// Checks that pyxdf reads all events and the streams' rates from the file, and that each beginning
/// and end of fillers has an event at its time. Returns the number of beginnings and ends.
fn check_file(recorded: &Value, name: &str, lines: &str) -> usize {
    let events = &recorded["streams"]["events"];
    let marks = events["markers"].as_array().expect("markers");
    let read_back = &recorded["xdf"][format!("{name}-events")];
    assert_eq!(read_back["samples"], marks.len());
    let mut checked = 0;
    for (stream, topic, rate_hz) in SIGNALS {
        let sent = rows(lines, topic, rate_hz);
        let offset_s = recorded["wall_minus_lsl"].as_f64().expect("a number");
        let of_file = &recorded["xdf"][format!("{name}-{stream}")];
        let rate = of_file["rate"].as_f64().expect("a rate");
        assert!((rate / rate_hz - 1.0).abs() < 0.01, "{stream}: {rate} Hz");
        let changes = sent.windows(2).filter_map(|pair| {
            let [before, row] = pair else { return None };
            (before.is_filler != row.is_filler).then_some(row)
        });
        for row in changes {
            let change = if row.is_filler { "begin" } else { "end" };
            let text = format!("filler {change} {stream}");
            let at = |mark: &&Value| {
                let time = mark[0].as_f64().expect("a time") + offset_s;
                mark[1] == text && (time - row.wall_s).abs() < TOLERANCE_S
            };
            assert!(marks.iter().any(|mark| at(&mark)), "{text} at {}: {marks:?}", row.wall_s);
            checked += 1;
        }
    }
    let texts = read_back["texts"].as_array().expect("texts");
    assert!(texts.contains(&Value::from("trigger high")), "{texts:?}");
    checked
}

#[test]
fn every_sample_is_received_at_its_time_also_after_a_restart_of_the_board() {
    let Some(interpreter) = wheels::python("streams of the Lab Streaming Layer") else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let port = folder.join("board-port").display().to_string();
    let name = unique("chain");
    let library = liblsl(&interpreter);
    let options = ["--sink=lsl,ndjson", "--streams=codes,raw,filtered,events"];
    let bridge = streaming(folder, &library, &name, &port, &options);
    let start = |number: usize, more: &[&str]| {
        let of = format!("board{number}");
        let trigger = [&["--trigger-every=0.7"], more].concat();
        board(folder, &of, &port, SECONDS[number], &trigger)
    };
    let mut first = start(0, &[]);
    let streams = ["codes", "reconstructed", "filtered", "raw", "events"];
    let arguments = [&[folder.to_str().expect("UTF-8"), &name], &streams[..]].concat();
    let mut recorder = python(&interpreter, folder, "lsl_record", &arguments);
    let raw = format!("{name}-raw");
    let mut stuck = python(&interpreter, folder, "lsl_subscribe", &[&raw]);
    stuck.wait_until("a subscription", SLACK, |stuck| !stuck.output().is_empty());
    // Stop this subscriber, so that nothing takes its samples from its socket.
    stuck.signal(Signal::STOP);
    recorder.wait_until("all streams", SLACK, |recorder| !recorder.output().is_empty());
    assert!(first.wait(SLACK).success(), "{}", first.log());
    // The second board's clock is fast, and the bridge fills the time between the two boards'
    // streams with fillers.
    let mut second = start(1, &["--clock-ppm=300"]);
    assert!(second.wait(SLACK).success(), "{}", second.log());
    std::thread::sleep(Duration::from_secs(1));

    let outputs = ["out", "err"].map(|end| folder.join(&name).with_extension(end));
    assert!(bridge.stop(Signal::TERM, SLACK).success());
    let [lines, log] = outputs.map(|file| fs::read_to_string(file).expect("an output"));
    assert!(recorder.wait(SLACK).success(), "{}", recorder.log());
    assert!(log.contains("lsl dropped 0"), "{log}");
    assert!(log.contains("ndjson dropped 0"), "{log}");

    let recording = LslRecording::read(folder);
    let recorded = &recording.described;
    for signal in SIGNALS {
        let (samples, worst_s) = check_signal(&recording, &lines, signal);
        println!("{}: {samples} samples, times within {:.0} us", signal.0, worst_s * 1e6);
        assert!(f64::from(samples) > 8.0 * signal.2, "{}: {samples}", signal.0);
    }
    for stream in ["raw", "filtered", "reconstructed"] {
        check_channels(&recorded["streams"][stream]);
    }
    let codes = &recorded["streams"]["codes"];
    assert_eq!(codes["channels"].as_array().map(Vec::len), Some(model::CODE));
    let serial = recorded["streams"]["raw"]["serial"].as_str().expect("a number");
    assert_eq!(recorded["streams"]["raw"]["source_id"], format!("{name}:{serial}:raw"));
    assert_eq!(recorded["streams"]["raw"]["lag_s"], 0.0);
    assert!(check_file(recorded, &name, &lines) >= 8, "marks of one gap in four streams");
}

#[test]
fn the_streams_of_two_bridges_are_both_found() {
    let Some(interpreter) = wheels::python("two bridges on the Lab Streaming Layer") else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let library = liblsl(&interpreter);
    let name = unique("pair");
    let started: Vec<[Process; 2]> = ["left", "right"]
        .map(|side| {
            let port = folder.join(side).display().to_string();
            let board = board(folder, &format!("board-{side}"), &port, "60", &[]);
            let name = format!("{name}{side}");
            let options = ["--sink=lsl", "--streams=codes,raw"];
            [board, streaming(folder, &library, &name, &port, &options)]
        })
        .into();
    // Each bridge has four streams: codes, reconstructed samples, raw samples and events.
    let mut found = python(&interpreter, folder, "lsl_find", &[&name, "8"]);
    assert!(found.wait(SLACK).success(), "{}", found.log());
    let found: Vec<Value> =
        found.output().lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    assert_eq!(found.len(), 8, "{found:?}");
    for side in ["left", "right"] {
        let of_side = format!("{name}{side}-raw");
        assert!(found.iter().any(|stream| stream["name"] == of_side), "{found:?}");
    }
    let mut sources: Vec<&str> = found.iter().filter_map(|of| of["source_id"].as_str()).collect();
    sources.sort_unstable();
    sources.dedup();
    assert_eq!(sources.len(), 8, "{sources:?}");
    drop(started);
}

#[test]
fn a_stream_of_another_shape_replaces_the_old_one() {
    let Some(interpreter) = wheels::python("a stream that changes") else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let library = Library::load(Some(&liblsl(&interpreter))).expect("liblsl");
    let name = unique("shape");
    let options = LslOptions { name: name.clone(), stamp: StampPoint::First };
    let lsl = Lsl::start(library, options).expect("a thread");
    let mut sink = lsl.frames(StreamKind::Raw, 100);
    for channels in [2, 3, 2] {
        let labels = (0..channels).map(|channel: u16| format!("E{channel}"));
        let info = NeuroDataInfo {
            nsamples: 32,
            ..NeuroDataInfo::default().with_labels(labels.collect())
        };
        let frame = NeuroFrame::zeros(512, "electrodes", info, NeuroDataInfo::default());
        sink.publish(&frame).expect("a stream");
        sink.publish(&frame).expect("a stream");
        // Search repeatedly: while the old stream closes, it may still answer a search.
        let end = Instant::now() + SLACK;
        let found = loop {
            let mut find = python(&interpreter, folder.path(), "lsl_find", &[&name, "1"]);
            assert!(find.wait(SLACK).success(), "{}", find.log());
            let lines: Vec<Value> = find
                .output()
                .lines()
                .map(|line| serde_json::from_str(line).expect("JSON"))
                .collect();
            if let [stream] = &lines[..]
                && stream["channels"] == channels
            {
                break lines;
            }
            assert!(Instant::now() < end, "{lines:?}");
        };
        assert_eq!(found[0]["source_id"], format!("{name}::raw"));
    }
    assert_eq!(sink.dropped(), 0);
    lsl.finish();
}

#[test]
fn without_liblsl_the_error_has_the_remedy() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = |arguments: &[&str]| {
        let mut bridge = Command::new(&programs().bridge);
        // Hide pylsl's library from the bridge: neither python3 on the PATH nor PYLSL_LIB leads to
        // it.
        bridge
            .args(arguments)
            .env("PATH", folder.path())
            .env("CORTICODE_CONFIG", "/dev/null")
            .env_remove("PYLSL_LIB");
        let output = bridge.output().expect("the bridge starts");
        let text = [output.stdout, output.stderr].concat();
        (output.status.code(), String::from_utf8_lossy(&text).into_owned())
    };
    let (status, text) = run(&["--sink=lsl", "--port=tcp:127.0.0.1:9"]);
    assert_eq!(status, Some(2), "{text}");
    assert!(text.contains("liblsl") && text.contains("pip install pylsl"), "{text}");
    let (status, text) = run(&["--sink=lsl", "--liblsl=/no/such.so", "--port=tcp:127.0.0.1:9"]);
    assert_eq!(status, Some(2), "{text}");
    assert!(text.contains("/no/such.so cannot be loaded"), "{text}");
    let (status, text) = run(&["doctor", "--sink=lsl", "--port=tcp:127.0.0.1:9"]);
    assert_eq!(status, Some(1), "{text}");
    assert!(text.contains("lsl") && text.contains("pip install pylsl"), "{text}");
}
