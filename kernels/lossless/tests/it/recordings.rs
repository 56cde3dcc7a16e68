//! Measures the number of bits per count to which real recordings are compressed.

use std::fs;
use std::io::{Write as _, stderr};
use std::path::Path;

use lossless::{Decoder, Encoder, EncoderState, MAX_SAMPLES};

/// Number of channels of each recording that the test compresses.
const CHANNELS: usize = 16;

/// Reads the first [`CHANNELS`] channels of an EDF or BDF file whose signals all have the same
/// rate. A count has `bytes` bytes: 2 in EDF, 3 in BDF. Returns the counts of each sample.
fn read(path: &Path, bytes: usize) -> Vec<[i32; CHANNELS]> {
    let file = fs::read(path).expect("a recording");
    let number = |from: usize, length: usize| -> usize {
        let text = str::from_utf8(&file[from..from + length]).expect("ASCII");
        text.trim().parse().expect("a number")
    };
    let (header, signals) = (number(184, 8), number(252, 4));
    let sizes: Vec<usize> =
        (0..signals).map(|signal| number(256 + 216 * signals + 8 * signal, 8)).collect();
    let record: usize = sizes.iter().sum();
    let per_signal = sizes[0];
    assert!(sizes[..CHANNELS].iter().all(|size| *size == per_signal));
    let mut samples = Vec::new();
    for record in file[header..].chunks_exact(record * bytes) {
        for time in 0..per_signal {
            samples.push(std::array::from_fn(|channel| {
                let at = (channel * per_signal + time) * bytes;
                let mut word = [0; 4];
                word[4 - bytes..].copy_from_slice(&record[at..at + bytes]);
                i32::from_le_bytes(word) >> (32 - 8 * bytes)
            }));
        }
    }
    samples
}

/// Compresses all samples, asserts that they decode to the same counts, and returns bits per count.
#[expect(clippy::cast_precision_loss, reason = "a figure for people")]
fn bits_per_count(samples: &[[i32; CHANNELS]]) -> f64 {
    let (mut state, mut decoder) = (EncoderState::NEW, Decoder::<CHANNELS>::NEW);
    let encoder = Encoder { key_blocks: 16 };
    let mut bytes = 0;
    for block in samples.chunks(MAX_SAMPLES) {
        let counts = block.iter().map(|row| {
            row.map(|count| {
                let [low, middle, high, _] = count.to_le_bytes();
                [low, middle, high]
            })
        });
        let counts: Vec<_> = counts.collect();
        let mut room = [[[0; 3]; CHANNELS]; MAX_SAMPLES];
        let block = encoder.encode(&mut state, &counts, &mut room);
        bytes += block.bytes.len();
        let decoded = decoder.decode(CHANNELS, &block).expect("a sound block");
        assert_eq!(decoded, counts.as_flattened());
    }
    8.0 * bytes as f64 / (CHANNELS * samples.len()) as f64
}

#[test]
fn recordings_come_back_bit_for_bit() {
    let Some(folder) = std::env::var_os("CORTICODE_DATA").filter(|folder| !folder.is_empty())
    else {
        let note = b"SKIPPED: real recordings: CORTICODE_DATA is not set\n";
        return stderr().write_all(note).expect("stderr");
    };
    // The limits are a little above the measured 6.97 and 14.43 bits. In the first file, one count
    // is 1 uV.
    for (file, bytes, most) in
        [("eegmmidb_S001/S001R04.edf", 2, 7.5), ("bdf_edf/test.bdf", 3, 16.0)]
    {
        let bits = bits_per_count(&read(&Path::new(&folder).join(file), bytes));
        println!("{file}: {bits:.2} bits per count");
        assert!(bits < most, "{file}: {bits}");
    }
}
