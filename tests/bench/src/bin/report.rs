//! Program that runs a benchmark, prints its figures, and checks them against
//! `tests/bench/limits.toml`; see `bench::report`.
#![cfg_attr(target_os = "none", no_std)]
#![cfg_attr(target_os = "none", no_main)]
#![forbid(unsafe_code)]

#[cfg(not(target_os = "none"))]
fn main() -> std::process::ExitCode {
    bench::report::main()
}

/// Panic handler, which a build for a microcontroller needs. Such a build does nothing; it exists
/// because the lints check all programs of this crate for that target too.
#[cfg(target_os = "none")]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {}
}
