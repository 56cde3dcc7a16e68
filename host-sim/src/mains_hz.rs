//! The option `--mains`.

use clap::ValueEnum;
use pipeline::Mains;

/// Mains frequency of the notch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum MainsHz {
    /// 50 Hz: Europe, most of Africa, Asia and Australia.
    #[value(name = "50")]
    Fifty,
    /// 60 Hz: the Americas and parts of Asia.
    #[value(name = "60")]
    Sixty,
}

impl MainsHz {
    pub(crate) fn hz(self) -> u8 {
        match self {
            Self::Fifty => 50,
            Self::Sixty => 60,
        }
    }
}

impl From<MainsHz> for Mains {
    fn from(mains: MainsHz) -> Self {
        match mains {
            MainsHz::Fifty => Self::Hz50,
            MainsHz::Sixty => Self::Hz60,
        }
    }
}
