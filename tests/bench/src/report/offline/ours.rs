//! `host-sim encode` and `host-sim decode`, timed in this process on a file of synthetic EEG.

use std::fs;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, ensure};
use new_file::Existing;
use offline::{Decoding, EncodedStream, Encoding, Model, Progress, SignalFormat};
use pipeline::Mains;
use recordings::{FileToWrite, GdfWriter, Missing, Recording, SignalToWrite};
use tempfile::TempDir;

use crate::report::inputs;

/// A folder with the recording in two forms: GDF for our programs, numbers alone for Python.
pub(crate) struct Ours {
    folder: TempDir,
    model: Model,
}

impl Ours {
    /// Generates the recording: the model's electrodes at the ADC's rate.
    pub(crate) fn new(seconds: u32) -> anyhow::Result<Self> {
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
            start_ns: 0,
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
        Ok(Self {
            folder,
            model: Model::embedded()?,
        })
    }

    /// Returns the folder with the recording.
    pub(crate) fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Encodes the recording; returns the seconds that it took.
    pub(crate) fn encode(&self) -> anyhow::Result<f64> {
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

    /// Decodes the codes to a GDF file; returns the seconds that it took.
    pub(crate) fn decode(&self) -> anyhow::Result<f64> {
        let start = Instant::now();
        self.decoding(None)?;
        Ok(start.elapsed().as_secs_f64())
    }

    /// Returns the PRD of the decoded signal, percent.
    pub(crate) fn prd_percent(&self) -> anyhow::Result<f64> {
        let original = self.path("samples.gdf");
        let decoded = self.decoding(Some(&original))?;
        let comparison = decoded.comparison.context("no comparison")?;
        Ok(comparison.total().prd_percent())
    }

    /// Returns the PRD between Python's decoded signal and ours, percent of ours: the effect of int8. Steps in
    /// which the filters settle are left out, because int8 clips the electrodes' offsets.
    pub(crate) fn torch_prd_percent(&self) -> anyhow::Result<f64> {
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

/// Returns the values of a file, row by row.
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
