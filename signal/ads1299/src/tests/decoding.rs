//! Decoding inverts encoding for frames with any counts, and each fault in a frame is found.

use std::vec::Vec;

use proptest::prelude::*;

use crate::decoder::{Alignment, CHANNELS, Decoder, frame_bytes};

/// Returns the frame that a chain sends for these counts, with `other` as every don't-care bit.
fn encode<const CHIPS: usize, const BYTES: usize>(
    status: u32,
    counts: &[[i32; CHANNELS]; CHIPS],
    alignment: Alignment,
    other: bool,
) -> [u8; BYTES] {
    let mut bits = Vec::new();
    for chip in counts {
        let words = [status].into_iter().chain(chip.iter().map(|c| c.cast_unsigned()));
        for word in words {
            bits.extend((0..24).rev().map(|bit| word >> bit & 1 != 0));
        }
        if alignment == Alignment::Spaced {
            bits.push(other);
        }
    }
    pack(&bits)
}

/// Packs bits into bytes, most significant first; missing bits are 0.
fn pack<const BYTES: usize>(bits: &[bool]) -> [u8; BYTES] {
    let mut frame = [0; BYTES];
    for (byte, bits) in frame.iter_mut().zip(bits.chunks(8)) {
        for (place, bit) in bits.iter().enumerate() {
            *byte |= u8::from(*bit) << (7 - place);
        }
    }
    frame
}

fn alignments() -> impl Strategy<Value = Alignment> {
    prop_oneof![Just(Alignment::Packed), Just(Alignment::Spaced)]
}

fn counts() -> impl Strategy<Value = i32> {
    prop_oneof![
        4 => -(1 << 23)..(1 << 23),
        1 => prop_oneof![Just((1 << 23) - 1), Just(-(1 << 23)), Just(-1), Just(0), Just(1)],
    ]
}

fn inverts<const CHIPS: usize, const BYTES: usize>(
    counts: &[[i32; CHANNELS]; CHIPS],
    low: u32,
    alignment: Alignment,
    other: bool,
) {
    let status = 0xC0_0000 | low;
    let frame = encode::<CHIPS, BYTES>(status, counts, alignment, other);
    let mut decoder = Decoder::<CHIPS>::new();
    let mut decoded = [[0; CHANNELS]; CHIPS];
    let found = decoder.decode(&frame, &mut decoded);
    assert_eq!(&decoded, counts);
    assert!(found.is_sound(), "{found:?}");
    assert!(found.words.iter().all(|word| word.0 == status));
    // With a single chip the decoder never decides on an alignment.
    assert_eq!(decoder.alignment(), (CHIPS > 1).then_some(alignment));
}

proptest! {
    #[test]
    fn decoding_inverts_encoding_for_any_counts_and_either_alignment(
        all in prop::collection::vec(counts(), 64),
        low in 0_u32..1 << 20,
        alignment in alignments(),
        other: bool,
    ) {
        let all: [[i32; CHANNELS]; 8] =
            core::array::from_fn(|chip| core::array::from_fn(|n| all[chip * CHANNELS + n]));
        inverts::<8, 217>(&all, low, alignment, other);
        inverts::<3, 82>(&[all[1], all[2], all[3]], low, alignment, other);
        inverts::<2, 55>(&[all[4], all[5]], low, alignment, other);
        inverts::<1, 28>(&[all[7]], low, alignment, other);
    }

    #[test]
    fn no_bytes_make_it_panic_or_leave_24_bits(bytes in prop::collection::vec(any::<u8>(), 217 * 3)) {
        let mut decoder = Decoder::<8>::new();
        let mut decoded = [[0; CHANNELS]; 8];
        for frame in bytes.as_chunks::<217>().0 {
            let status = decoder.decode(frame, &mut decoded);
            let bad: Vec<usize> = (0..8).filter(|chip| status.bad >> chip & 1 != 0).collect();
            let wrong: Vec<usize> =
                (0..8).filter(|chip| status.words[*chip].nibble() != 0b1100).collect();
            prop_assert_eq!(bad, wrong);
            prop_assert!(decoded.as_flattened().iter().all(|c| (-(1 << 23)..1 << 23).contains(c)));
        }
    }
}

