//! Fuzzes the target `uploaded_model`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::run("uploaded_model", bytes));
