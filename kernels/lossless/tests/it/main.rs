//! Tests that signals and recordings come back bit for bit.
#![forbid(unsafe_code)]

mod recordings;
mod round_trip;
