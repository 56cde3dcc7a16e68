//! Where an encoder's weights come from.

use model::{NETWORK, Network};

/// Where an encoder's weights come from.
pub trait Weights: Copy {
    /// The network.
    fn network(&self) -> &Network<'_>;
}

/// The network that is built in: the compiler knows every length of it, and nothing is checked when the
/// encoder runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BuiltIn;

impl Weights for BuiltIn {
    #[inline]
    fn network(&self) -> &Network<'_> {
        &NETWORK
    }
}

impl Weights for &Network<'_> {
    #[inline]
    fn network(&self) -> &Network<'_> {
        self
    }
}
