//! `cargo xtask`: the project's commands that need more than a cargo alias, such as a condition, an
//! environment variable or two commands.
#![forbid(unsafe_code)]

mod board;
mod command;
mod deb;
mod dfu;
mod docs;
mod figures;
mod flash;
mod images;
mod install;
mod programs;
mod qemu;
mod stages;
mod wheels;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::images::Rig;
use crate::programs::Nucleo;

/// Corticode's own cargo verbs
#[derive(Debug, Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask")]
struct Arguments {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Run everything that CI runs; install what is missing, or print the command that does
    Test {
        /// Leave out the emulators, the benchmarks, models of other shapes and tests that start
        /// programs or ROS, and install nothing
        #[arg(long)]
        fast: bool,
        /// Run only the benchmarks on emulated microcontrollers, and build images and virtual
        /// boards
        #[arg(long, conflicts_with = "fast")]
        boards: bool,
    },
    /// Show the whole path: synthetic EEG, virtual board, bridge, ROS master, subscriber, pictures
    Demo {
        /// Seconds of EEG; the first 9.5, in which the filters settle, are not compared
        #[arg(long, default_value_t = 15, value_parser = clap::value_parser!(u32).range(12..=3600))]
        seconds: u32,
        /// Seed of the synthetic EEG
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// Show synthetic EEG on a live page instead, and open it in a browser; until Ctrl-C
        #[arg(long, conflicts_with = "seconds")]
        live: bool,
    },
    /// Show a closed loop: a recording with cues, virtual board, bridge, classifier, a picture
    Loop {
        /// Recording to play, whose events are the cues; by default the command makes recordings of
        /// synthetic EEG, fits a classifier to two of them, and plays a third
        #[arg(requires = "classifier")]
        recording: Option<PathBuf>,
        /// Classifier of the recording's cues, a file of `trainer classify`
        classifier: Option<PathBuf>,
        /// Mains frequency, Hz
        #[arg(long, default_value = "50", value_parser = ["50", "60"])]
        mains: String,
        /// Seed of the synthetic EEG
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// Play as fast as this machine can, without measuring latencies, instead of in real time
        #[arg(long)]
        fast: bool,
    },
    /// Count instructions on an emulated microcontroller (for the checked-in model or another one),
    /// measure the filters' noise, or time host-sim's work on files, the bridge or the node on this
    /// PC; `cargo xtask bench --help` lists the options
    #[command(disable_help_flag = true)]
    Bench {
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        words: Vec<String>,
    },
    /// Run the application on emulated microcontrollers and compare its codes with host-sim's, or
    /// run it live for a bridge
    Qemu {
        /// Number of codes that each machine makes, to be compared with host-sim's
        #[arg(long, default_value_t = 500, value_parser = clap::value_parser!(u32).range(500..=100_000))]
        codes: u32,
        /// Print one JSON object instead of a table
        #[arg(long)]
        json: bool,
        /// Run in real time with the link at a TCP port, for a bridge, until Ctrl-C
        #[arg(long, conflicts_with_all = ["codes", "json"])]
        live: bool,
        /// TCP port of --live on 127.0.0.1
        #[arg(long, default_value_t = 5555, requires = "live")]
        port: u16,
    },
    /// Make microcontrollers check the golden vectors themselves: emulated ones, or a board
    Hil {
        /// Run on this board, attached by its ST-LINK, instead of on emulated microcontrollers
        #[arg(long, value_enum)]
        board: Option<Nucleo>,
    },
    /// Test, on emulated boards, the images that are flashed to real ones, or leave one board
    /// running for a bridge
    Board {
        /// Board to test or to run, with its converters; all if it is left out
        #[arg(value_enum)]
        board: Option<Rig>,
        /// Leave the board running at a TCP port for a bridge, until Ctrl-C, instead of running the
        /// tests
        #[arg(long, requires = "board")]
        live: bool,
        /// TCP port of --live on 127.0.0.1
        #[arg(long, default_value_t = 5556, requires = "live")]
        port: u16,
        /// For --live, run the image for the other port of h743 (UART) or f446 (USB)
        #[arg(long, requires = "live")]
        other_port: bool,
        /// Print one JSON object instead of a table
        #[arg(long, conflicts_with = "live")]
        json: bool,
    },
    /// Build the boards' images; print how much flash and RAM they use, and fail above the limits
    Budget {
        /// Print one JSON object instead of a table
        #[arg(long)]
        json: bool,
    },
    /// Build the Debian package of the bridge in target/debian/, for this distribution and later
    /// ones
    Deb {
        /// Also install it in a clean Debian 12, start and purge it, and start its service in a
        /// container; needs root, mmdebstrap and systemd-container
        #[arg(long)]
        check: bool,
        /// Pack this bridge, and corticode-node from its folder, instead of building them
        #[arg(long)]
        program: Option<PathBuf>,
    },
    /// Check licences, advisories and sources with cargo-deny, if it is installed
    Deny,
    /// Measure every figure of docs/figures.md and write the page
    Docs {
        /// Read the results from the JSON files in this folder instead of measuring; `test` writes
        /// such files to target/figures
        #[arg(long)]
        measured: Option<PathBuf>,
    },
    /// Build the image of a board, print its model and converters, and write it as a file for
    /// `corticode-bridge update`; the same as `cargo fw`
    Fw(flash::Options),
    /// Build the image of a board and flash it with probe-rs; the same as `cargo flash`
    Flash(flash::Options),
    /// Install what `test` needs: Debian packages, Rust's targets and toolchains
    Install,
}

fn main() -> ExitCode {
    let result = match Arguments::parse().verb {
        Verb::Test { fast, boards } => stages::test(fast, boards),
        Verb::Demo { seed, live: true, .. } => programs::live_demo(seed),
        Verb::Demo { seconds, seed, .. } => programs::demo(seconds, seed),
        Verb::Loop { recording, classifier, mains, seed, fast } => {
            let own = recording.into_iter().chain(classifier).collect::<Vec<_>>();
            programs::closed_loop([&mains, &seed.to_string()], fast, &own)
        }
        Verb::Bench { words } => programs::bench(&words),
        Verb::Qemu { live: true, port, .. } => programs::live_qemu(port),
        Verb::Qemu { codes, json, .. } => qemu::qemu(codes, json),
        Verb::Hil { board } => programs::hil(board),
        Verb::Board { live: true, board: Some(board), port, other_port, .. } => {
            board::live(board, port, other_port)
        }
        Verb::Board { board, json, .. } => board::board(board, json),
        Verb::Budget { json } => programs::budget(json),
        Verb::Deb { check, program } => deb::deb(program, check),
        Verb::Deny => programs::deny(),
        Verb::Docs { measured } => docs::docs(measured.as_deref()),
        Verb::Fw(options) => flash::image(&options, false),
        Verb::Flash(options) => flash::image(&options, true),
        Verb::Install => install::install(),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("\nerror: {}", failure.message);
            failure.status.into()
        }
    }
}
