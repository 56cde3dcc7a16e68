//! Verbs that need a condition, an environment variable or two commands: `cargo xtask --help`.
#![forbid(unsafe_code)]

mod benchmark;
mod board;
mod budget;
mod command;
mod debian;
mod demo;
mod failure;
mod hil;
mod picture;
mod qemu;
mod spread;
mod verify;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// What `cargo xtask` understands.
#[derive(Debug, Parser)]
#[command(
    name = "cargo xtask",
    bin_name = "cargo xtask",
    about = "Corticode's own cargo verbs"
)]
struct Arguments {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Run everything that CI runs; install what is missing, or say how.
    Test {
        /// Leave out the trainer and the benchmark, and install nothing: tests that need ROS are skipped without it.
        #[arg(long)]
        fast: bool,
    },
    /// Show the whole path: synthetic EEG, virtual board, bridge, ROS master, subscriber, pictures.
    Demo(demo::DemoOptions),
    /// Count instructions on an emulated microcontroller, measure and draw the filters' noise, or time the
    /// encoder on this PC.
    #[command(subcommand)]
    Bench(benchmark::BenchOptions),
    /// Run the application on emulated microcontrollers and compare its codes with host-sim's, or run
    /// it live for a bridge.
    Qemu(qemu::QemuOptions),
    /// Let a microcontroller check the golden vectors itself: emulated ones, or a board behind probe-rs.
    Hil(hil::HilOptions),
    /// Run the images that are flashed on emulated boards and test what they do, or leave one running for a
    /// bridge.
    Board(board::BoardOptions),
    /// Build the boards' images; print what they take of flash and RAM, and fail above the limits.
    Budget(budget::BudgetOptions),
    /// Check licences, advisories and sources with cargo-deny, where it is installed.
    Deny,
}

fn main() -> ExitCode {
    let result = match Arguments::parse().verb {
        Verb::Test { fast } => verify::verify(fast),
        Verb::Demo(options) => demo::demo(options),
        Verb::Bench(options) => benchmark::bench(options),
        Verb::Qemu(options) => qemu::qemu(options),
        Verb::Hil(options) => hil::hil(options),
        Verb::Board(options) => board::board(&options),
        Verb::Budget(options) => budget::budget(options),
        Verb::Deny => verify::deny(),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("\nerror: {failure}");
            failure.exit_code()
        }
    }
}
