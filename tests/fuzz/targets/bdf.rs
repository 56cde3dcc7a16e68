//! Fuzzes the target `bdf`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::run("bdf", bytes));
