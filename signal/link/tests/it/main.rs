//! Tests of the wire format, of both ends, and of `docs/wire-format.md`.
#![allow(missing_docs, clippy::unwrap_used, reason = "tests")]

mod compatibility;
mod corruption;
mod largest;
mod messages;
mod random_message;
mod wire_format;
