//! Standard output as a user of a pipe sees it: lines of JSON, or the frames themselves.

use std::{
    fs::{self, File, OpenOptions},
    io::{BufRead as _, BufReader},
    path::Path,
    process::Stdio,
};

use artifact::reconstruction::dequantise;
use link::{Flags, ToHost};
use serde_json::{Value, json};

use crate::edf_file::EdfFile;
use crate::program::{Finished, frames, program, wait};

/// Runs the program with `--fast` and returns its standard output.
fn run_to_stdout(input: &Path, more: &[&str]) -> (Finished, Vec<u8>) {
    let stdout = tempfile::NamedTempFile::new().expect("a temporary file");
    let input = format!("--input={}", input.display());
    let arguments = [&["run", "--fast", &input], more].concat();
    let mut program = program(&arguments);
    program.stdout(stdout.reopen().expect("the same file"));
    let finished = wait(program.spawn().expect("the program starts"));
    (finished, fs::read(stdout.path()).expect("its output"))
}

fn lines(bytes: &[u8]) -> Vec<Value> {
    let lines = bytes.split_inclusive(|byte| *byte == b'\n');
    let value = |line: &[u8]| serde_json::from_slice(line).expect("a line of JSON");
    lines.map(value).collect()
}

fn of_topic<'a>(lines: &'a [Value], topic: &str) -> Vec<&'a Value> {
    lines.iter().filter(|line| line["topic"] == topic).collect()
}

/// Writes to `folder` a recording of two seconds that has an event at 0.25 s.
fn recording(folder: &Path) -> std::path::PathBuf {
    let mut file = EdfFile::with_all_electrodes(2);
    file.annotations = vec![b"+0\x14\x14\0+0.25\x14Left\x14\0", b"+1\x14\x14\0"];
    let path = folder.join("two seconds.edf");
    fs::write(&path, file.bytes()).expect("writable");
    path
}

#[test]
fn codes_are_lines_of_json_with_the_fields_of_the_bridge() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let input = recording(folder.path());
    let (finished, output) = run_to_stdout(&input, &["--output=ndjson:-"]);
    assert_eq!(finished.status, Some(0), "{finished:?}");
    assert!(finished.log.contains("31 codes made"), "{finished:?}");
    let lines = lines(&output);
    let codes = of_topic(&lines, "/encoded");
    assert_eq!(codes.len(), (2 * 128 - 16) / 8 + 1);

    // The lines must hold the same codes as the frames on the wire, dequantised.
    let (finished, wire) = run_to_stdout(&input, &["-q", "--output=file:-"]);
    assert_eq!((finished.status, &*finished.log), (Some(0), ""));
    let mut scales = Vec::new();
    let expected = frames(&wire, |frame| match frame.message {
        ToHost::Capabilities(about) => {
            let zero_points = about.code_zero_point.to_vec();
            scales = about.code_scale.iter().copied().zip(zero_points).collect();
            None
        }
        ToHost::Code(code) => {
            let levels = code.values.levels().zip(&scales);
            let values = levels.map(|(level, (scale, zero))| dequantise(level, *scale, *zero));
            let flags = u64::from(code.flags.bits());
            Some((frame.header.device_time_us, flags, values.collect::<Vec<f32>>()))
        }
        _ => None,
    });
    assert_eq!(codes.len(), expected.len());
    for ((index, line), (us, flags, values)) in (0_u64..).zip(&codes).zip(expected) {
        let (message, seq) = (&line["message"], index + 1);
        assert_eq!(line["device_time_us"], us);
        assert_eq!(message["header"], json!({"seq": seq, "frame_id": "autoencoder"}));
        assert_eq!(message["neuroheader"], json!({"seq": seq}));
        assert_eq!(message["sr"], 16);
        let data: Vec<f32> =
            serde_json::from_value(message["eeg"]["data"].clone()).expect("a list");
        assert_eq!(data, values);
        let words = [flags, index, 0, us & 0xFFFF, us >> 16, 0, 0, 0];
        assert_eq!(message["tri"]["data"], json!(words));
    }
    let info = &codes[0]["message"]["eeg"]["info"];
    assert_eq!((&info["nchannels"], &info["nsamples"]), (&json!(model::CODE), &json!(1)));
    assert_eq!((&info["unit"], &info["transducter"]), (&json!("a.u."), &json!("autoencoder")));
    assert_eq!(info["labels"][0], "z000");
    assert!(info["minmax"][0].as_f64() < Some(0.0) && info["minmax"][1].as_f64() > Some(0.0));

    let quality = of_topic(&lines, "/quality");
    let first_samples = quality.iter().map(|line| &line["message"]["first_sample"]);
    assert!(first_samples.eq(&[json!(0), json!(512)][..quality.len()]) && !quality.is_empty());
    let electrodes = &quality[0]["message"]["electrodes"];
    assert_eq!(electrodes.as_array().map(Vec::len), Some(model::ELECTRODES));
    assert!(electrodes[0]["rms_uv"].is_number(), "{electrodes}");
}

