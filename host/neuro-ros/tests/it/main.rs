//! Tests of the messages: their definitions, their serialisation, the rules for the shape of
//! frames, and the lines of JSON.
#![allow(missing_docs, clippy::unwrap_used, reason = "tests")]

mod contract;
mod definitions;
mod ndjson;
mod wire;
