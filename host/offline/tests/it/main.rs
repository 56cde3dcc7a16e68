//! Files that the crate writes, read back.
#![forbid(unsafe_code)]

mod both_kinds;
mod comparison;
mod damage;
mod formats;
mod packed;
mod recording;
mod report;
