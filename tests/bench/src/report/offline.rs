//! The benchmark `offline`: speed of `host-sim encode` and `host-sim decode` on one core, as
//! multiples of real time, and the speed of scipy and PyTorch doing the same.

use std::fs;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, ensure};
use new_file::Existing;
use offline::{Decoding, EncodedStream, Encoding, Model, Progress, SignalFormat};
use pipeline::Mains;
use recordings::{FileToWrite, GdfWriter, Missing, Recording, SignalToWrite};
use serde::Deserialize;
use serde_json::json;
use tempfile::TempDir;

use super::checked_in;
use super::figures::{Report, median};
use super::inputs;
use super::programs::{self, Python};

/// What one run of `offline_torch.py` prints: the times of scipy and PyTorch.
#[derive(Debug, Deserialize)]
struct Answer {
    /// Version of PyTorch that ran.
    torch: String,
    /// Version of scipy that ran.
    scipy: String,
    /// Time that encoding took, seconds.
    encode_s: f64,
    /// Time that decoding took, seconds.
    decode_s: f64,
}

/// Number of rounds, each of which times all contenders (host-sim, Python) once, after a warm-up
/// round.
const ROUNDS: usize = 5;

/// Times of our programs and of Python's in one round, seconds.
#[derive(Debug)]
struct Round {
    encode_s: f64,
    decode_s: f64,
    /// Times of scipy and PyTorch; `None` where they are not installed.
    torch: Option<Answer>,
}

/// Times our programs and the Python script alternately on `seconds` of synthetic EEG, and computes
/// the errors of both decoded signals.
///
/// # Errors
/// A contender does not run.
pub(crate) fn measure(seconds: u32) -> anyhow::Result<Report> {
    let artifact = checked_in::artifact()?;
    let request = programs::model(&artifact.description).to_string().into_bytes();
    let ours = Ours::new(seconds)?;
    let torch = Python::find_torch();
    eprintln!("encoding and decoding {seconds} s of signal, {ROUNDS} times each");
    let mut rounds = Vec::new();
    for _ in 0..=ROUNDS {
        rounds.push(Round {
            encode_s: ours.encode()?,
            decode_s: ours.decode()?,
            torch: torch
                .map(|torch| torch.answer("offline_torch.py", &[ours.folder.path()], &request))
                .transpose()?,
        });
    }
    let prd_percent = ours.prd_percent()?;
    let torch_prd_percent = torch.map(|_| ours.torch_prd_percent()).transpose()?;
    report(&rounds[1..], seconds, [Some(prd_percent), torch_prd_percent])
}

/// Builds the report; each speed is a median over the rounds.
fn report(
    rounds: &[Round],
    seconds: u32,
    [prd_percent, torch_prd_percent]: [Option<f64>; 2],
) -> anyhow::Result<Report> {
    let median = |figure: &dyn Fn(&Round) -> Option<f64>| median(rounds, figure);
    let times = |took_s: f64| f64::from(seconds) / took_s;
    let versions = rounds[0].torch.as_ref();
    let figures = json!({
        "encode_times_real_time": median(&|round| Some(times(round.encode_s))),
        "decode_times_real_time": median(&|round| Some(times(round.decode_s))),
        "torch_encode_times_real_time": median(&|round| Some(times(round.torch.as_ref()?.encode_s))),
        "torch_decode_times_real_time": median(&|round| Some(times(round.torch.as_ref()?.decode_s))),
        "encode_ratio_torch": median(&|round| Some(round.torch.as_ref()?.encode_s / round.encode_s)),
        "decode_ratio_torch": median(&|round| Some(round.torch.as_ref()?.decode_s / round.decode_s)),
        "prd_percent": prd_percent,
        "torch_prd_percent": torch_prd_percent,
        "electrodes": model::ELECTRODES,
        "rate_hz": model::ADC_RATE_HZ,
        "seconds": seconds,
        "threads": 1,
        "rounds": rounds.len(),
        "torch": versions.map(|answer| &answer.torch),
        "scipy": versions.map(|answer| &answer.scipy),
    });
    let next = "compare tests/bench/offline_torch.py with docs/decoding.md and signal/model/artifact/model.toml";
    Report::new("offline", figures, next)
}

/// The model, and a folder with the recording: as GDF for our programs, as numbers for Python.
struct Ours {
    folder: TempDir,
    model: Model,
}

