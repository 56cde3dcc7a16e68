//! `cargo demo`: the whole path on this machine, for some seconds, with pictures of what passed.

mod chain;
mod drawing;
mod live;
mod reference;
mod run;

use std::path::PathBuf;

use clap::Args;

use self::reference::Reference;
use crate::command::{cargo_with, run};
use crate::failure::Failure;
use crate::spread::Spread;

/// What the demo can be told.
#[derive(Debug, Clone, Copy, Args)]
pub(crate) struct DemoOptions {
    /// Seconds of EEG; the filters take the first 9.5 to settle, and nothing is compared before.
    #[arg(long, default_value_t = 15, value_parser = clap::value_parser!(u32).range(12..=3600))]
    seconds: u32,
    /// Seed of the synthetic EEG.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// Builds the programs, runs the path, draws the pictures, says one line.
///
/// # Errors
/// A part does not build, start or answer; a code was lost; Ctrl-C.
pub(crate) fn demo(options: DemoOptions) -> Result<(), Failure> {
    let build = [
        "build",
        "--release",
        "--package=host-sim",
        "--package=bridge",
        "--bins",
    ];
    run(
        &mut cargo_with(&build),
        "read the compiler's message above; `cargo build` shows it alone",
    )?;
    let programs = programs_folder()?;
    let pictures = programs.with_file_name("demo");

    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build();
    let runtime = runtime.map_err(|error| Failure::Check {
        what: "starting threads".to_owned(),
        why: error.to_string(),
        next: "look for a limit on processes: `ulimit -u`".to_owned(),
    })?;
    let heard = runtime.block_on(chain::run(options, &programs))?;
    let reference = Reference::new(options.seed, options.seconds);
    let reference = reference.map_err(|error| Failure::Check {
        what: "synthesising the reference".to_owned(),
        why: error.to_string(),
        next: "compare model/artifact/model.toml with the electrodes that host-sim knows"
            .to_owned(),
    })?;
    let comparison = reference.compare(&heard);
    drawing::draw_all(&heard, &comparison, &pictures)?;

    let arrival = Spread::of(&heard.arrival_intervals_ms());
    let device = Spread::of(&heard.device_intervals_ms());
    let [made, received, lost] = [heard.made(), heard.received(), heard.lost()];
    println!("pictures: {}", pictures.display());
    println!(
        "codes made {made}, received {received}, lost {lost}; interval {arrival} ms at the \
         subscriber, {device} ms by the device's stamps; reconstruction PRD {:.1} % (synthetic EEG)",
        comparison.prd_percent
    );
    if lost == 0 && received > 0 {
        return Ok(());
    }
    Err(Failure::Check {
        what: "the demo".to_owned(),
        why: format!("{lost} of {made} codes did not arrive"),
        next: "is the machine busy? `cargo demo` again; then `cargo xtask test`".to_owned(),
    })
}

/// The folder of the release build: the one that this program lies in, since cargo put it there.
fn programs_folder() -> Result<PathBuf, Failure> {
    let missing = |why: String| Failure::Missing {
        what: "the folder of the built programs".to_owned(),
        why,
        next: "`cargo demo`, not the program itself".to_owned(),
    };
    let own = std::env::current_exe().map_err(|error| missing(error.to_string()))?;
    let target = own.parent().and_then(|folder| folder.parent());
    let release = target.map(|target| target.join("release"));
    release
        .filter(|folder| folder.exists())
        .ok_or_else(|| missing(own.display().to_string()))
}
