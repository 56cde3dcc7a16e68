//! The command `host-sim decode`.

use std::{
    error::Error,
    path::{Path, PathBuf},
};

use new_file::Existing;
use offline::{Decoded, Decoding, Model, OfflineError, Progress, report, settling_s};

use crate::batch::{self, Job};
use crate::command_line::DecodeOptions;
use crate::encode::{CODES, RECORDINGS};

pub(crate) fn decode(options: &DecodeOptions) -> Result<(), Box<dyn Error>> {
    let model = match &options.model {
        Some(folder) => Model::read(folder)?,
        None => Model::embedded()?,
    };
    let format = options.to;
    let decoding = Decoding {
        model: &model,
        format,
        kind: options.stream,
        existing: Existing::from_force(options.batch.force),
    };
    let extension = format!("decoded.{}", format.extension());
    let output = options.output.clone().unwrap_or_else(|| {
        if options.input.is_dir() {
            options.input.clone()
        } else {
            options.input.with_extension(&extension)
        }
    });
    if let (true, Some(original)) = (options.input.is_dir(), &options.original)
        && !original.is_dir()
    {
        let why = "is one recording, and the codes are a folder; name the folder of their recordings \
                   with --original";
        return Err(format!("{} {why}", original.display()).into());
    }
    if let Some(folder) = &options.report {
        report::check(folder, decoding.existing)?;
    }
    let jobs =
        batch::jobs(&options.input, &output, &[CODES], |name| name.with_extension(&extension))?;
    let original = options.original.as_deref();
    let finished = batch::run(&jobs, &options.batch, None, |job, progress, bar| {
        let (decoded, warnings) = decode_one(&decoding, original, job, progress)?;
        for warning in warnings {
            bar.suspend(|| new_file::message!("warning: {}: {warning}", job.input.display()));
        }
        Ok(decoded)
    })?;
    if !options.batch.quiet {
        for (job, decoded) in &finished.results {
            new_file::message!("{}", summary(job, decoded));
        }
        let seconds = finished.results.iter().map(|(_, decoded)| decoded.signal_s());
        new_file::message!("{}", finished.speed(seconds.sum()));
    }
    if let Some(folder) = options.report.as_ref().filter(|_| !finished.results.is_empty()) {
        let entries = finished.results.into_iter().map(|(job, decoded)| report::Entry {
            name: job.name.with_extension("").display().to_string(),
            decoded,
        });
        let entries: Vec<_> = entries.collect();
        report::write(folder, &model.description, &entries)?;
        if !options.batch.quiet {
            new_file::message!("report: {}", folder.join("index.html").display());
        }
    }
    finished.failure.map_or(Ok(()), |failure| Err(failure.into()))
}

/// Decodes the codes of one job. Returns the result, and the warnings about the input.
fn decode_one(
    decoding: &Decoding,
    original: Option<&Path>,
    job: &Job,
    progress: &Progress,
) -> Result<(Decoded, Vec<String>), OfflineError> {
    let recording = recording_of(job, original);
    let mut warnings = Vec::new();
    if original.is_some() && recording.is_none() {
        warnings
            .push("no recording of this name; decoded without events and comparison".to_owned());
    }
    let decoded = decoding.decode(&job.input, &job.output, recording.as_deref(), progress)?;
    warnings.extend(decoded.warnings.iter().cloned());
    if decoded.missing > 0 || decoded.damaged > 0 {
        let rows = if decoded.is_packed() {
            "their rows are predictions"
        } else {
            "rows without any code repeat the last row"
        };
        warnings.push(format!(
            "{} {} are missing, {} stretches are damaged; {rows}",
            decoded.missing,
            codes_of(&decoded),
            decoded.damaged
        ));
    }
    if decoded.limited > 0 {
        warnings.push(format!(
            "{} values are beyond the range of the format and were limited; --to gdf keeps them",
            decoded.limited
        ));
    }
    if let Some(comparison) = &decoded.comparison
        && comparison.steps == 0
    {
        warnings.push(format!("too short to compare: the filters settle for {} s", settling_s()));
    }
    if !decoded.event_types.is_empty() {
        let types = decoded.event_types.iter();
        let types: Vec<String> = types.map(|(text, kind)| format!("{kind} {text}")).collect();
        warnings
            .push(format!("GDF has no texts; the types of the events are {}", types.join(", ")));
    }
    Ok((decoded, warnings))
}

/// Returns the recording from which the codes of a job were made; `None` if `original` is `None`,
/// or a folder that has no recording with the name of the codes.
fn recording_of(job: &Job, original: Option<&Path>) -> Option<PathBuf> {
    let original = original?;
    if !original.is_dir() {
        return Some(original.to_owned());
    }
    // `encode` writes the codes of FILE.edf to FILE.edf.codes. FILE.codes can hold the codes of a
    // recording FILE with any known extension.
    let place = original.join(&job.name).with_extension("");
    let others = RECORDINGS.map(|extension| place.with_added_extension(extension));
    let mut files = std::iter::once(place).chain(others);
    files.find(|file| file.is_file())
}

/// Returns the name of what a file holds: codes of the network or packed blocks.
fn codes_of(decoded: &Decoded) -> &'static str {
    if decoded.is_packed() { "packed blocks" } else { "codes" }
}

fn summary(job: &Job, decoded: &Decoded) -> String {
    let mut text = format!(
        "{}: {} {}, {:.1} s at {} Hz",
        job.output.display(),
        decoded.codes,
        codes_of(decoded),
        decoded.signal_s(),
        decoded.rate_hz
    );
    if let Some(comparison) = decoded.comparison.as_ref().filter(|of| of.steps > 0) {
        let total = comparison.total();
        text = format!(
            "{text}; PRD {:.2} % over all electrodes, {:.2} % over the measured ones; MSE {:.2} uV^2",
            total.prd_percent(),
            comparison.total_measured().prd_percent(),
            total.mse_uv2()
        );
    }
    text
}
