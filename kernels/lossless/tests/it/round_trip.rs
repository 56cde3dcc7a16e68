//! Tests that every signal comes back bit for bit, and that no block is longer than its counts.

mod signal;

use std::fmt::Write as _;
use std::io::{Write as _, stderr};
use std::process::{Command, Stdio};

use lossless::{Block, DecodeError, Decoder, Encoder, EncoderState, Kind, MAX_SAMPLES};
use proptest::prelude::*;
use signal::{CHANNELS, Row, Shape, rows, to_bytes};

/// Encoder that sends a key block every 16 blocks, so that a long signal contains several.
const ENCODER: Encoder = Encoder { key_blocks: 16 };

/// An encoded block and the samples from which it was made.
#[derive(Clone, Debug)]
struct Encoded {
    kind: Kind,
    bytes: Vec<u8>,
    samples: Vec<Row>,
}

impl Encoded {
    fn block(&self) -> Block<'_> {
        Block { kind: self.kind, samples: self.samples.len(), bytes: &self.bytes }
    }

    fn counts(&self) -> Vec<[u8; 3]> {
        self.samples.iter().flatten().copied().map(to_bytes).collect()
    }
}

/// Encodes stretches of samples. Samples are missing between two stretches, so each stretch starts
/// with a key block.
fn encode(stretches: &[Vec<Row>]) -> Vec<Encoded> {
    let mut state = EncoderState::NEW;
    let mut blocks = Vec::new();
    for stretch in stretches {
        state.require_key();
        for samples in stretch.chunks(MAX_SAMPLES) {
            let counts: Vec<_> = samples.iter().map(|row| row.map(to_bytes)).collect();
            let mut room = [[[0; 3]; CHANNELS]; MAX_SAMPLES];
            let block = ENCODER.encode(&mut state, &counts, &mut room);
            assert_eq!(block.samples, samples.len());
            assert!(block.bytes.len() <= 3 * CHANNELS * samples.len());
            blocks.push(Encoded {
                kind: block.kind,
                bytes: block.bytes.to_vec(),
                samples: samples.to_vec(),
            });
        }
    }
    blocks
}

fn decode(decoder: &mut Decoder<64>, block: &Encoded) -> Result<(), DecodeError> {
    let counts = decoder.decode(CHANNELS, &block.block())?;
    assert_eq!(counts, block.counts());
    Ok(())
}

proptest! {
    #[test]
    fn every_signal_comes_back_bit_for_bit(
        stretches in prop::collection::vec(rows(1..200), 1..4)
    ) {
        let mut decoder = Decoder::NEW;
        for block in encode(&stretches) {
            prop_assert_eq!(decode(&mut decoder, &block), Ok(()));
        }
    }

    #[test]
    fn after_a_lost_block_all_are_refused_up_to_the_next_key_block(
        stretch in rows(400..401), lost in 0_usize..50
    ) {
        let blocks = encode(&[stretch]);
        let mut decoder = Decoder::NEW;
        let mut needs_key = false;
        for (index, block) in blocks.iter().enumerate() {
            if index == lost {
                decoder.forget();
                needs_key = true;
                continue;
            }
            needs_key &= block.kind == Kind::Continuing;
            let expected = if needs_key { Err(DecodeError::NoKey) } else { Ok(()) };
            prop_assert_eq!(decode(&mut decoder, block), expected);
            // At most 16 blocks after the lost block, a key block must have come.
            prop_assert!(!needs_key || index < lost + 16);
        }
    }

    #[test]
    fn damaged_blocks_are_decoded_or_refused_and_the_next_key_block_is_decoded(
        stretch in rows(16..64),
        damage in prop::collection::vec((any::<prop::sample::Index>(), 0..8_u32), 1..4),
        cut in any::<prop::sample::Index>(),
    ) {
        let blocks = encode(std::slice::from_ref(&stretch));
        for block in &blocks {
            let mut decoder = Decoder::NEW;
            let mut damaged = block.clone();
            for (place, bit) in &damage {
                let place = place.index(damaged.bytes.len());
                damaged.bytes[place] ^= 1_u8 << bit;
            }
            let is_continuing = block.kind == Kind::Continuing;
            if is_continuing {
                decode(&mut decoder, &blocks[0])?;
            }
            if decoder.decode(CHANNELS, &damaged.block()).is_err() {
                prop_assert!(!decoder.is_synchronised());
            }
            let mut shorter = block.clone();
            shorter.bytes.truncate(cut.index(block.bytes.len()));
            let mut fresh = Decoder::<64>::NEW;
            prop_assert!(fresh.decode(CHANNELS, &shorter.block()).is_err());
            prop_assert_eq!(decode(&mut decoder, &blocks[0]), Ok(()));
        }
    }

    #[test]
    fn any_bytes_are_decoded_or_refused(
        bytes in prop::collection::vec(any::<u8>(), 0..200),
        kind in prop::sample::select(vec![Kind::Verbatim, Kind::Key, Kind::Continuing]),
        samples in 0..12_usize,
        channels in 0..70_usize,
    ) {
        let mut decoder = Decoder::<64>::NEW;
        let mut room = [[[0; 3]; 64]; MAX_SAMPLES];
        let mut state = EncoderState::NEW;
        let key = ENCODER.encode(&mut state, &[[[0; 3]; 64]; 8], &mut room);
        decoder.decode(64, &key).expect("silence");
        let block = Block { kind, samples, bytes: &bytes };
        if let Ok(counts) = decoder.decode(channels, &block) {
            prop_assert_eq!(counts.len(), samples * channels);
        }
    }
}