#[test]
fn selected_streams_are_in_a_file_in_the_order_of_the_wire() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("lines");
    let output = format!("--output=ndjson:{}", path.display());
    let options = ["-q", &output, "--streams=codes,packed,events"];
    let finished = run_to_stdout(&recording(folder.path()), &options).0;
    assert_eq!((finished.status, &*finished.log), (Some(0), ""));
    let lines = lines(&fs::read(&path).expect("the file"));

    let edges = of_topic(&lines, "/events/bus");
    let edges = edges.iter().map(|line| {
        let message = &line["message"];
        let [event, description] = ["event", "description"].map(|key| message[key].clone());
        (line["device_time_us"].clone(), event, description)
    });
    let expected = [(250_000, 0x0001, "trigger high"), (260_000, 0x8001, "trigger low")];
    assert!(edges.eq(expected.map(|(us, event, text)| (json!(us), json!(event), json!(text)))));

    // No code ends in the 10 ms for which the trigger is high, so all codes state the level 0.
    let codes = of_topic(&lines, "/encoded");
    assert!(codes.iter().all(|line| line["message"]["tri"]["data"][7] == 0));
    let blocks = of_topic(&lines, "/packed");
    assert_eq!(blocks.len(), 2 * 16);
    for (index, line) in blocks.iter().enumerate() {
        let message = &line["message"];
        assert_eq!(message["block"], index);
        assert!(message["bytes"].as_array().is_some_and(|bytes| !bytes.is_empty()));
        let settling = u64::from(Flags::SETTLING.bits());
        assert!(message["flags"].as_u64().is_some_and(|flags| flags & settling != 0));
    }
    let times = lines.iter().map(|line| line["device_time_us"].as_u64());
    assert!(times.is_sorted());
}

#[test]
fn standard_output_has_the_bytes_of_a_file() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let input = recording(folder.path());
    for kind in ["file", "ndjson"] {
        let path = folder.path().join(kind);
        let file = format!("--output={kind}:{}", path.display());
        assert_eq!(run_to_stdout(&input, &[&file]).1, b"");
        let stdout = format!("--output={kind}:-");
        let bytes = run_to_stdout(&input, &[&stdout]).1;
        assert!(bytes.len() > 1_000 && bytes == fs::read(path).expect("the file"), "{kind}");
    }
}

#[test]
fn a_reader_that_has_seen_enough_ends_an_endless_run() {
    let mut program = program(&["run", "--input=synthetic", "--output=ndjson:-"]);
    let mut child = program.stdout(Stdio::piped()).spawn().expect("the program starts");
    let mut stdout = BufReader::new(child.stdout.take().expect("a pipe"));
    let mut line = String::new();
    stdout.read_line(&mut line).expect("a line");
    drop(stdout);
    let finished = wait(child);
    assert_eq!(finished.status, Some(0), "{finished:?}");
}

#[test]
fn what_cannot_be_written_or_read_to_its_end_has_a_status_and_a_reason() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let input = recording(folder.path());
    let mut program =
        program(&["run", "-q", &format!("--input={}", input.display()), "--output=ndjson:-"]);
    let full: File = OpenOptions::new().write(true).open("/dev/full").expect("a device");
    let finished = wait(program.stdout(full).spawn().expect("the program starts"));
    assert_eq!(finished.status, Some(1), "{finished:?}");
    let reason = " frames could not be written to ndjson:-";
    assert!(finished.log.contains(reason), "{finished:?}");

    let absent = run_to_stdout(&folder.path().join("absent.edf"), &["--output=ndjson:-"]);
    assert_eq!((absent.0.status, &*absent.1), (Some(2), &b""[..]), "{absent:?}");
    let port = run_to_stdout(&input, &["--output=tcp:127.0.0.1:0", "--streams=codes"]).0;
    assert_eq!(port.status, Some(2), "{port:?}");
    assert!(port.log.contains("the host selects the streams"), "{port:?}");
}
