//! Fuzzes the target `commands`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::run("commands", bytes));
