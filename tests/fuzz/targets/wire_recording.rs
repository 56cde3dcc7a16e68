//! Fuzzes the target `wire_recording`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::run("wire_recording", bytes));
