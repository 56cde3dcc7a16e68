//! Tests that the compressed samples of a board equal its converters' samples, bit for bit.

use link::{BlockForm, CompressedRaw};
use lossless::{Block, Count, Kind};
use pipeline::CHANNELS;

use super::*;

/// Decodes a message of compressed samples to counts, as a host does.
fn decode(decoder: &mut lossless::Decoder<CHANNELS>, raw: &CompressedRaw) -> Vec<Count> {
    let kind = match raw.form {
        BlockForm::Verbatim => Kind::Verbatim,
        BlockForm::Key => Kind::Key,
        BlockForm::Continuing => Kind::Continuing,
        BlockForm::Newer(form) => panic!("form {form}"),
    };
    let block = Block { kind, samples: raw.samples.into(), bytes: raw.bytes };
    let counts = decoder.decode(raw.channels.into(), &block);
    counts.expect("a sound block").to_vec()
}

/// Totals of a run: bytes of all compressed frames; largest number of bytes by which a compressed
/// frame exceeds its raw frame (both without the bytes that COBS adds); bytes of the longest
/// compressed block; number of counts.
#[derive(Debug, Default)]
struct Bytes {
    compressed: usize,
    most_more: usize,
    longest: usize,
    counts: usize,
}

/// Returns the length of a frame without the bytes that COBS adds, whose number depends on where
/// the zeros are.
fn unstuffed(frame: &[u8]) -> usize {
    let mut bytes = frame.to_vec();
    bytes.retain(|&byte| byte != 0);
    cobs::decode_in_place(&mut bytes).expect("a frame of the board")
}

/// Runs a board that sends its samples raw and compressed, and checks that both hold the same
/// counts.
fn compare(samples: impl Iterator<Item = Sample>) -> Bytes {
    let (mut board, outbox) = board();
    let streams = Streams::RAW | Streams::COMPRESSED_RAW;
    send(&mut board, &mut Encoder::default(), start(streams));
    let mut decoder = lossless::Decoder::NEW;
    let mut bytes = Bytes::default();
    let mut raw = Vec::new();
    for (index, sample) in (1..).zip(samples) {
        board.process_sample(&sample, index * 1_000_000 / 512);
        for frame in outbox.take_all() {
            let mut host = Decoder::<MAX_FRAME>::new();
            let message = host.next::<ToHost>(&mut &frame[..]).expect("a frame");
            match message.expect("an intact frame").message {
                ToHost::Raw(message) => {
                    let content = unstuffed(&frame);
                    raw.push((
                        message.first_sample,
                        message.flags,
                        message.counts.to_vec(),
                        content,
                    ));
                }
                ToHost::CompressedRaw(message) => {
                    bytes.compressed += frame.len();
                    bytes.longest = bytes.longest.max(message.bytes.len());
                    let counts = decode(&mut decoder, &message);
                    bytes.counts += counts.len();
                    let (first, flags, expected, content) =
                        raw.pop().expect("the raw frame comes first");
                    let more = unstuffed(&frame).saturating_sub(content);
                    bytes.most_more = bytes.most_more.max(more);
                    assert_eq!((message.first_sample, message.flags), (first, flags));
                    assert_eq!(counts.as_flattened(), expected);
                }
                _ => {}
            }
        }
    }
    assert!(raw.is_empty());
    bytes
}

#[test]
#[expect(clippy::cast_precision_loss, reason = "a figure for people")]
fn synthetic_eeg_takes_less_than_half_of_its_bytes() {
    let spec = SyntheticSpec::new(1, model::LABELS.split(' '));
    let eeg = Generator::new(&spec).expect("a generator");
    let bytes = compare(eeg.take(30 * 512).map(|counts| Sample { counts }));
    assert_eq!(bytes.counts, 30 * 512 * CHANNELS);
    let bits = 8.0 * bytes.compressed as f64 / bytes.counts as f64;
    println!("{bits:.2} bits for each count, frames included");
    // Measured: 11.31 bits for each count, 723 bytes for each frame. `docs/wire-format.md` states
    // the rate.
    assert!((11.0..11.6).contains(&bits), "{bits}");
}

#[test]
fn no_frame_of_compressed_samples_is_more_than_three_bytes_longer_than_its_raw_frame() {
    let mut state = 1_u32;
    let noise = std::iter::repeat_with(|| Sample {
        counts: std::array::from_fn(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state.cast_signed() >> 8
        }),
    });
    let bytes = compare(noise.take(1_024));
    assert_eq!(bytes.longest, 3 * CHANNELS * link::RAW_SAMPLES);
    // Two bytes are for the fields of the message. A third is needed if the frame's number, one
    // more than the raw frame's, takes one byte more.
    assert!(bytes.most_more <= 3, "{bytes:?}");
}
