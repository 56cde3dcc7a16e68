//! Streams of the Lab Streaming Layer, as the Python programs in `tests/it` receive them.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use crate::process::Process;
use crate::workspace;

/// Starts the program `NAME.py` in `tests/it` with the interpreter `python`.
///
/// # Panics
/// When Python does not start.
pub fn start(python: &Path, folder: &Path, name: &str, arguments: &[&str]) -> Process {
    let script = workspace::root().join("tests/acceptance/tests/it");
    let mut command = Command::new(python);
    command.arg(script.join(name).with_extension("py"));
    Process::start(name, command.args(arguments), folder).expect("python starts")
}

/// Returns a prefix for the names of streams that no other process on this machine uses. Tests in
/// one executable must pass different values of `name`.
pub fn unique(name: &str) -> String {
    format!("{name}{}", std::process::id())
}

/// What `lsl_record.py` has received.
#[derive(Clone, Debug)]
pub struct LslRecording {
    folder: PathBuf,
    /// Metadata of each stream, markers, and what pyxdf reads from the file.
    pub described: Value,
}

/// The samples of one regular stream.
#[derive(Clone, Debug)]
pub struct LslSignal {
    /// Time of each sample on the clock of the Lab Streaming Layer, seconds.
    pub times: Vec<f64>,
    /// Values, sample by sample.
    pub values: Vec<f32>,
    /// Number of values of a sample.
    pub channels: usize,
}

impl LslRecording {
    /// Reads the recording that `lsl_record.py` has written to `folder`.
    ///
    /// # Panics
    /// When `folder` contains no recording.
    pub fn read(folder: &Path) -> Self {
        let recorded = fs::read_to_string(folder.join("recorded.json")).expect("a recording");
        let described = serde_json::from_str(&recorded).expect("JSON");
        Self { folder: folder.to_owned(), described }
    }

    /// Reads the samples of `stream`.
    ///
    /// # Panics
    /// When the stream was not recorded.
    pub fn signal(&self, stream: &str) -> LslSignal {
        let described = &self.described["streams"][stream];
        let channels = described["channels"].as_array().expect("channels").len();
        let times = read(&self.folder, &format!("{stream}.f64"), f64::from_le_bytes);
        let values = read(&self.folder, &format!("{stream}.f32"), f32::from_le_bytes);
        assert_eq!(values.len(), times.len() * channels, "{stream}");
        LslSignal { times, values, channels }
    }

    /// Returns time and text of each marker of the stream `events`.
    ///
    /// # Panics
    /// When the stream was not recorded.
    pub fn markers(&self) -> Vec<(f64, String)> {
        let markers = &self.described["streams"]["events"]["markers"];
        let markers = markers.as_array().expect("markers").iter();
        let marker = |of: &Value| Some((of[0].as_f64()?, of[1].as_str()?.to_owned()));
        markers.map(|of| marker(of).expect("time and text")).collect()
    }
}

fn read<T, const N: usize>(folder: &Path, file: &str, number: fn([u8; N]) -> T) -> Vec<T> {
    let bytes = fs::read(folder.join(file)).expect(file);
    bytes.as_chunks().0.iter().copied().map(number).collect()
}
