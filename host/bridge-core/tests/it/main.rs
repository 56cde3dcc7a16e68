//! Tests of the bridge's core with simulated boards, links and clocks.
#![allow(missing_docs, clippy::unwrap_used, reason = "tests")]

mod audit;
mod board;
mod bus;
mod clock;
mod compressed;
mod contract;
mod diagnostics;
mod events;
mod exclusion;
mod extreme_values;
mod features;
mod impedance;
mod invalid_samples;
mod loss;
mod other_devices;
mod packed;
mod packed_block;
mod packed_device;
mod packed_fallback;
mod packed_interruptions;
mod query;
mod reconstruction;
mod recorder;
mod recording;
mod restart;
mod round_trip;
mod samples;
mod session;
mod streams;
mod upload;
