//! Tests of the messages, their definitions and serialisation, the contract of frames, and the
//! lines of JSON.
#![allow(missing_docs, clippy::unwrap_used, reason = "tests")]

mod contract;
mod definitions;
mod ndjson;
mod wire;
