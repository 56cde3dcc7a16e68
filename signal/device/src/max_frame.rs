//! Length of the longest frame of the model that this program was built with.

use link::frame_bytes;
use model::{CELLS, CODE, LABELS, STEPS};

/// Bytes of a body with the fields that every message has: header, message number and CRC.
const FRAME_FIELDS: usize = 21;
/// Longest body of the messages whose length does not depend on the model, bytes.
const OTHER_BODIES: usize = 2_048;
/// Longest body of an `Audit`, bytes: model id, window, planes with their length, format, exponent,
/// values.
const AUDIT: usize = FRAME_FIELDS + 8 + 5 + 3 + STEPS * CELLS + 2 + 2 * CODE;
/// Longest body of a `Capabilities`, bytes: rates, dimensions and delays, two texts, scales and zero
/// points.
const CAPABILITIES: usize =
    FRAME_FIELDS + 20 + 2 + LABELS.len() + 2 + link::MAX_TEXT_BYTES + 2 + 4 * CODE + 2 + CODE;

/// Length of the longest frame that a device with this model sends, bytes. [`link::MAX_FRAME`] is that
/// of the largest model.
pub const MAX_FRAME: usize = {
    let mut longest = OTHER_BODIES;
    if AUDIT > longest {
        longest = AUDIT;
    }
    if CAPABILITIES > longest {
        longest = CAPABILITIES;
    }
    frame_bytes(longest)
};

const _: () = assert!(MAX_FRAME <= link::MAX_FRAME);
