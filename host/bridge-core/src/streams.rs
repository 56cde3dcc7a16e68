//! Conversion of the device's messages to NeuroFrames and NeuroEvents, with lost data filled and
//! counted.

pub(crate) mod bus;
pub(crate) mod code;
pub(crate) mod compressed;
pub(crate) mod continuity;
pub(crate) mod counts;
pub(crate) mod decoding;
pub(crate) mod event;
pub(crate) mod hop_timeline;
pub(crate) mod ledger;
pub(crate) mod neuro_frames;
pub(crate) mod packed;
mod recorder_shift;
pub(crate) mod sample;
pub(crate) mod side;
pub(crate) mod stamps;
pub(crate) mod tri;
pub(crate) mod trigger;
