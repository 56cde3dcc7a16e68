//! Converts the device's messages to NeuroFrames and NeuroEvents, and counts and fills lost data.

pub(crate) mod code;
pub(crate) mod event;
pub(crate) mod features;
pub(crate) mod hop_timeline;
pub(crate) mod ledger;
pub(crate) mod neuro_frames;
pub(crate) mod packed;
pub(crate) mod rows;
pub(crate) mod sample;
pub(crate) mod side;
pub(crate) mod stamps;
