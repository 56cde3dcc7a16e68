//! The packed encoder writes the same bytes as `packed_python.py` computes from the artifact's
//! files, and a decoder reaches the state that the Python program computes.
//!
//! The Python program shares no code with the Rust implementations: it follows docs/packed.md's
//! formulas literally.

use std::fmt::Write as _;
use std::fs;
use std::process::Command;

use acceptance::{real_data, workspace};
use artifact::reconstruction::PackedDecoder;
use emulator::skip::skip_unless_required;
use model::{CHANNELS, HOP};
use packed::Rate;
use pipeline::{Mains, PackedEncoder, Sample, Step};

use crate::inputs::{artifact, recorded, steps, synthetic};

/// Path of Debian's Python, which must be version 3.11 or later.
const PYTHON: &str = "/usr/bin/python3";

/// Number of blocks of each input at each rate. Every 64th block has no prediction, so a second
/// such block is included.
const BLOCKS: usize = 70;

/// Rates that are compared: the default, the finest, two between, and the coarsest.
const RATES: [u8; 5] = [4, 0, 5, 9, 15];

#[test]
fn python_computes_the_bytes_of_the_packed_encoder_and_the_decoders_state() {
    let test = "packed code against Python";
    let import = Command::new(PYTHON).args(["-c", "import tomllib"]).output();
    if !import.is_ok_and(|output| output.status.success()) {
        let why = format!("{PYTHON} is missing or older than 3.11; `apt-get install python3`");
        return skip_unless_required(test, why);
    }
    for (name, steps) in inputs(test) {
        let theirs = python(&steps);
        let ours: Vec<String> = RATES.iter().flat_map(|&rate| coded(&steps, rate)).collect();
        let mut pairs = ours.iter().zip(&theirs).enumerate();
        let different = pairs.find(|(_, (ours, theirs))| ours != theirs);
        assert_eq!(different, None, "{name}: first block that differs");
        assert_eq!(ours.len(), theirs.len(), "{name}");
        assert_eq!(ours.len(), RATES.len() * BLOCKS, "{name}");
    }
}

/// Returns, as the Python program prints them, each block's bytes and the CRC-32 of the decoder's
/// state after the block.
fn coded(steps: &[Step], rate: u8) -> Vec<String> {
    let artifact = artifact();
    let mut decoder = PackedDecoder::new(artifact.packed.as_ref().expect("a packed model"));
    let mut encoder = PackedEncoder::new();
    let rate = Rate::new(rate).expect("a rate");
    encoder.set_rate(rate);
    let codes = steps.iter().filter_map(|step| encoder.encode_step(step));
    codes
        .map(|code| {
            decoder.decode(code.bytes(), rate).expect("a block");
            let state = decoder.state().iter().flat_map(|value| value.to_le_bytes());
            let crc = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);
            let crc = crc.checksum(&state.collect::<Vec<u8>>());
            let mut bytes = String::new();
            for byte in code.bytes() {
                write!(bytes, "{byte:02x}").expect("memory");
            }
            let bytes = if bytes.is_empty() { "-" } else { &bytes };
            format!("{bytes} {crc:08x}")
        })
        .collect()
}

fn python(steps: &[Step]) -> Vec<String> {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("steps.bin");
    let electrodes = steps.iter().flat_map(|step| step.electrodes);
    let bytes: Vec<u8> = electrodes.flat_map(i32::to_le_bytes).collect();
    fs::write(&file, bytes).expect("the steps");
    let output = Command::new(PYTHON)
        .arg(workspace::root().join("tests/acceptance/tests/it/packed_python.py"))
        .arg(workspace::root().join("signal/model/artifact"))
        .arg(&file)
        .args(RATES.map(|rate| rate.to_string()))
        .output()
        .expect("Python starts");
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{message}");
    let text = String::from_utf8(output.stdout).expect("hexadecimal");
    text.lines().map(str::to_owned).collect()
}

/// Returns the steps of each input: silence, noise over all 24 bits, synthetic EEG and, if
/// available, real EEG.
fn inputs(test: &str) -> Vec<(&'static str, Vec<Step>)> {
    let mut state = 1_u32;
    let noise = std::iter::repeat_with(move || Sample {
        counts: [(); CHANNELS].map(|()| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state.cast_signed() >> 8
        }),
    });
    let mut inputs = vec![
        ("silence", vec![Step::SILENCE; BLOCKS * HOP]),
        ("noise", acquired(Mains::Hz50, noise, 0)),
        ("synthetic EEG", acquired(Mains::Hz50, synthetic(5), 200)),
    ];
    if let Some(path) = real_data::path(test, real_data::EDF_R12) {
        let samples = acquired(Mains::Hz60, recorded(&path), 2_000);
        inputs.push(("real EEG", samples));
    }
    inputs
}

fn acquired(mains: Mains, samples: impl Iterator<Item = Sample>, skipped: usize) -> Vec<Step> {
    let steps = steps(mains, samples).skip(skipped);
    steps.take(BLOCKS * HOP).collect()
}
