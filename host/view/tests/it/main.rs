//! Tests of the live page's server, over TCP.
#![allow(missing_docs, clippy::unwrap_used, reason = "tests")]

mod access;
mod client;
mod load;
