//! `host-sim encode` and `host-sim decode`, run as a user does: they give the codes of `host-sim
//! run` and the microvolts of the bridge, and accept whole folders and recordings of several
//! formats, rates and caps.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use acceptance::files::write_gdf;
use acceptance::port::free_address;
use acceptance::{numpy_reference, process, programs::programs, real_data};
use link::{Code, Decoder, MAX_FRAME, ToHost};
use recordings::Recording;

use crate::inputs::artifact;

/// Duration of the synthetic recording in seconds.
const SECONDS: u32 = 12;

/// Time limit for the bridge to record a run, and for it to exit afterwards.
const TIMEOUT: Duration = Duration::from_mins(2);

/// Runs host-sim with `arguments` in `folder`, and returns what it printed and its exit status.
fn host_sim(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(&programs().host_sim);
    let output = command.current_dir(folder).args(arguments).output();
    output.expect("host-sim starts")
}

/// Runs host-sim, which must succeed, and returns its standard error.
fn printed(folder: &Path, arguments: &[&str]) -> String {
    let output = host_sim(folder, arguments);
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{arguments:?}: {text}");
    text
}

/// Calls `each` with the device time and the contents of every code in a file of frames.
fn for_each_code(path: &Path, mut each: impl FnMut(u64, &Code)) {
    let bytes = fs::read(path).expect("frames");
    let mut rest = &bytes[..];
    let mut decoder = Decoder::<MAX_FRAME>::new();
    while let Some(frame) = decoder.next::<ToHost>(&mut rest) {
        let frame = frame.expect("an intact frame");
        if let ToHost::Code(code) = &frame.message {
            each(frame.header.device_time_us, code);
        }
    }
}

/// Returns a text for each code in a file: device time, contents and levels (integer values). Two
/// files with equal texts have equal codes.
fn codes(path: &Path) -> Vec<String> {
    let mut codes = Vec::new();
    for_each_code(path, |time_us, code| {
        let levels: Vec<i32> = code.values.levels().collect();
        codes.push(format!("{time_us} {code:?} {levels:?}"));
    });
    codes
}

/// Writes a GDF file with the model's electrodes and one event per second. Its rate is 250 Hz, so
/// that host-sim must resample it.
fn write_recording(path: &Path) {
    let rate_hz = 250;
    let labels: Vec<&str> = model::LABELS.split(' ').collect();
    let value = |row: u32, electrode: u8| {
        let seconds = f64::from(row) / f64::from(rate_hz);
        let place = f64::from(electrode) / 20.0;
        let wave = 30.0 * (63.0 * seconds + place).sin() + 9.0 * (140.0 * seconds - place).sin();
        #[expect(clippy::cast_possible_truncation, reason = "a file of float32")]
        let wave = wave as f32;
        wave
    };
    let electrodes = u8::try_from(labels.len()).expect("few electrodes");
    let rows = 0..SECONDS * rate_hz;
    let values = rows.flat_map(|row| (0..electrodes).map(move |electrode| value(row, electrode)));
    let events: Vec<(u64, u16)> = (0..u64::from(SECONDS)).map(|s| (s * 250, 0x0301)).collect();
    write_gdf(path, &labels, rate_hz, values, &events);
}

#[test]
fn codes_are_those_of_run_and_microvolts_those_of_the_bridge() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    write_recording(&folder.join("in.gdf"));
    printed(folder, &["encode", "in.gdf", "encoded.codes"]);
    printed(folder, &["run", "--input", "in.gdf", "--output", "file:run.codes"]);
    let encoded = codes(&folder.join("encoded.codes"));
    assert_eq!(encoded.len(), usize::try_from(SECONDS).expect("few") * 16 - 1);
    assert_eq!(encoded, codes(&folder.join("run.codes")));

    compare_with_the_bridge(folder, "in.gdf", "encoded.codes");
}

