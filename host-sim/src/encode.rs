//! The command `host-sim encode`.

use std::error::Error;

use new_file::Existing;
use offline::{CodeKind, Encoded, EncodedStream, Encoding, PackedCounts};
use recordings::Recording;

use crate::batch::{self, Job};
use crate::command_line::EncodeOptions;

/// Extensions of the files that are encoded if the input is a folder.
pub(crate) const RECORDINGS: [&str; 3] = ["edf", "bdf", "gdf"];
/// Extension of the files that are decoded if the input is a folder.
pub(crate) const CODES: &str = "codes";

pub(crate) fn encode(options: &EncodeOptions) -> Result<(), Box<dyn Error>> {
    if options.packed_rate.is_some() && options.stream == CodeKind::Codes {
        return Err("--packed-rate is the rate of packed blocks; add --stream packed".into());
    }
    let encoding = Encoding {
        mains: options.mains,
        missing: options.missing,
        existing: Existing::from_force(options.batch.force),
        stream: match options.stream {
            CodeKind::Codes => EncodedStream::Codes,
            CodeKind::Packed => EncodedStream::Packed(options.packed_rate),
        },
    };
    let jobs = batch::jobs(&options.input, &options.output, &RECORDINGS, |name| {
        name.with_added_extension(CODES)
    })?;
    let is_single = jobs.len() == 1;
    let finished =
        batch::run(&jobs, &options.batch, Some(seconds(&jobs)), |job, progress, bar| {
            let encoded = encoding.encode(&job.input, &job.output, progress)?;
            let file = job.input.display();
            for warning in &encoded.warnings {
                bar.suspend(|| new_file::message!("warning: {file}: {warning}"));
            }
            Ok(encoded)
        })?;
    if !options.batch.quiet {
        for (job, encoded) in &finished.results {
            if is_single {
                new_file::message!("{}", encoded.montage);
            }
            new_file::message!("{}", summary(job, encoded));
        }
        let seconds = finished.results.iter().map(|(_, encoded)| encoded.signal_s());
        new_file::message!("{}", finished.speed(seconds.sum()));
    }
    finished.failure.map_or(Ok(()), |failure| Err(failure.into()))
}

/// Returns the total length of the recordings, seconds; those that cannot be read count as 0.
fn seconds(jobs: &[Job]) -> u64 {
    let recordings = jobs.iter().filter_map(|job| Recording::open(&job.input).ok());
    let seconds: f64 = recordings.map(|recording| recording.duration_s()).sum();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "durations are not negative; beyond 2^64 s it saturates"
    )]
    let seconds = seconds as u64;
    seconds
}

fn summary(job: &Job, encoded: &Encoded) -> String {
    let stats = &encoded.stats;
    let items = match &encoded.packed {
        Some(packed) => packed_blocks(packed),
        None => format!(
            "{} codes ({}); clipped: {} input values, {} values of codes",
            stats.codes_made,
            device::CODE_FORMAT,
            stats.clipped,
            stats.clipped_values
        ),
    };
    format!(
        "{}: {:.1} s, {} bytes, {items}",
        job.output.display(),
        encoded.signal_s(),
        encoded.bytes
    )
}

fn packed_blocks(counts: &PackedCounts) -> String {
    #[expect(clippy::cast_precision_loss, reason = "far fewer than 2^52 bits")]
    let bits = counts.bits as f64 / counts.blocks.max(1) as f64;
    format!(
        "{} packed blocks of {bits:.1} bits; clipped: {} input values; blocks outside the model: {}",
        counts.blocks, counts.clipped, counts.misfits
    )
}
