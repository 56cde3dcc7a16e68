//! Whether the model in flash is the one that was built.

use core::hint::black_box;

use model::{NETWORK, NETWORK_CHECKSUM};

/// What a device with a damaged model says of itself.
pub const MODEL_DAMAGED: &str = "the model in flash is damaged: flash the firmware again";

/// Reads the whole network once, as an encoder would; some milliseconds, for a board's start.
pub fn model_is_sound() -> bool {
    // The compiler knows the answer, the flash need not.
    black_box(&NETWORK).checksum() == NETWORK_CHECKSUM
}