impl Ours {
    /// Generates the recording: synthetic EEG at the model's electrodes and the ADC's rate.
    fn new(seconds: u32) -> anyhow::Result<Self> {
        let folder = tempfile::tempdir()?;
        let labels = model::LABELS.split(' ');
        let signals = labels.map(|label| SignalToWrite {
            label: label.to_owned(),
            is_microvolt: true,
            is_integer: false,
            range: [-187_500.0, 187_500.0],
        });
        let rate_hz = u32::from(model::ADC_RATE_HZ);
        let file = FileToWrite {
            signals: signals.collect(),
            rate_hz,
            rows_per_record: rate_hz,
            start_ns: None,
            description: "synthetic EEG".to_owned(),
        };
        let out = BufWriter::new(fs::File::create(folder.path().join("samples.gdf"))?);
        let mut writer = GdfWriter::new(out, &file)?;
        let mut numbers = Vec::new();
        let mut generator = inputs::synthetic()?;
        for _ in 0..seconds {
            let mut rows = Vec::new();
            for sample in generator.by_ref().take(usize::from(model::ADC_RATE_HZ)) {
                let counts = sample.counts;
                #[expect(clippy::cast_precision_loss, reason = "counts of 24 bits")]
                rows.extend(
                    counts[..model::ELECTRODES]
                        .iter()
                        .map(|count| *count as f32 * model::LSB_NV / 1_000.0),
                );
            }
            writer.write_record(&rows)?;
            numbers.extend(rows.iter().flat_map(|uv| uv.to_le_bytes()));
        }
        writer.finish(&[])?;
        fs::write(folder.path().join("samples.f32"), numbers)?;
        Ok(Self { folder, model: Model::embedded()? })
    }

    /// Encodes the recording; returns the time that it took, seconds.
    fn encode(&self) -> anyhow::Result<f64> {
        let encoding = Encoding {
            mains: Mains::Hz50,
            missing: Missing::Refuse,
            existing: Existing::Replace,
            stream: EncodedStream::Codes,
        };
        let start = Instant::now();
        encoding.encode(
            &self.path("samples.gdf"),
            &self.path("ours.codes"),
            &Progress::default(),
        )?;
        Ok(start.elapsed().as_secs_f64())
    }

    /// Decodes the codes to a GDF file; returns the time that it took, seconds.
    fn decode(&self) -> anyhow::Result<f64> {
        let start = Instant::now();
        self.decoding(None)?;
        Ok(start.elapsed().as_secs_f64())
    }

    /// Returns the PRD (percentage rms difference) of the signal that our programs decode.
    fn prd_percent(&self) -> anyhow::Result<f64> {
        let original = self.path("samples.gdf");
        let decoded = self.decoding(Some(&original))?;
        let comparison = decoded.comparison.context("no comparison")?;
        Ok(comparison.total().prd_percent())
    }

    /// Returns the rms difference of Python's decoded signal from ours, in percent of ours: the
    /// effect of int8. Leaves out the steps in which the filters settle, because int8 clips the
    /// electrodes' offsets.
    fn torch_prd_percent(&self) -> anyhow::Result<f64> {
        let theirs = fs::read(self.path("decoded.f32"))?;
        let theirs = theirs.as_chunks().0.iter().copied().map(f32::from_le_bytes);
        let theirs: Vec<f64> = theirs.map(f64::from).collect();
        let ours = rows(&self.path("ours.gdf"))?;
        ensure!(
            ours.len() == theirs.len(),
            "Python decodes {} values, host-sim {}",
            theirs.len(),
            ours.len()
        );
        let settling = usize::try_from(Mains::Hz50.filter().settling_samples)?;
        let decimation = usize::from(model::ADC_RATE_HZ / model::STEP_RATE_HZ);
        let first = (settling / decimation + model::STEPS) * model::ELECTRODES;
        let (ours, theirs) = (&ours[first..], &theirs[first..]);
        let pairs = ours.iter().zip(theirs);
        let error: f64 = pairs.map(|(x, y)| (x - y).powi(2)).sum();
        let power: f64 = ours.iter().map(|x| x.powi(2)).sum();
        Ok(100.0 * (error / power).sqrt())
    }

    fn decoding(&self, original: Option<&Path>) -> anyhow::Result<offline::Decoded> {
        let decoding = Decoding {
            model: &self.model,
            format: SignalFormat::Gdf,
            kind: None,
            existing: Existing::Replace,
        };
        let [codes, output] = ["ours.codes", "ours.gdf"].map(|name| self.path(name));
        Ok(decoding.decode(&codes, &output, original, &Progress::default())?)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }
}

/// Returns the values of a recording, row by row.
fn rows(path: &Path) -> anyhow::Result<Vec<f64>> {
    let mut recording = Recording::open(path)?;
    let mut block = recordings::Block::default();
    let mut values = Vec::new();
    while recording.read_block(&mut block)? {
        let rows = block.samples.first().map_or(0, Vec::len);
        for row in 0..rows {
            values.extend(block.samples.iter().map(|signal| signal[row]));
        }
    }
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speeds_are_multiples_of_real_time_and_ratios_those_of_a_round() {
        let round = Round {
            encode_s: 0.5,
            decode_s: 2.0,
            torch: Some(Answer {
                torch: "2".to_owned(),
                scipy: "1".to_owned(),
                encode_s: 1.0,
                decode_s: 8.0,
            }),
        };
        let report = report(&[round], 100, [Some(13.5), Some(5.0)]).expect("a report");
        for (name, value) in [
            ("encode_times_real_time", 200.0),
            ("decode_times_real_time", 50.0),
            ("encode_ratio_torch", 2.0),
            ("decode_ratio_torch", 4.0),
        ] {
            assert_eq!(report.object[name], value, "{name}");
        }
        assert_eq!(report.faults(), [""; 0]);
    }
}
