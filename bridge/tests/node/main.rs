//! Tests of the program `corticode-bridge`, between a simulated board and this project's ROS
//! master.
#![allow(missing_docs, clippy::unwrap_used, reason = "tests")]

mod abuse;
mod backlog;
#[path = "../core/board.rs"]
#[expect(dead_code, reason = "the tests of the core use more of it")]
mod board;
mod command_line;
mod config;
mod convert;
mod device;
mod graph;
mod hostile_recording;
mod lines;
mod long_outage;
mod master;
mod names;
mod process;
mod query;
mod record;
mod replay;
mod replug;
mod shell;
mod synthetic_recording;
mod trouble;