#[test]
fn a_block_after_another_past_is_refused_by_its_sum() {
    let ramp = |start: i32| (0..16).map(|t| [start + 40 * t; CHANNELS]).collect::<Vec<_>>();
    let [here, there] = [0, 1_001].map(|start| encode(&[ramp(start)]));
    let mut decoder = Decoder::NEW;
    assert_eq!(decode(&mut decoder, &here[0]), Ok(()));
    assert_eq!(decoder.decode(CHANNELS, &there[1].block()), Err(DecodeError::Sum));
}

#[test]
fn full_scale_noise_takes_its_own_bytes_and_silence_a_bit_for_each_count() {
    let noise = encode(&[Shape::Noise(24).rows(7, 80)]);
    assert!(noise.iter().all(|block| block.kind == Kind::Verbatim));
    assert!(noise.iter().all(|block| block.bytes.len() == 3 * CHANNELS * MAX_SAMPLES));
    let silence = encode(&[Shape::Noise(0).rows(7, 80)]);
    assert_eq!(silence[0].kind, Kind::Key);
    for block in &silence[1..] {
        assert_eq!(block.kind, Kind::Continuing);
        assert_eq!(block.bytes.len(), 2 + (CHANNELS * MAX_SAMPLES).div_ceil(8));
    }
}

#[test]
fn python_writes_and_reads_the_same_bytes() {
    let mut stretches = Vec::new();
    for (seed, shape) in (0..).zip(Shape::SOME) {
        stretches.push(shape.rows(seed, 150));
    }
    let blocks = encode(&stretches);
    let Some(lines) = encode_in_python(&stretches, 16) else {
        return;
    };
    assert_eq!(lines.len(), blocks.len());
    for (index, (line, block)) in lines.iter().zip(&blocks).enumerate() {
        let kind = match block.kind {
            Kind::Verbatim => 0,
            Kind::Key => 1,
            Kind::Continuing => 2,
        };
        assert_eq!(*line, (kind, block.bytes.clone()), "block {index}");
    }
}

/// Encodes stretches of samples in blocks of 8 with `kernels/lossless/tests/reference.py`, which
/// also checks that the blocks decode. Returns kind and bytes of each block; `None` if Python is
/// missing.
fn encode_in_python(stretches: &[Vec<Row>], key_blocks: u16) -> Option<Vec<(u8, Vec<u8>)>> {
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
    let child =
        Command::new("python3").arg(script).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn();
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
