//! Fuzzes the target `view_request`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::run("view_request", bytes));
