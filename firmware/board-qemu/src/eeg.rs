//! Made-up EEG, in integers, for a host that gives no recording.

use pipeline::Sample;

/// Slow noise and a 10 Hz wave, shared by all channels in different parts.
#[derive(Debug)]
pub(crate) struct Eeg {
    random: u32,
    /// Slow noise of each channel, counts.
    slow: Sample,
    /// The wave and its quadrature, Q15.
    wave: [i32; 2],
}

/// A 10 Hz wave's turn from sample to sample, Q15: cosine and sine of 2 pi 10 / 512.
const TURN: [i32; 2] = [32_522, 4_011];

/// Amplitude of the wave in counts: 20 uV at 22.35 nV each.
const WAVE: i32 = 895;

impl Eeg {
    pub(crate) fn new() -> Self {
        Self {
            random: 1,
            slow: Sample::default(),
            wave: [i32::from(i16::MAX), 0],
        }
    }

    /// The next sample.
    pub(crate) fn next(&mut self, sample: &mut Sample) {
        let ([c, s], [x, y]) = (TURN, self.wave);
        self.wave = [(c * x - s * y) >> 15, (s * x + c * y) >> 15];
        if self.wave[0] == 0 && self.wave[1] == 0 {
            self.wave = [i32::from(i16::MAX), 0];
        }
        let channels = sample.counts.iter_mut().zip(&mut self.slow.counts);
        for (index, (count, slow)) in (1..).zip(channels) {
            // Numerical Recipes' generator.
            self.random = self
                .random
                .wrapping_mul(1_664_525)
                .wrapping_add(1_013_904_223);
            let noise = self.random.cast_signed() >> 20;
            *slow += noise - (*slow >> 6);
            let part = WAVE * (index % 5) / 4;
            *count = *slow + ((self.wave[0] * part) >> 15);
        }
    }
}
