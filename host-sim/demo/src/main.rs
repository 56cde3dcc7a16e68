//! The program of `cargo demo` and `cargo loop`. These commands first build all programs that this
//! program starts.
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr)]

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use demo::Failure;
use demo::closed_loop::{self, Options};
use pipeline::Mains;

fn main() -> ExitCode {
    let words: Vec<OsString> = std::env::args_os().skip(1).collect();
    let program = std::env::current_exe().unwrap_or_default();
    let programs = program.parent().unwrap_or(Path::new("."));
    // Arguments that are not UTF-8 become empty texts here. Only a path may be such an argument.
    let texts: Vec<&str> = words.iter().map(|word| word.to_str().unwrap_or_default()).collect();
    let ended = match &texts[..] {
        ["loop", mains @ ("50" | "60"), seed, pace @ ("realtime" | "fast"), own @ ..]
            if [0, 2].contains(&own.len()) =>
        {
            let own = <&[OsString; 2]>::try_from(&words[4..]).ok();
            let options = seed.parse().map(|seed| Options {
                own: own.map(|own| own.each_ref().map(PathBuf::from)),
                mains: if *mains == "60" { Mains::Hz60 } else { Mains::Hz50 },
                seed,
                fast: *pace == "fast",
            });
            options.ok().map(|options| run_loop(&options, programs))
        }
        [seconds, seed] => {
            let numbers = seconds.parse().ok().zip(seed.parse().ok());
            numbers.map(|(seconds, seed)| demo::demo(seconds, seed, programs))
        }
        _ => None,
    };
    match ended {
        Some(Ok(())) => ExitCode::SUCCESS,
        Some(Err(failure)) => {
            new_file::message!("\nerror: {}", failure.message);
            failure.status.into()
        }
        None => {
            new_file::message!(
                "usage: demo SECONDS SEED, or demo loop 50|60 SEED realtime|fast [RECORDING \
                 CLASSIFIER]; `cargo demo` and `cargo loop` build all programs and start this one"
            );
            ExitCode::from(2)
        }
    }
}

/// Runs the closed loop, and prints its results.
fn run_loop(options: &Options, programs: &Path) -> Result<(), Failure> {
    let folder = programs.with_file_name("loop");
    let outcome = closed_loop::run(options, programs, Some(&folder))?;
    let next = "make room on the disk and run it again";
    new_file::print(format_args!("{outcome}picture: {}/loop.svg\n", folder.display()))
        .map_err(|error| Failure::check("printing", error, next))?;
    outcome.check()
}
