//! Converter of the emulated board: samples from a file, or synthetic EEG.

use core::{
    future::pending,
    sync::atomic::{AtomicBool, Ordering::Relaxed},
};

use firmware::{Conversion, Converter};
use model::CHANNELS;
use pipeline::Sample;

use crate::{drdy, eeg::Eeg, host_file::HostFile};

/// Name of the file of samples: for each sample the counts of all channels, 32 bits each, little
/// endian.
pub(crate) const SAMPLES: &core::ffi::CStr = c"samples.i32";

/// Set when all samples of the file have been read.
pub(crate) static FILE_ENDED: AtomicBool = AtomicBool::new(false);

/// Source of the samples.
#[derive(Debug)]
#[expect(clippy::large_enum_variant, reason = "there is exactly one value")]
pub(crate) enum SampleSource {
    /// The file [`SAMPLES`] on the PC.
    File(HostFile),
    /// Endless synthetic EEG.
    Eeg(Eeg),
}

impl SampleSource {
    /// Opens the file [`SAMPLES`], or falls back to synthetic EEG if there is none.
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
        // Read the samples of the missed edges too, and discard them: a converter overwrites a
        // sample that is not read in time.
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
