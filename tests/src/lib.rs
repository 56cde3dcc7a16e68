//! What the whole promises, end to end: processes as a user starts them, judged from outside.
#![forbid(unsafe_code)]

pub mod any_artifact;
pub mod chain;
pub mod emulator;
pub mod modules;
pub mod npz;
pub mod numpy_reference;
pub mod process;
pub mod programs;
pub mod real_data;
pub mod ros;
pub mod ros_messages;
pub mod skip;
pub mod virtual_board;
pub mod workspace;
