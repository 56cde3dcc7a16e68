//! Synthetic EEG in integer arithmetic, for an emulation without a recording.

use pipeline::Sample;

/// Generator of synthetic EEG: independent low-frequency noise in each channel, and a 10 Hz wave that
/// is common to all channels, with an amplitude that varies from channel to channel.
#[derive(Debug)]
pub(crate) struct Eeg {
    random: u32,
    /// Current value of each channel's slow noise, counts.
    slow: Sample,
    /// Current value of the 10 Hz wave, and its quadrature (the wave delayed by 90 degrees), Q15.
    wave: [i32; 2],
}

/// Rotation of the 10 Hz wave from sample to sample, Q15: cosine and sine of 2 pi * 10 Hz / 512 Hz.
const ROTATION: [i32; 2] = [32_522, 4_011];

/// Largest amplitude of the wave over the channels: 20 uV, in counts of 22.35 nV.
const AMPLITUDE: i32 = 895;

impl Eeg {
    pub(crate) fn new() -> Self {
        Self {
            random: 1,
            slow: Sample::default(),
            wave: [i32::from(i16::MAX), 0],
        }
    }

    /// Writes the counts of the next sample.
    pub(crate) fn fill(&mut self, sample: &mut Sample) {
        let ([c, s], [x, y]) = (ROTATION, self.wave);
        self.wave = [(c * x - s * y) >> 15, (s * x + c * y) >> 15];
        if self.wave[0] == 0 && self.wave[1] == 0 {
            self.wave = [i32::from(i16::MAX), 0];
        }
        let channels = sample.counts.iter_mut().zip(&mut self.slow.counts);
        for (index, (count, slow)) in (1..).zip(channels) {
            // Linear congruential generator with the constants of Numerical Recipes.
            self.random = self
                .random
                .wrapping_mul(1_664_525)
                .wrapping_add(1_013_904_223);
            let noise = self.random.cast_signed() >> 20;
            *slow += noise - (*slow >> 6);
            let part = AMPLITUDE * (index % 5) / 4;
            *count = *slow + ((self.wave[0] * part) >> 15);
        }
    }
}
