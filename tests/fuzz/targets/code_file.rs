//! Fuzzes the target `code_file`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::run("code_file", bytes));
