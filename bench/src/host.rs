//! What `examples/host.rs` and `cargo xtask bench host` agree on.

use core::time::Duration;

/// A turn of the stream of steps through one encoder.
pub const STREAMING: &str = "streaming";
/// A turn of window after window, each through an encoder of its own.
pub const WINDOWS: &str = "windows";
/// A turn of ADC samples through acquisition and encoder.
pub const PIPELINE: &str = "pipeline";

/// Counts of all channels, sample by sample, 32 bits each, little endian.
pub const COUNTS: &str = "counts.bin";
/// The codes of all windows, value by value, as steps of 32 bits, little endian.
pub const CODES: &str = "codes.bin";

/// A turn lasts at least so long.
pub const TURN: Duration = Duration::from_millis(200);