#[test]
fn lead_off_bits_are_in_the_status_word() {
    let mut frame = [0_u8; frame_bytes(1)];
    frame[..3].copy_from_slice(&[0xC8, 0x10, 0x2A]);
    let mut counts = [[0; CHANNELS]];
    let word = Decoder::<1>::new().decode(&frame, &mut counts).words[0];
    assert_eq!((word.off_positive(), word.off_negative()), (0x81, 0x02));
}

/// Returns counts that differ from frame to frame and between channels.
fn moving(frame: i32) -> [[i32; CHANNELS]; 8] {
    let mut count = frame;
    [[(); CHANNELS]; 8].map(|chip| {
        chip.map(|()| {
            count += 5000;
            count
        })
    })
}

#[test]
fn a_dead_chip_is_named_and_the_others_are_decoded_even_in_the_first_frame() {
    for alignment in [Alignment::Packed, Alignment::Spaced] {
        for dead in 0..8 {
            let counts = moving(1);
            let mut frame: [u8; 217] = encode(0xC0_0000, &counts, alignment, true);
            for bit in 0..216 {
                let at = dead * (216 + alignment as usize) + bit;
                frame[at / 8] &= !(0x80 >> (at % 8));
            }
            let mut decoder = Decoder::<8>::new();
            let mut decoded = [[0; CHANNELS]; 8];
            let status = decoder.decode(&frame, &mut decoded);
            assert_eq!(status.bad, 1 << dead, "{alignment:?}");
            for chip in (0..8).filter(|chip| *chip != dead) {
                assert_eq!(decoded[chip], counts[chip], "{alignment:?} {chip} beside {dead}");
            }
        }
    }
}

#[test]
fn a_chip_that_repeats_itself_is_named_but_not_one_at_the_rail() {
    let mut decoder = Decoder::<8>::new();
    let mut decoded = [[0; CHANNELS]; 8];
    let mut counts = moving(1);
    counts[3] = [(1 << 23) - 1; CHANNELS];
    counts[3][0] = -(1 << 23);
    let frame: [u8; 217] = encode(0xC0_0000, &counts, Alignment::Packed, false);
    assert!(decoder.decode(&frame, &mut decoded).is_sound());
    let mut next = moving(2);
    next[3] = counts[3];
    next[6] = counts[6];
    let frame: [u8; 217] = encode(0xC0_0000, &next, Alignment::Packed, false);
    let status = decoder.decode(&frame, &mut decoded);
    assert_eq!((status.bad, status.repeated), (0, 1 << 6));
}

#[test]
fn a_lost_bit_in_the_first_frame_of_two_chips_does_not_last() {
    let mut decoder = Decoder::<2>::new();
    let mut decoded = [[0; CHANNELS]; 2];
    let two = |n| [moving(n)[0], moving(n)[1]];
    // An extra clock edge between the chips makes the first frame fit the wrong alignment. The next
    // three frames are flagged; the fourth one corrects the alignment.
    let slipped: [u8; 55] = encode(0xC0_0000, &two(0), Alignment::Spaced, false);
    decoder.decode(&slipped, &mut decoded);
    let mut flagged = 0;
    for n in 1..9 {
        let frame: [u8; 55] = encode(0xC0_0000, &two(n), Alignment::Packed, false);
        let status = decoder.decode(&frame, &mut decoded);
        flagged += u32::from(!status.is_sound());
        assert!(status.is_sound() == (decoded == two(n)), "frame {n}");
    }
    assert_eq!(flagged, 3);
    assert_eq!(decoder.alignment(), Some(Alignment::Packed));
}
