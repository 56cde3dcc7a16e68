//! What the whole promises, end to end: processes as a user starts them, judged from outside.
#![forbid(unsafe_code)]

pub mod workspace;
