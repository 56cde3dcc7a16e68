//! What a board can do.

use link::Streams;

/// What a board can do beside streaming codes; what it cannot is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Abilities {
    /// Streams that it has.
    pub streams: Streams,
    /// Whether its converters can be tried with their own signals.
    pub self_test: bool,
    /// Whether it can start its microcontroller's own loader.
    pub bootloader: bool,
}

impl Abilities {
    /// Codes and nothing else.
    pub const CODES: Self = Self {
        streams: Streams::CODES,
        self_test: false,
        bootloader: false,
    };
}
