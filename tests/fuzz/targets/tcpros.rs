//! Fuzzes the target `tcpros`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::run("tcpros", bytes));
