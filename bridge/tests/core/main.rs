//! The bridge without the world: every byte and every microsecond is the test's.
#![allow(missing_docs, clippy::unwrap_used, reason = "tests")]

mod board;
mod clock;
mod compatibility;
mod contract;
mod formats;
mod ledger;
mod loss;
mod reconstruction;
mod recorder;
mod session;
mod signal_quality;
mod silence;
mod timing;
