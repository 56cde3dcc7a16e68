//! The mains frequency that the notch removes.

use model::{MAINS_50, MAINS_60, MainsFilter};

/// Mains frequency; chosen at start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mains {
    /// 50 Hz: Europe, most of Africa, Asia and Australia.
    #[default]
    Hz50,
    /// 60 Hz: the Americas and parts of Asia.
    Hz60,
}

impl Mains {
    /// The mains of so many Hz, if there are filters for it.
    pub const fn from_hz(hz: u8) -> Option<Self> {
        match hz {
            50 => Some(Self::Hz50),
            60 => Some(Self::Hz60),
            _ => None,
        }
    }

    /// The filters for this mains frequency.
    pub const fn filter(self) -> &'static MainsFilter {
        match self {
            Self::Hz50 => &MAINS_50,
            Self::Hz60 => &MAINS_60,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_mains_has_the_filter_of_its_frequency() {
        for mains in [Mains::Hz50, Mains::Hz60] {
            assert_eq!(Mains::from_hz(mains.filter().mains_hz), Some(mains));
        }
        assert_eq!(Mains::from_hz(55), None);
    }
}
