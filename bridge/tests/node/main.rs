//! Tests of the program, between a simulated board and our own ROS master.
#![allow(missing_docs, clippy::unwrap_used, reason = "tests")]

mod abuse;
#[path = "../core/board.rs"]
#[allow(dead_code, reason = "the other tests use more of it")]
mod board;
mod command_line;
mod device;
mod graph;
mod lines;
mod process;
mod query;
mod replug;
