//! Tests of the program `corticode-bridge`, between a simulated board and a ROS master.
#![allow(missing_docs, clippy::unwrap_used, reason = "tests")]

mod backlog;
#[path = "../../../bridge-core/tests/it/board.rs"]
#[expect(dead_code, reason = "the tests of the core use more of it")]
mod board;
mod command_line;
mod config;
mod convert;
mod device;
mod doctor;
mod graph;
mod lines;
mod machine;
mod master;
mod names;
mod outlets;
#[path = "../../../bridge-core/tests/it/packed_block.rs"]
mod packed_block;
#[path = "../../../capture/tests/it/packed_recording.rs"]
#[expect(dead_code, reason = "the tests of the core use more of it")]
mod packed_recording;
mod page;
mod process;
mod query;
mod record;
mod recorders;
mod replay;
mod replug;
#[path = "../../src/ports/simulated_machine.rs"]
#[expect(dead_code, reason = "the tests of the crate use more of it")]
mod simulated_machine;
#[path = "../../../capture/tests/it/synthetic_recording.rs"]
mod synthetic_recording;
mod trouble;
mod viewer;
