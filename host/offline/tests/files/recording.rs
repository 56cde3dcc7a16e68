//! A recording, and the files of codes made of it.

use std::fs::File;
use std::path::{Path, PathBuf};

use new_file::Existing;
use offline::{
    Decoded, Decoding, Encoded, EncodedStream, Encoding, Model, OfflineError, Progress,
    SignalFormat,
};
use pipeline::Mains;
use recordings::{FileToWrite, GdfWriter, Missing, Recording, SignalToWrite};

/// Length of a recording that is not compared, seconds.
const SHORT_S: u32 = 7;
/// Length of a recording in which the filters settle, seconds: they take 10 s.
const LONG_S: u32 = 14;
/// Rows and types of the recording's events.
pub(crate) const EVENTS: [(u64, u16); 3] = [(100, 0x0301), (1_500, 0x0302), (3_000, 0x0301)];
const ROWS_PER_RECORD: u32 = 64;

/// A folder with a recording of the model's electrodes at the ADC's rate.
pub(crate) struct Fixture {
    folder: tempfile::TempDir,
}

impl Fixture {
    pub(crate) fn new() -> Self {
        Self::with_length(SHORT_S)
    }

    /// Creates a recording whose last seconds the filters have settled for.
    pub(crate) fn settled() -> Self {
        Self::with_length(LONG_S)
    }

    fn with_length(seconds: u32) -> Self {
        let fixture = Self {
            folder: tempfile::tempdir().expect("a folder"),
        };
        write(&fixture.recording(), seconds);
        fixture
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn recording(&self) -> PathBuf {
        self.path("recording.gdf")
    }

    pub(crate) fn codes(&self) -> PathBuf {
        self.path("recording.codes")
    }

    /// Encodes the recording to [`Self::codes`].
    pub(crate) fn encode(&self) -> Encoded {
        let encoded = ENCODING.encode(&self.recording(), &self.codes(), &Progress::default());
        encoded.expect("encoded")
    }

    /// Decodes a file of codes with the model of this build.
    pub(crate) fn decode(
        &self,
        codes: &Path,
        output: &str,
        format: SignalFormat,
        with_original: bool,
    ) -> Result<Decoded, OfflineError> {
        let model = Model::embedded().expect("a model with a decoder");
        let decoding = Decoding {
            model: &model,
            format,
            kind: None,
            existing: Existing::Refuse,
        };
        let original = with_original.then(|| self.recording());
        let progress = Progress::default();
        decoding.decode(codes, &self.path(output), original.as_deref(), &progress)
    }
}

pub(crate) const ENCODING: Encoding = Encoding {
    mains: Mains::Hz50,
    missing: Missing::Refuse,
    existing: Existing::Refuse,
    stream: EncodedStream::Codes,
};

/// Returns the electrodes of the model.
pub(crate) fn labels() -> Vec<&'static str> {
    model::LABELS.split(' ').collect()
}

/// Returns all values of the first signals of a file: one vector for each electrode.
pub(crate) fn values(path: &Path) -> Vec<Vec<f64>> {
    let mut recording = Recording::open(path).expect("a recording");
    let mut block = recordings::Block::default();
    let mut signals = vec![Vec::new(); labels().len()];
    while recording.read_block(&mut block).expect("a whole file") {
        for (signal, samples) in signals.iter_mut().zip(&block.samples) {
            signal.extend(samples);
        }
    }
    signals
}

fn write(path: &Path, seconds: u32) {
    let signals = labels().into_iter().map(|label| SignalToWrite {
        label: label.to_owned(),
        is_microvolt: true,
        is_integer: false,
        range: [-1_000.0, 1_000.0],
    });
    let file = FileToWrite {
        signals: signals.collect(),
        rate_hz: model::ADC_RATE_HZ.into(),
        rows_per_record: ROWS_PER_RECORD,
        start_ns: 0,
        description: "waves".to_owned(),
    };
    let mut writer = GdfWriter::new(File::create(path).expect("a file"), &file).expect("a header");
    let rows = seconds * u32::from(model::ADC_RATE_HZ);
    for first in (0..rows).step_by(64) {
        let rows = (first..first + ROWS_PER_RECORD).flat_map(row);
        writer
            .write_record(&rows.collect::<Vec<f32>>())
            .expect("a record");
    }
    writer.finish(&EVENTS).expect("a whole file");
}

/// Returns one row: waves of 10 and 23 Hz that travel over the electrodes.
#[expect(clippy::cast_precision_loss, reason = "small whole numbers")]
fn row(row: u32) -> Vec<f32> {
    let seconds = row as f32 / f32::from(model::ADC_RATE_HZ);
    let electrodes = 0..labels().len();
    let value = |electrode: usize| {
        let place = electrode as f32 / 61.0;
        let slow = (63.0 * seconds + 2.0 * place).sin();
        let fast = (145.0 * seconds - 5.0 * place).sin();
        30.0 * slow + 8.0 * fast
    };
    electrodes.map(value).collect()
}
