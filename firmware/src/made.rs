//! From the encoder to the conversation.

use device::Marks;
use pipeline::{Code, Quality};

/// What the encoder's task makes.
#[expect(
    clippy::large_enum_variant,
    reason = "slots of a queue, which are written in place"
)]
#[derive(Clone, Debug, Default)]
pub enum Made {
    /// Nothing yet.
    #[default]
    Nothing,
    /// A code.
    Code {
        /// Number of the run that it is of.
        run: u32,
        /// Its values.
        code: Code,
        /// What was wrong around its window.
        marks: Marks,
        /// Device time of its window's last step, microseconds.
        step_us: u64,
        /// When it was handed on, on the board's clock, ticks.
        made_ticks: u32,
    },
    /// What each electrode delivered within the last second.
    Quality {
        /// Number of the run that it is of.
        run: u32,
        /// The figures.
        quality: Quality,
        /// Device time of the second's last sample, microseconds.
        at_us: u64,
    },
}
