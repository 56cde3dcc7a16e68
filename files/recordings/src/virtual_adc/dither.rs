//! Dither for recordings that repeat their values.

use super::rails::RAILS;

/// Number of channels of one converter of the chain (ADS1299).
const CONVERTER_CHANNELS: usize = 8;

/// Adds one count where all channels of a converter would repeat their last sample.
///
/// A real converter has noise, so its driver reports eight repeated counts as a frozen chip. A recording
/// has no such noise: a flat stretch, or one of low resolution, repeats exactly. Every second sample of
/// such a stretch gets one count (22.35 nV, a ninth of the converter's rms noise at 512 Hz) on each
/// channel that is neither 0 nor at a rail. All other samples stay as they are.
#[derive(Debug)]
pub(super) struct Dither<const CHANNELS: usize> {
    /// The sample before; at first a sample that no ADC delivers.
    last: [i32; CHANNELS],
}

impl<const CHANNELS: usize> Dither<CHANNELS> {
    pub(super) fn new() -> Self {
        const { assert!(CHANNELS.is_multiple_of(CONVERTER_CHANNELS)) };
        Self {
            last: [i32::MIN; CHANNELS],
        }
    }

    /// Changes the next sample so that no converter repeats the sample before.
    pub(super) fn apply(&mut self, counts: &mut [i32; CHANNELS]) {
        let new = counts.chunks_exact_mut(CONVERTER_CHANNELS);
        for (new, last) in new.zip(self.last.chunks_exact(CONVERTER_CHANNELS)) {
            if new != last {
                continue;
            }
            for count in new.iter_mut().filter(|count| is_live(**count)) {
                *count += 1;
            }
        }
        self.last = *counts;
    }
}

/// Returns whether a count is neither 0, as on a channel without an electrode, nor at a rail.
fn is_live(count: i32) -> bool {
    let value = f64::from(count);
    count != 0 && value > *RAILS.start() && value < *RAILS.end()
}

#[cfg(test)]
mod tests {
    use super::*;

    const CHANNELS: usize = 64;

    fn sample(first: [i32; CONVERTER_CHANNELS]) -> [i32; CHANNELS] {
        let mut counts = [0; CHANNELS];
        counts[..CONVERTER_CHANNELS].copy_from_slice(&first);
        counts
    }

    fn dithered(samples: &[[i32; CHANNELS]]) -> Vec<[i32; CHANNELS]> {
        let mut dither = Dither::new();
        let mut samples = samples.to_vec();
        for counts in &mut samples {
            dither.apply(counts);
        }
        samples
    }

    #[test]
    fn a_converter_never_repeats_and_is_off_by_at_most_one_count() {
        let flat = sample([5, -1, 8_388_607, -8_388_608, 0, 8_388_606, 100, -100]);
        let other = sample([6, 0, 8_388_607, -8_388_608, 0, 8_388_607, 101, -99]);
        let given = [flat, flat, other, other, flat, flat, flat];
        let delivered = dithered(&given);
        for pair in delivered.windows(2) {
            assert_ne!(pair[0][..8], pair[1][..8]);
        }
        for (given, delivered) in given.iter().zip(&delivered) {
            for (given, delivered) in given.iter().zip(delivered) {
                let added = delivered - given;
                assert!(added == 0 || (added == 1 && is_live(*given)), "{given}");
            }
        }
    }

    #[test]
    fn one_channel_that_changes_is_enough_to_leave_its_converter_as_it_is() {
        let samples: Vec<_> = (0..100)
            .map(|k| sample([7, 7, 7, 7, 7, 7, 7, k % 2]))
            .collect();
        assert_eq!(dithered(&samples), samples);
    }
}
