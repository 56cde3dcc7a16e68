//! Damaged bytes yield no false frame and no panic, and the decoder resynchronises at a zero.

use link::{CodeValues, Decoder, Encoder, MAX_FRAME, ToDevice, ToHost, encode};
use proptest::prelude::*;

use crate::messages::code_in;
use crate::random_message::message;

/// Returns each message encoded as a frame.
fn frames(messages: &[ToHost<'_>], first_seq: u32) -> Vec<Vec<u8>> {
    let mut encoder = Encoder::starting_at(first_seq);
    let mut buffer = [0; MAX_FRAME];
    let mut frame = |message| {
        let frame = encoder.encode(u64::from(first_seq), message, &mut buffer);
        frame.unwrap().to_vec()
    };
    messages.iter().map(&mut frame).collect()
}

/// Decodes `bytes`, of which the decoder gets `chunk` bytes at a time. Returns each decoded frame,
/// encoded again, with its index in the stream; also returns the number of bad frames.
fn decode(bytes: &[u8], chunk: usize, first_seq: u32) -> (Vec<(usize, Vec<u8>)>, usize) {
    let mut buffer = [0; MAX_FRAME];
    let mut decoder = Decoder::<MAX_FRAME>::new();
    let (mut good, mut bad) = (Vec::new(), 0);
    for mut input in bytes.chunks(chunk.max(1)) {
        while let Some(outcome) = decoder.next::<ToHost>(&mut input) {
            match outcome {
                Ok(frame) => {
                    let again = encode(&frame.header, &frame.message, &mut buffer).unwrap();
                    let place = frame.header.seq.wrapping_sub(first_seq);
                    good.push((place as usize, again.to_vec()));
                }
                Err(_) => bad += 1,
            }
        }
    }
    let counters = decoder.counters();
    assert_eq!(counters.frames as usize, good.len());
    assert_eq!(counters.bytes, bytes.len() as u64);
    let counted = counters.crc
        + counters.cobs
        + counters.oversize
        + counters.version
        + counters.unknown
        + counters.malformed;
    assert_eq!(counted as usize, bad);
    assert!(counters.resyncs as usize <= bad);
    (good, bad)
}

/// Damage to the bytes between sender and receiver.
#[derive(Clone, Debug)]
enum Damage {
    Flip { bits: Vec<usize> },
    Drop { count: usize },
    Insert { bytes: Vec<u8> },
    Duplicate { count: usize },
    Swap { distance: usize },
    Overwrite { bytes: Vec<u8> },
}

fn damage() -> impl Strategy<Value = Damage> {
    prop_oneof![
        prop::collection::vec(0usize..512, 1..9).prop_map(|bits| Damage::Flip { bits }),
        (1usize..40).prop_map(|count| Damage::Drop { count }),
        prop::collection::vec(any::<u8>(), 1..40).prop_map(|bytes| Damage::Insert { bytes }),
        (1usize..40).prop_map(|count| Damage::Duplicate { count }),
        (1usize..20).prop_map(|distance| Damage::Swap { distance }),
        prop::collection::vec(any::<u8>(), 1..40).prop_map(|bytes| Damage::Overwrite { bytes }),
    ]
}

/// Damages `bytes` from offset `at` on, and returns an offset in the original bytes after which
/// every byte is intact.
fn apply(damage: &Damage, bytes: &mut Vec<u8>, at: usize) -> usize {
    match damage {
        Damage::Flip { bits } => {
            let mut end = at;
            for bit in bits {
                let place = (at + bit / 8).min(bytes.len() - 1);
                bytes[place] ^= 1 << (bit % 8);
                end = end.max(place);
            }
            end
        }
        Damage::Drop { count } => {
            let end = (at + count).min(bytes.len());
            bytes.drain(at..end);
            end
        }
        Damage::Insert { bytes: inserted } => {
            bytes.splice(at..at, inserted.iter().copied());
            at
        }
        Damage::Duplicate { count } => {
            let end = (at + count).min(bytes.len());
            let copy = bytes[at..end].to_vec();
            bytes.splice(at..at, copy);
            end
        }
        Damage::Swap { distance } => {
            let other = (at + distance).min(bytes.len() - 1);
            bytes.swap(at, other);
            other
        }
        Damage::Overwrite { bytes: new } => {
            let end = (at + new.len()).min(bytes.len());
            bytes[at..end].copy_from_slice(&new[..end - at]);
            end
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, ..ProptestConfig::default() })]

    #[test]
    fn undamaged_messages_arrive_in_order(
        messages in prop::collection::vec(message(), 1..6),
        first_seq in any::<u32>(),
        chunk in 1usize..300,
    ) {
        let frames = frames(&messages, first_seq);
        let (good, bad) = decode(&frames.concat(), chunk, first_seq);
        prop_assert_eq!(bad, 0);
        let good: Vec<_> = good.into_iter().map(|(_, frame)| frame).collect();
        prop_assert_eq!(&good, &frames);
        // The messages themselves are compared: encoding a decoded message again would not reveal a
        // field that is neither sent nor read.
        for (message, frame) in messages.iter().zip(&frames) {
            let mut decoder = Decoder::<MAX_FRAME>::new();
            let decoded = decoder.next::<ToHost>(&mut &frame[..]).unwrap().unwrap();
            prop_assert_eq!(&decoded.message, message);
        }
    }

    #[test]
    fn damage_yields_no_false_frame_and_costs_only_the_frames_it_touches(
        messages in prop::collection::vec(message(), 1..6),
        first_seq in any::<u32>(),
        damage in damage(),
        at in any::<prop::sample::Index>(),
        chunk in 1usize..300,
    ) {
        let frames = frames(&messages, first_seq);
        let mut bytes = frames.concat();
        let length = bytes.len();
        let at = at.index(length);
        let end = apply(&damage, &mut bytes, at);
        let (good, _) = decode(&bytes, chunk, first_seq);
        for (place, frame) in &good {
            // Every decoded frame equals a frame that was sent; a duplicate can arrive twice.
            prop_assert_eq!(Some(frame), frames.get(*place), "false frame");
        }
        let mut start = 0;
        for (place, frame) in frames.iter().enumerate() {
            let next = start + frame.len();
            // A frame must arrive if it lies before the damage, or if it lies after the damage and
            // its leading zero is intact.
            if next <= at || start > end {
                let arrived = good.iter().any(|(seen, _)| *seen == place);
                prop_assert!(arrived, "frame {} at {}..{} lost, damage {}..{}", place, start, next, at, end);
            }
            start = next;
        }
    }

    #[test]
    fn random_bytes_yield_no_frame_and_the_next_frame_arrives(
        noise in prop::collection::vec(prop_oneof![1 => Just(0u8), 3 => any::<u8>()], 0..6000),
        chunk in 1usize..300,
        message in message(),
    ) {
        let mut decoder = Decoder::<MAX_FRAME>::new();
        for mut input in noise.chunks(chunk) {
            while let Some(outcome) = decoder.next::<ToHost>(&mut input) {
                prop_assert!(outcome.is_err());
            }
        }
        let frame = frames(&[message], 0).concat();
        let mut input = frame.as_slice();
        let mut frames = 0;
        while let Some(outcome) = decoder.next::<ToHost>(&mut input) {
            frames += usize::from(outcome.is_ok());
        }
        prop_assert_eq!(frames, 1);
        let mut commands = Decoder::<64>::new();
        let mut input = noise.as_slice();
        while let Some(outcome) = commands.next::<ToDevice>(&mut input) {
            prop_assert!(outcome.is_err());
        }
    }
}

