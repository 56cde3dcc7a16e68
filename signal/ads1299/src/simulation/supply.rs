//! Power state of the simulated chips.

/// Whether the chips' supplies are on, and since when.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Supply {
    /// Without power: the pins may be driven, no chip answers.
    Off,
    /// With power since this time, in nanoseconds.
    On(u64),
}

impl Supply {
    pub(super) const fn is_on(self) -> bool {
        matches!(self, Self::On(_))
    }
}