/// Records with the bridge what `host-sim run` sends, converts the recording, and compares its
/// decoded signal with the signal that `host-sim decode` writes.
fn compare_with_the_bridge(folder: &Path, recording: &str, codes: &str) {
    let port = free_address();
    let log = folder.join("logs");
    fs::create_dir_all(&log).expect("a folder");
    let mut board = Command::new(&programs().host_sim);
    board.current_dir(folder);
    board.args(["run", "--fast", "--input", recording, "--output", &port]);
    let mut board = process::Process::start("host-sim", &mut board, &log).expect("host-sim starts");
    let mut record = Command::new(&programs().bridge);
    record.current_dir(folder);
    record.args(["record", "wire.rec", "--force", "--port", &port]);
    let record = process::Process::start("record", &mut record, &log).expect("record starts");
    assert!(board.wait(TIMEOUT).success(), "{}", board.errors());
    record.stop(rustix::process::Signal::INT, TIMEOUT);
    let convert = Command::new(&programs().bridge)
        .current_dir(folder)
        .args(["convert", "wire.rec", "--to", "npz", "--force"])
        .output();
    let convert = convert.expect("convert starts");
    assert!(convert.status.success(), "{}", String::from_utf8_lossy(&convert.stderr));
    printed(folder, &["decode", codes, "decoded.npz", "--to", "npz", "--force"]);
    if !numpy_reference::available("microvolts of host-sim decode and of the bridge") {
        return;
    }
    let script = "import sys, numpy as np\n\
        theirs = np.load(sys.argv[1] + '/wire.reconstructed.npz')\n\
        ours = np.load(sys.argv[1] + '/decoded.npz')\n\
        rows = theirs['rows']['values']\n\
        assert list(ours['labels']) == list(theirs['labels']), 'labels'\n\
        assert ours['uv'].dtype == np.float32 and len(rows) > 1000, len(rows)\n\
        assert ours['flags'].shape == ours['uv'].shape[:1]\n\
        assert np.array_equal(ours['uv'][:len(rows)], rows), 'microvolts'\n\
        assert len(ours['uv']) >= len(rows) + 8, 'the last hop is more'\n\
        print(len(rows))\n";
    let path = folder.join("compare.py");
    fs::write(&path, script).expect("a file");
    numpy_reference::run(path, folder).unwrap_or_else(|error| panic!("{error}"));
}

#[test]
fn a_folder_is_encoded_and_decoded_although_one_file_is_no_recording() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    fs::create_dir_all(folder.join("in/S1")).expect("a folder");
    write_recording(&folder.join("in/S1/a.gdf"));
    fs::copy(folder.join("in/S1/a.gdf"), folder.join("in/b.GDF")).expect("a copy");
    fs::write(folder.join("in/broken.edf"), "0       no header").expect("a file");
    fs::write(folder.join("in/notes.txt"), "not a recording").expect("a file");

    let encode = host_sim(folder, &["encode", "in", "codes", "--jobs", "2"]);
    let text = String::from_utf8_lossy(&encode.stderr);
    assert_eq!(encode.status.code(), Some(2), "{text}");
    assert!(text.contains("in/broken.edf") && text.contains("1 of 3 files failed"), "{text}");
    let made = ["codes/S1/a.gdf.codes", "codes/b.GDF.codes"].map(|name| folder.join(name));
    assert_eq!(codes(&made[0]), codes(&made[1]));
    assert!(!folder.join("codes/broken.edf.codes").exists());

    let again = host_sim(folder, &["encode", "in/b.GDF", "codes/b.GDF.codes"]);
    let text = String::from_utf8_lossy(&again.stderr);
    assert_eq!(again.status.code(), Some(2));
    assert!(text.contains("exists already") && text.contains("--force"), "{text}");

    let arguments = ["decode", "codes", "--to", "edf", "--original", "in", "--report", "report"];
    let text = printed(folder, &arguments);
    assert!(text.contains("PRD") && text.contains("report/index.html"), "{text}");
    let mut recording =
        Recording::open(folder.join("codes/S1/a.gdf.decoded.edf")).expect("an EDF file");
    assert_eq!(recording.events().expect("events").len(), 12);
    let page = fs::read_to_string(folder.join("report/index.html")).expect("a page");
    for name in ["S1/a.gdf", "b.GDF"] {
        assert!(page.contains(&format!("src=\"{name}/scalp.svg\"")), "{name}");
        assert!(folder.join("report").join(name).join("traces.svg").exists());
    }

    let again =
        host_sim(folder, &["decode", "codes", "other", "--to", "csv", "--report", "report"]);
    let text = String::from_utf8_lossy(&again.stderr);
    assert_eq!(again.status.code(), Some(2));
    assert!(text.contains("report/index.html exists already"), "{text}");
    let one = ["decode", "codes", "other", "--to", "csv", "--original", "in/b.GDF"];
    let one = host_sim(folder, &one);
    let text = String::from_utf8_lossy(&one.stderr);
    assert_eq!(one.status.code(), Some(2));
    assert!(text.contains("name the folder of their recordings"), "{text}");
    let full = host_sim(folder, &["decode", "codes/b.GDF.codes", "/dev/full", "--to", "csv"]);
    assert_eq!(full.status.code(), Some(1));
    let pipe = host_sim(folder, &["decode", "/dev/null", "x.csv", "--to", "csv"]);
    let text = String::from_utf8_lossy(&pipe.stderr);
    assert_eq!(pipe.status.code(), Some(2));
    assert!(text.contains("it is no file"), "{text}");

    let nothing = host_sim(folder, &["decode", "in", "--to", "csv"]);
    let text = String::from_utf8_lossy(&nothing.stderr);
    assert_eq!(nothing.status.code(), Some(2));
    assert!(text.contains("no file with the extension codes"), "{text}");
    let absent =
        host_sim(folder, &["decode", "codes/b.GDF.codes", "/dev/full/x.csv", "--to", "csv"]);
    assert_eq!(absent.status.code(), Some(2));
}

