//! The bridge without the world: every byte and every microsecond is the test's.
#![allow(missing_docs, clippy::unwrap_used, reason = "tests")]

mod audit;
mod board;
mod clock;
mod compatibility;
mod contract;
mod converters;
mod events;
mod extremes;
mod formats;
mod invalid_samples;
mod ledger;
mod loss;
mod query;
mod reconstruction;
mod recorder;
mod round_trip;
mod samples;
mod session;
mod signal_quality;
mod silence;
mod streams;
mod timing;
