//! Tests of recordings: their bytes, damage, conversion, and replay to the bridge's core.
#![allow(missing_docs, clippy::unwrap_used, reason = "tests")]

#[path = "../../../bridge-core/tests/it/board.rs"]
#[expect(dead_code, reason = "the tests of the core use more of it")]
mod board;
mod hostile_recording;
#[path = "../../../bridge-core/tests/it/packed_block.rs"]
mod packed_block;
#[path = "../../../bridge-core/tests/it/packed_device.rs"]
#[expect(dead_code, reason = "the tests of the core use more of it")]
mod packed_device;
#[expect(dead_code, reason = "the tests of the program use more of it")]
mod packed_recording;
mod packed_replay;
#[path = "../../../bridge-core/tests/it/recorder.rs"]
#[expect(dead_code, reason = "the tests of the core use more of it")]
mod recorder;
mod recording;
#[expect(dead_code, reason = "the tests of the program use more of it")]
mod synthetic_recording;