#[test]
fn damage_to_any_single_bit_or_byte_of_a_code_is_detected() {
    let values: &[u8] = Vec::leak((0..128).collect());
    assert_damage_is_detected(CodeValues::int8(values));
    assert_damage_is_detected(CodeValues::int8_exponent(3, values));
    let wide = values.iter().flat_map(|value| [*value; 2]);
    assert_damage_is_detected(CodeValues::int16(Vec::leak(wide.collect())));
}

fn assert_damage_is_detected(values: CodeValues<'static>) {
    let code = ToHost::Code(code_in(values));
    let frames = frames(&[code.clone(), code.clone(), code], 0);
    let bytes = frames.concat();
    let second = frames[0].len();
    for at in second..second + frames[1].len() {
        let mut variants = Vec::new();
        for bit in 0..8 {
            let mut flipped = bytes.clone();
            flipped[at] ^= 1 << bit;
            variants.push(flipped);
        }
        let mut dropped = bytes.clone();
        dropped.remove(at);
        variants.push(dropped);
        let mut swapped = bytes.clone();
        swapped.swap(at, at + 1);
        variants.push(swapped);
        let mut doubled = bytes.clone();
        doubled.insert(at, bytes[at]);
        variants.push(doubled);
        for variant in variants {
            let (good, _) = decode(&variant, 7, 0);
            assert!(good.iter().all(|(place, frame)| frames.get(*place) == Some(frame)));
            assert!(good.iter().any(|(place, _)| *place == 0), "byte {at}");
            // A damaged zero between two frames can cost one of them, never both.
            assert!(good.len() >= 2, "byte {at}");
            assert!(good.iter().any(|(place, _)| *place == 2), "byte {at}");
        }
    }
}
