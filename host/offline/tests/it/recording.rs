//! A recording, and the files of codes made of it.

use std::fs::{self, File};
use std::path::{Path, PathBuf};

use link::{Decoder, Encoder, MAX_FRAME, ToHost};
use new_file::Existing;
use offline::{
    Decoded, Decoding, Encoded, EncodedStream, Encoding, Model, OfflineError, Progress,
    SignalFormat,
};
use pipeline::{Mains, Sample};
use recordings::{AdcSpec, FileToWrite, GdfWriter, Missing, MontageMap, Recording, VirtualAdc};

/// Length of a recording for tests without a comparison, seconds.
const SHORT_S: u32 = 7;
/// Length, seconds, of a recording that is long enough for the filters to settle. They take 10 s.
const LONG_S: u32 = 14;
/// Row and GDF type of each event of the recording.
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

    /// Creates a recording that is long enough for the filters to settle, so that it can be
    /// compared.
    pub(crate) fn settled() -> Self {
        Self::with_length(LONG_S)
    }

    fn with_length(seconds: u32) -> Self {
        let fixture = Self { folder: tempfile::tempdir().expect("a folder") };
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

    /// Returns the samples that the model's ADC makes of the recording.
    pub(crate) fn samples(&self) -> impl Iterator<Item = Sample> {
        let recording = Recording::open(self.recording()).expect("a recording");
        let map = MontageMap::new(&recording.labels(), &labels(), Missing::Refuse).expect("a map");
        let spec = AdcSpec {
            rate_hz: model::ADC_RATE_HZ.into(),
            lsb_uv: f64::from(model::LSB_NV) / 1000.0,
        };
        VirtualAdc::new(recording, &map, spec).expect("an ADC").map(|counts| {
            let counts = counts.expect("a sample");
            Sample { counts: std::array::from_fn(|channel| counts[channel]) }
        })
    }

    /// Passes the message of each frame of [`Self::codes`] to `change`, which may change the
    /// message. Writes a file with the frames for which `change` returns true.
    pub(crate) fn changed(
        &self,
        name: &str,
        mut change: impl for<'m> FnMut(&mut ToHost<'m>) -> bool,
    ) -> PathBuf {
        let bytes = fs::read(self.codes()).expect("codes");
        let mut decoder = Decoder::<MAX_FRAME>::new();
        let (mut input, mut changed) = (&bytes[..], Vec::new());
        while let Some(outcome) = decoder.next::<ToHost>(&mut input) {
            let mut frame = outcome.expect("a whole frame");
            if change(&mut frame.message) {
                let mut buffer = [0; MAX_FRAME];
                let mut encoder = Encoder::starting_at(frame.header.seq);
                let time_us = frame.header.device_time_us;
                let bytes = encoder.encode(time_us, &frame.message, &mut buffer);
                changed.extend_from_slice(bytes.expect("it fits a frame"));
            }
        }
        self.written(name, &changed)
    }

    /// Writes a file into the folder and returns its path.
    pub(crate) fn written(&self, name: &str, bytes: &[u8]) -> PathBuf {
        fs::write(self.path(name), bytes).expect("writable");
        self.path(name)
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
        let original = with_original.then(|| self.recording());
        let (output, progress) = (self.path(output), Progress::default());
        decoding(&model, format).decode(codes, &output, original.as_deref(), &progress)
    }
}

/// Returns options to decode the kind of codes that comes first in a file, and to replace no file.
pub(crate) fn decoding(model: &Model, format: SignalFormat) -> Decoding<'_> {
    Decoding { model, format, kind: None, existing: Existing::Refuse }
}

pub(crate) const ENCODING: Encoding = Encoding {
    mains: Mains::Hz50,
    missing: Missing::Refuse,
    existing: Existing::Refuse,
    stream: EncodedStream::Codes,
};

/// Returns the labels of the model's electrodes.
pub(crate) fn labels() -> Vec<&'static str> {
    model::LABELS.split(' ').collect()
}

/// Returns the values of each electrode in a file; the electrodes are the file's first signals.
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

/// Describes a recording of the model's electrodes at the ADC's rate.
pub(crate) fn file_to_write() -> FileToWrite {
    let (range, rate_hz) = ([-1_000.0, 1_000.0], model::ADC_RATE_HZ.into());
    FileToWrite::microvolts(labels(), range, rate_hz, ROWS_PER_RECORD)
}

fn write(path: &Path, seconds: u32) {
    let file = file_to_write();
    let mut writer = GdfWriter::new(File::create(path).expect("a file"), &file).expect("a header");
    let rows = seconds * u32::from(model::ADC_RATE_HZ);
    for first in (0..rows).step_by(64) {
        let rows = (first..first + ROWS_PER_RECORD).flat_map(row);
        writer.write_record(&rows.collect::<Vec<f32>>()).expect("a record");
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
