//! The command `host-sim scenario`, which rehearses sessions with faults.

use std::error::Error;
use std::io::Write as _;

use host_sim::scenario::{Report, Scenario, junit, rehearse};
use new_file::{Existing, NewFile};
use thiserror::Error;

use crate::batch::progress_bar;
use crate::command_line::ScenarioOptions;

/// Error: some scenarios failed.
#[derive(Debug, Error)]
#[error("{failed} of {scenarios} scenarios failed")]
pub(crate) struct Failed {
    failed: usize,
    scenarios: usize,
}

pub(crate) fn rehearse_all(options: &ScenarioOptions) -> Result<(), Box<dyn Error>> {
    // Read all files first, so that a mistake in the last one is reported before any scenario runs.
    let scenarios: Result<Vec<Scenario>, _> =
        options.files.iter().map(|file| Scenario::read(file)).collect();
    let existing = Existing::from_force(options.force);
    let junit_file = options.junit.as_ref();
    let junit_file = junit_file.map(|path| NewFile::create(path, existing, &options.files));
    let junit_file = junit_file.transpose()?;
    let mut reports: Vec<Report> = Vec::new();
    for scenario in scenarios? {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "positive; saturates"
        )]
        let seconds = scenario.duration_s() as u64;
        let progress = progress_bar(Some(seconds), "s  {msg}", options.quiet);
        progress.set_message(scenario.name().to_owned());
        let report = rehearse(&scenario, || progress.inc(1))?;
        progress.finish_and_clear();
        let line = if options.json { serde_json::to_string(&report)? } else { report.to_string() };
        new_file::print(format_args!("{line}\n"))?;
        reports.push(report);
    }
    if let Some(mut file) = junit_file {
        file.write_all(&junit(&reports)?)?;
        file.finish()?;
    }
    let failed = reports.iter().filter(|report| !report.passed()).count();
    if failed > 0 {
        let scenarios = reports.len();
        return Err(Failed { failed, scenarios }.into());
    }
    Ok(())
}
