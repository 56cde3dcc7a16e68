//! The option `--missing`.

use clap::ValueEnum;
use recordings::Missing;

/// Treatment of montage electrodes that a recording lacks.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum MissingElectrodes {
    /// Interpolate missing electrodes from the four nearest ones.
    Interpolate,
    /// Set missing electrodes to 0.
    Zero,
    /// Refuse the recording.
    Refuse,
}

impl From<MissingElectrodes> for Missing {
    fn from(choice: MissingElectrodes) -> Self {
        match choice {
            MissingElectrodes::Interpolate => Self::Interpolate,
            MissingElectrodes::Zero => Self::Zero,
            MissingElectrodes::Refuse => Self::Refuse,
        }
    }
}
