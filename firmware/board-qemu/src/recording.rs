//! Samples from a file of the host, or made-up ones.

use core::{
    future::pending,
    sync::atomic::{AtomicBool, Ordering::Relaxed},
};

use firmware::{Conversion, Converter};
use model::CHANNELS;
use pipeline::Sample;

use crate::{drdy, eeg::Eeg, host_file::HostFile};

/// The file: sample by sample, channel by channel, counts of 32 bits, little endian.
pub(crate) const SAMPLES: &core::ffi::CStr = c"samples.i32";

/// Set when the file has ended.
pub(crate) static ENDED: AtomicBool = AtomicBool::new(false);

/// What the emulated converter reads.
#[derive(Debug)]
#[expect(clippy::large_enum_variant, reason = "there is one, for ever")]
pub(crate) enum Recording {
    /// A file of the host.
    File(HostFile),
    /// Made-up EEG, without end.
    Eeg(Eeg),
}

impl Recording {
    /// The host's file, if there is one.
    pub(crate) fn open() -> Self {
        HostFile::open(SAMPLES).map_or_else(|| Self::Eeg(Eeg::new()), Self::File)
    }

    /// The next sample; false where there is none.
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
                eeg.next(sample);
                true
            }
        }
    }
}

impl Converter for Recording {
    async fn next(&mut self, sample: &mut Sample) -> Conversion {
        let edge = drdy::next().await;
        // What nobody read in time is gone, as with any converter.
        let whole = (0..=edge.missed).all(|_| self.read(sample));
        if !whole {
            ENDED.store(true, Relaxed);
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
