//! Tests that read back the files that the crate writes.
#![forbid(unsafe_code)]

mod both_kinds;
mod comparison;
mod damage;
mod exclusions;
mod formats;
mod packed;
mod recording;
mod report;
