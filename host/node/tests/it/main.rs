//! Tests of the acquisition, which stands in for a device, without ROS or a real-time clock, and of
//! the program `corticode-node` in a ROS graph with the master of `ros1`.
#![allow(clippy::unwrap_used, reason = "tests")]

mod acquisition;
mod codes;
mod gaps;
mod graph;
mod harness;
mod rates;
mod refusals;
mod trouble;
