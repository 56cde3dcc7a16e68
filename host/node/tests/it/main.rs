//! Tests of the acquisition as a device, without ROS and a clock, and of the program
//! `corticode-node` in a ROS graph with the master of `ros1`.
#![allow(clippy::unwrap_used, reason = "tests")]

mod acquisition;
mod codes;
mod gaps;
mod graph;
mod harness;
mod rates;
mod refusals;
mod trouble;
