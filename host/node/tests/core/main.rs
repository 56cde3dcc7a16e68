//! The acquisition as a device, driven without ROS and without a clock.
#![allow(clippy::unwrap_used, reason = "tests")]

mod acquisition;
mod codes;
mod gaps;
mod harness;
mod refusals;
