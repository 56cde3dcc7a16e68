//! The format of the blocks in Python, `kernels/lossless/tests/reference.py`.

use std::fmt::Write as _;
use std::io::{Write as _, stderr};
use std::process::{Command, Stdio};

use super::signal::{CHANNELS, Row};

/// Encodes stretches of samples in blocks of 8, and decodes them again. Returns the kind and the
/// bytes of each block; `None` without Python.
pub(super) fn encode(stretches: &[Vec<Row>], key_blocks: u16) -> Option<Vec<(u8, Vec<u8>)>> {
    let mut input = format!("{CHANNELS} {key_blocks}\n");
    for stretch in stretches {
        input += "\n";
        for block in stretch.chunks(8) {
            for count in block.iter().flatten() {
                write!(input, "{count} ").expect("a string has room");
            }
            input += "\n";
        }
    }
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/reference.py");
    let child = Command::new("python3")
        .arg(script)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn();
    let Ok(mut child) = child else {
        let note = b"SKIPPED: the format in Python: there is no python3\n";
        stderr().write_all(note).expect("stderr");
        return None;
    };
    let mut stdin = child.stdin.take().expect("piped");
    std::thread::spawn(move || stdin.write_all(input.as_bytes()));
    let output = child.wait_with_output().expect("its output");
    assert!(output.status.success(), "reference.py failed");
    let text = String::from_utf8(output.stdout).expect("text");
    Some(text.lines().map(parse).collect())
}

fn parse(line: &str) -> (u8, Vec<u8>) {
    let (kind, hex) = line.split_once(' ').expect("kind and bytes");
    let bytes = (0..hex.len() / 2).map(|at| u8::from_str_radix(&hex[2 * at..2 * at + 2], 16));
    let bytes = bytes.collect::<Result<_, _>>().expect("hexadecimal digits");
    (kind.parse().expect("a number"), bytes)
}
