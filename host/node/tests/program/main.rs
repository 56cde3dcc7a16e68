//! The program `corticode-node` in a ROS graph, with the master of `ros1`.
#![allow(clippy::unwrap_used, reason = "tests")]

mod graph;
mod trouble;