#[test]
fn ctrl_c_ends_encoding_without_a_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    fs::create_dir_all(folder.join("in")).expect("a folder");
    write_recording(&folder.join("in/0.gdf"));
    for copy in 1..40 {
        fs::hard_link(folder.join("in/0.gdf"), folder.join(format!("in/{copy}.gdf")))
            .expect("a link");
    }
    let mut command = Command::new(&programs().host_sim);
    command.current_dir(folder).args(["encode", "in", "out", "--jobs", "1"]);
    let child = command.stdin(Stdio::null()).stderr(Stdio::piped()).spawn();
    let mut child = child.expect("host-sim starts");
    while !folder.join("out/0.gdf.codes").exists() {
        assert!(child.try_wait().expect("a child").is_none(), "it ended too early");
        std::thread::sleep(Duration::from_millis(5));
    }
    let id = rustix::process::Pid::from_child(&child);
    rustix::process::kill_process(id, rustix::process::Signal::INT).expect("a signal");
    let output = child.wait_with_output().expect("it ends");
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(text.contains("interrupted"), "{text}");
    assert_eq!(output.status.code(), Some(1));
    let files = fs::read_dir(folder.join("out")).expect("a folder");
    let names: Vec<PathBuf> = files.map(|file| file.expect("a file").path()).collect();
    assert!(names.len() < 40, "{} files", names.len());
    for name in names {
        assert!(name.display().to_string().ends_with(".gdf.codes"), "{name:?}");
        assert_eq!(codes(&name).len(), 191);
    }
}

#[test]
fn real_recordings_of_three_formats_are_encoded_and_decoded() {
    let what = "real recordings, encoded and decoded";
    let Some(r11) = real_data::path(what, real_data::EDF_R11) else {
        return;
    };
    let data = r11.parent().and_then(Path::parent).expect("a folder");
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    fs::create_dir_all(folder.join("in")).expect("a folder");
    // An EDF file at 160 Hz from a cap with 10-10 names, and a GDF file at 512 Hz with the paper's
    // electrodes, of which 31 were recorded and the others interpolated.
    for (name, source) in
        [("r11.edf", r11.clone()), ("paper.gdf", data.join("derived/s001r04_61ch_512hz_i16.gdf"))]
    {
        fs::copy(source, folder.join("in").join(name)).expect("a copy");
    }
    printed(folder, &["encode", "in", "codes"]);
    // Encode the decoded file, a BDF file at 128 Hz with the model's electrodes, once more.
    printed(folder, &["decode", "codes/r11.edf.codes", "in/again.bdf", "--to", "bdf"]);
    printed(folder, &["encode", "in/again.bdf", "codes/again.bdf.codes"]);
    let arguments = ["decode", "codes", "--to", "gdf", "--original", "in", "--report", "report"];
    let text = printed(folder, &arguments);
    let _ = std::io::stdout().write_all(text.as_bytes());
    // Limits of the PRD (RMS error in percent of the signal's RMS) over the measured electrodes, as
    // multiples of the PRD that the model's training card states. That PRD was measured on
    // recordings like the EDF file.
    let card = artifact().description.training.prd_percent.expect("figures");
    for (name, ratio) in [("r11.edf", 1.2), ("again.bdf", 1.2), ("paper.gdf", 2.0)] {
        let limit = ratio * card.autoencoder_int8;
        let line = text.lines().find(|line| line.contains(&format!("/{name}.decoded")));
        let line = line.expect("a line for each file");
        let (_, prd) = line.split_once("electrodes, ").expect("the PRD");
        let prd: f64 = prd.split(' ').next().and_then(|prd| prd.parse().ok()).expect("a number");
        println!("{name}: {prd} %, at most {limit} %");
        assert!(prd > 0.5 && prd < limit, "{name}: {prd} %");
    }
    compare_with_the_bridge(folder, "in/r11.edf", "codes/r11.edf.codes");
}
