//! Converter of the emulated board: samples from a file, or synthetic EEG in integer arithmetic.

use core::future::pending;
use core::sync::atomic::AtomicBool;
use core::sync::atomic::Ordering::Relaxed;

use firmware::{Conversion, Converter};
use model::CHANNELS;
use pipeline::Sample;

use crate::drdy;
use crate::semihosting::HostFile;

/// Name of the file of samples: for each sample the counts of all channels, 32 bits each, little
/// endian.
pub(crate) const SAMPLES: &core::ffi::CStr = c"samples.i32";

/// Set when all samples of the file have been read.
pub(crate) static FILE_ENDED: AtomicBool = AtomicBool::new(false);

/// Where the samples of the emulated converter come from.
#[derive(Debug)]
#[expect(clippy::large_enum_variant, reason = "there is exactly one value")]
pub(crate) enum SampleSource {
    /// The file [`SAMPLES`] on the PC.
    File(HostFile),
    /// Endless synthetic EEG.
    Eeg(Eeg),
}

impl SampleSource {
    /// Opens the file [`SAMPLES`], or generates synthetic EEG if there is no such file.
    pub(crate) fn open() -> Self {
        HostFile::open(SAMPLES).map_or_else(|| Self::Eeg(Eeg::new()), Self::File)
    }

    /// Reads the next sample. Returns false at the end of the file.
    fn read(&mut self, sample: &mut Sample) -> bool {
        match self {
            Self::File(file) => {
                let mut bytes = [0; 4 * CHANNELS];
                let whole = file.read(&mut bytes);
                if whole {
                    for (count, bytes) in sample.counts.iter_mut().zip(bytes.as_chunks().0) {
                        *count = i32::from_le_bytes(*bytes);
                    }
                }
                whole
            }
            Self::Eeg(eeg) => {
                eeg.fill(sample);
                true
            }
        }
    }
}

impl Converter for SampleSource {
    async fn next(&mut self, sample: &mut Sample) -> Conversion {
        let edge = drdy::next_edge().await;
        // Read and discard the samples of the missed edges: a converter overwrites samples that are
        // not read in time.
        let whole = (0..=edge.missed).all(|_| self.read(sample));
        if !whole {
            FILE_ENDED.store(true, Relaxed);
            pending::<()>().await;
        }
        Conversion {
            drdy_us: edge.us,
            drdy_ticks: edge.ticks,
            missed: u32::try_from(edge.missed).unwrap_or(u32::MAX),
            ..Conversion::default()
        }
    }
}

/// Generator of synthetic EEG: low-frequency noise, independent in each channel, and a 10 Hz wave
/// common to all channels, whose amplitude differs from channel to channel.
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
        Self { random: 1, slow: Sample::default(), wave: [i32::from(i16::MAX), 0] }
    }

    /// Writes the next sample's synthetic counts to `sample`.
    pub(crate) fn fill(&mut self, sample: &mut Sample) {
        let ([c, s], [x, y]) = (ROTATION, self.wave);
        self.wave = [(c * x - s * y) >> 15, (s * x + c * y) >> 15];
        if self.wave[0] == 0 && self.wave[1] == 0 {
            self.wave = [i32::from(i16::MAX), 0];
        }
        let channels = sample.counts.iter_mut().zip(&mut self.slow.counts);
        for (index, (count, slow)) in (1..).zip(channels) {
            // Linear congruential generator with the constants of Numerical Recipes.
            self.random = self.random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let noise = self.random.cast_signed() >> 20;
            *slow += noise - (*slow >> 6);
            let part = AMPLITUDE * (index % 5) / 4;
            *count = *slow + ((self.wave[0] * part) >> 15);
        }
    }
}
