//! What the vectors run on.

use pipeline::{Acquisition, Encoder, Mains};

/// The pipeline's halves; too large for a stack.
#[derive(Debug)]
pub struct Device {
    pub(crate) acquisition: Acquisition,
    pub(crate) encoder: Encoder<'static>,
}

impl Device {
    /// A device at rest.
    pub const fn new() -> Self {
        Self {
            acquisition: Acquisition::new(Mains::Hz50),
            encoder: Encoder::new(),
        }
    }
}

impl Default for Device {
    fn default() -> Self {
        Self::new()
    }
}
