//! The bridge as a program: a fake board on one side, ROS's embedded master on the other.
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
