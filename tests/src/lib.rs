//! What the whole promises, end to end: processes as a user starts them, judged from outside.
#![forbid(unsafe_code)]

pub mod npz;
pub mod real_data;
pub mod skip;
pub mod workspace;
