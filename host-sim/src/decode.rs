//! The command `host-sim decode`.

use std::{error::Error, path::PathBuf};

use new_file::Existing;
use offline::{
    CodeKind, Decoded, Decoding, Model, OfflineError, Progress, SignalFormat, report, settling_s,
};
use thiserror::Error;

use crate::batch::{self, Job};
use crate::command_line::DecodeOptions;
use crate::encode::{CODES, RECORDINGS};

pub(crate) fn decode(options: &DecodeOptions) -> Result<(), Box<dyn Error>> {
    let model = match &options.model {
        Some(folder) => Model::read(folder)?,
        None => Model::embedded()?,
    };
    let format = SignalFormat::from(options.to);
    let decoding = Decoding {
        model: &model,
        format,
        kind: options.stream.map(CodeKind::from),
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
        return Err(DecodeError::OriginalIsFile(original.clone()).into());
    }
    if let Some(folder) = &options.report {
        report::check(folder, decoding.existing)?;
    }
    let jobs = batch::jobs(&options.input, &output, &[CODES], |name| {
        name.with_extension(&extension)
    })?;
    let originals = Originals::new(options);
    let finished = batch::run(&jobs, &options.batch, None, |job, progress, bar| {
        let (decoded, warnings) = decode_one(&decoding, &originals, job, progress)?;
        for warning in warnings {
            bar.suspend(|| eprintln!("warning: {}: {warning}", job.input.display()));
        }
        Ok(decoded)
    })?;
    if !options.batch.quiet {
        for (job, decoded) in &finished.results {
            eprintln!("{}", summary(job, decoded));
        }
        let seconds = finished
            .results
            .iter()
            .map(|(_, decoded)| decoded.signal_s());
        eprintln!("{}", finished.speed(seconds.sum()));
    }
    if let Some(folder) = options
        .report
        .as_ref()
        .filter(|_| !finished.results.is_empty())
    {
        let entries = finished
            .results
            .into_iter()
            .map(|(job, decoded)| report::Entry {
                name: job.name.with_extension("").display().to_string(),
                decoded,
            });
        let entries: Vec<_> = entries.collect();
        report::write(folder, &model.description, &entries)?;
        if !options.batch.quiet {
            eprintln!("report: {}", folder.join("index.html").display());
        }
    }
    finished
        .failure
        .map_or(Ok(()), |failure| Err(failure.into()))
}

/// Decodes one file. Returns the result, and what is wrong with the input.
fn decode_one(
    decoding: &Decoding,
    originals: &Originals,
    job: &Job,
    progress: &Progress,
) -> Result<(Decoded, Vec<String>), OfflineError> {
    let original = originals.of(job);
    let mut warnings = Vec::new();
    if originals.are_named() && original.is_none() {
        warnings
            .push("no recording of this name; decoded without events and comparison".to_owned());
    }
    let decoded = decoding.decode(&job.input, &job.output, original.as_deref(), progress)?;
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
        warnings.push(format!(
            "too short to compare: the filters settle for {} s",
            settling_s()
        ));
    }
    if decoding.format == SignalFormat::Gdf && !decoded.event_types.is_empty() {
        let types = decoded.event_types.iter();
        let types: Vec<String> = types.map(|(text, kind)| format!("{kind} {text}")).collect();
        warnings.push(format!(
            "GDF has no texts; the types of the events are {}",
            types.join(", ")
        ));
    }
    Ok((decoded, warnings))
}

/// Why the options of `decode` cannot be used.
#[derive(Debug, Error)]
enum DecodeError {
    /// One recording for a folder of codes.
    #[error(
        "{} is one recording, and the codes are a folder; name the folder of their recordings with --original",
        .0.display()
    )]
    OriginalIsFile(PathBuf),
}

/// Recordings from which the codes were made.
enum Originals {
    None,
    File(PathBuf),
    /// A folder that has them under the names of the codes.
    Folder(PathBuf),
}

impl Originals {
    fn new(options: &DecodeOptions) -> Self {
        match &options.original {
            None => Self::None,
            Some(path) if path.is_dir() => Self::Folder(path.clone()),
            Some(path) => Self::File(path.clone()),
        }
    }

    fn are_named(&self) -> bool {
        !matches!(self, Self::None)
    }

    fn of(&self, job: &Job) -> Option<PathBuf> {
        match self {
            Self::None => None,
            Self::File(path) => Some(path.clone()),
            // `encode` names the codes of FILE.edf FILE.edf.codes.
            Self::Folder(folder) => {
                let place = folder.join(&job.name).with_extension("");
                if place.is_file() {
                    return Some(place);
                }
                let mut files = RECORDINGS.map(|extension| place.with_added_extension(extension));
                files
                    .iter_mut()
                    .find(|file| file.is_file())
                    .map(std::mem::take)
            }
        }
    }
}

/// Names what a file of codes holds.
fn codes_of(decoded: &Decoded) -> &'static str {
    if decoded.is_packed() {
        "packed blocks"
    } else {
        "codes"
    }
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
            comparison.mse_uv2(total, comparison.electrodes.len())
        );
    }
    text
}
