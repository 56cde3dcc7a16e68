//! Frames on a line with bit errors: the losses are those computed from the bit error rate, and no
//! wrong frame is ever accepted.
#![allow(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "counts below 2^32 and positive gaps"
)]
use link::{Code, CodeValues, Decoder, Encoder, MAX_FRAME, ToHost};

use crate::messages::code_in;

/// Seeded random generator SplitMix64 (Steele, Lea, Flood 2014), which needs no dependency.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ (mixed >> 31)
    }

    /// Returns the number of intact bits before the next error at bit error rate `ber`: a random
    /// number with geometric distribution, by inversion of its distribution function.
    fn gap(&mut self, ber: f64) -> u64 {
        let uniform = ((self.next() >> 11) as f64 + 0.5) / (1u64 << 53) as f64;
        (uniform.ln() / (1.0 - ber).ln()) as u64
    }
}

#[test]
fn loss_follows_the_bit_error_rate_and_no_wrong_frame_is_accepted() {
    // Pairs of a bit error rate and the number of frames sent at it. About 260 losses are expected
    // at 1e-6, and more at each higher rate.
    for (ber, count) in [
        (1e-6, 200_000),
        (1e-5, 60_000),
        (1e-4, 10_000),
        (1e-3, 3_000),
    ] {
        let mut noise = Noise(7);
        let mut encoder = Encoder::default();
        let mut decoder = Decoder::<MAX_FRAME>::new();
        let (mut until_error, mut bits, mut hits, mut received) =
            (noise.gap(ber), 0u64, 0u64, 0u64);
        let mut buffer = [0; MAX_FRAME];
        for window in 0..count {
            let seed = noise.next().to_le_bytes();
            let values = core::array::from_fn::<u8, 128, _>(|index| {
                seed[index % 8].wrapping_mul(index as u8 | 1)
            });
            let sent = Code {
                model_id: seed,
                window,
                ..code_in(CodeValues::int8(&values))
            };
            let length = encoder
                .encode(u64::from(window) * 62_500, &ToHost::Code(sent), &mut buffer)
                .unwrap()
                .len();
            let frame = &mut buffer[..length];
            bits += length as u64 * 8;
            let mut at = 0;
            let mut hit = false;
            while at + until_error < length as u64 * 8 {
                at += until_error;
                frame[(at / 8) as usize] ^= 1 << (at % 8);
                hit = true;
                at += 1;
                until_error = noise.gap(ber);
            }
            until_error -= length as u64 * 8 - at;
            hits += u64::from(hit);
            let mut input = &frame[..];
            while let Some(outcome) = decoder.next::<ToHost>(&mut input) {
                let Ok(frame) = outcome else { continue };
                assert_eq!(
                    frame.message,
                    ToHost::Code(sent),
                    "a wrong frame was accepted"
                );
                received += 1;
            }
        }
        let count = u64::from(count);
        let lost = count - received;
        let mean_bits = bits as f64 / count as f64;
        let expected = count as f64 * (1.0 - (1.0 - ber).powf(mean_bits));
        // A bit error costs the damaged frame, and a neighbouring frame only if both zeros between
        // the two are damaged.
        assert!(
            lost <= 2 * hits,
            "more than one extra frame lost per hit: {lost} of {hits}"
        );
        // 10 % of the expected loss, plus four standard deviations (Poisson) of the number of
        // losses.
        let tolerance = 0.1 * expected + 4.0 * expected.sqrt();
        assert!(
            (lost as f64 - expected).abs() <= tolerance,
            "{ber}: {lost}, expected {expected}"
        );
    }
}
