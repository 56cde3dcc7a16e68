//! Conversion of recordings to files of samples and events.
//!
//! ```text
//! records ──► Playback: Core ──► Collector ──blocks, events──► Survey (first pass): times, counts
//!                                                         └──► Rows (second pass): files
//! ```
//!
//! A recording is played twice: an event can arrive after its sample, so the first pass finds the
//! sample of each event, and the second one writes the files.

mod block;
mod collector;
mod playback;
mod row_files;
mod survey;

use std::fmt;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use artifact::classifier::Classifier;
use bridge_core::{Choice, EventStamps, Model, Settings, Summary, choice};
use new_file::{Existing, NewFile, NewFileError};
use thiserror::Error;
use tracing::subscriber::NoSubscriber;

use crate::conversion::block::Stream;
use crate::conversion::collector::Listener;
use crate::conversion::playback::Playback;
use crate::conversion::row_files::{CsvRows, NpzRows, RecordRows, RowWriter, Rows, StreamFile};
use crate::conversion::survey::{StreamSurvey, Survey};
use crate::recording::reader::{LeftOut, RecordingReader};
use crate::recording::{FileHeader, RecordingError};

/// A recording to convert, and the files to write.
#[derive(Clone, Debug)]
pub struct Conversion {
    /// Path of the recording to read.
    pub file: PathBuf,
    /// Format of the files to write. The name of a file consists of the names of the recording, the
    /// stream and the format.
    pub to: FileFormat,
    /// Whether the new files replace existing files of the same names.
    pub force: bool,
    /// Classifier of the features in the recording; `None` writes no predictions.
    pub classifier: Option<Classifier>,
}

/// Reason why a recording cannot be converted.
#[derive(Debug, Error)]
pub enum ConvertError {
    /// The file to convert is not a usable recording.
    #[error("{} cannot be used as a recording", .0.display())]
    Recording(PathBuf, #[source] RecordingError),
    /// The second pass over the recording found a different number of rows than the first pass.
    #[error(
        "{path} changed while it was converted: {announced} rows of {stream} became {written}; convert it \
         again when no program writes to it"
    )]
    Changed {
        /// Path of the recording.
        path: PathBuf,
        /// Stream whose number of rows differs.
        stream: &'static str,
        /// Number of rows in the first pass, which the headers of files state.
        announced: u64,
        /// Number of rows in the second pass.
        written: u64,
    },
    /// A file in the chosen format cannot hold the stream or the time of its start.
    #[error("{} cannot be written in this format; choose another one with --to", .0.display())]
    Format(PathBuf, #[source] std::io::Error),
    /// A file cannot be created or written.
    #[error(transparent)]
    NewFile(#[from] NewFileError),
}

choice! {
    /// Format of the files that `convert` writes.
    FileFormat {
        Gdf = "gdf": "GDF 2.20: float32, and the events in a table",
        Bdf = "bdf": "BDF+: 24 bits, and the events as annotations",
        Csv = "csv": "Comma-separated values with a header line",
        Npz = "npz": "Arrays for numpy",
    }
}

impl FileFormat {
    /// Returns the extension of a file's name in this format.
    pub fn extension(self) -> &'static str {
        let named = FileFormat::CHOICES.iter();
        let name = named.filter(|(_, _, format)| *format == self);
        name.map(|(name, _, _)| *name).next().unwrap_or_default()
    }
}

/// Files that a conversion wrote, and counts of what it left out. Prints as lines of text.
#[derive(Debug)]
pub struct ConvertSummary {
    files: Vec<(PathBuf, u64)>,
    events: usize,
    left_out: LeftOut,
    /// Number of missing rows that no filler replaces, because their stream already has as many
    /// fillers as permitted.
    unfilled: u64,
    /// Two durations of a stream, seconds: by its rows, and by the host's clock. The stream is the
    /// first one for which they differ too much; `None` if they agree for all streams.
    differing_s: Option<(f64, f64)>,
    core: Summary,
}

impl fmt::Display for ConvertSummary {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (path, rows) in &self.files {
            writeln!(formatter, "{}: {rows} rows", path.display())?;
        }
        write!(formatter, "events: {}; {}", self.events, self.core)?;
        let LeftOut { within, at_end } = self.left_out;
        if at_end > 0 {
            write!(
                formatter,
                "\nthe recording was not ended: its last {at_end} bytes are no whole record and \
                 were left out"
            )?;
        }
        if self.unfilled > 0 {
            write!(
                formatter,
                "\n{} missing rows are not filled: more is missing than a day or the time of the \
                 recording",
                self.unfilled
            )?;
        }
        if let Some((rows_s, host_s)) = self.differing_s {
            write!(
                formatter,
                "\nwarning: {rows_s:.0} s of signal in {host_s:.0} s of the host's time: the device \
                 was not in real time, or an outage is not filled. Times of the host (time_s, \
                 time_ns) are not those of the rows; the rate and the device's time are right"
            )?;
        }
        if within > 0 {
            write!(
                formatter,
                "\nthe recording is damaged: {within} bytes between whole records were left out"
            )?;
        }
        Ok(())
    }
}

/// Converts a recording in two passes. In each pass, `progress` gets the recording's file and the
/// name of the pass, and returns a reader that reports how far the file has been read.
///
/// # Errors
///
/// [`ConvertError`] if the recording cannot be read, or a file cannot be written.
pub fn convert<R: Read>(
    options: &Conversion,
    model: Arc<Model>,
    progress: impl Fn(File, &'static str) -> R,
) -> Result<ConvertSummary, ConvertError> {
    let input = Input {
        path: &options.file,
        bytes: std::fs::metadata(&options.file).map_or(0, |file| file.len()),
        model,
        classifier: options.classifier.as_ref(),
        progress,
    };
    // Both passes would log the same messages, so the first one logs none.
    let silent = NoSubscriber::default();
    let survey = tracing::subscriber::with_default(silent, || {
        input.play(Survey::default(), "looking for events", |_| Ok(()))
    });
    let (survey, left_out) = survey?;
    let mut core = survey.core.summary();
    let unfilled = survey.collector.unfilled;
    let objection = survey.core.objection().map(str::to_owned);
    let survey = survey.collector.listener;
    let mut durations = survey.streams.iter();
    let differing_s = durations.find_map(StreamSurvey::differing_durations_s);
    let outputs = outputs(options, &survey, objection)?;
    let mut rows = Rows::default();
    let mut files = Vec::new();
    let mut new_files = Vec::new();
    for (stream, path) in &outputs {
        let file = options.create(path)?;
        let handle = file.handle();
        let writer = handle.and_then(|handle| writer(options.to, handle, &survey, *stream));
        rows.writers[*stream as usize] = writer.map_err(|source| failed(path, source))?;
        new_files.push(file);
        files.push((path.clone(), survey.streams[*stream as usize].rows));
    }
    let path_of = |number: usize| {
        let mut named = outputs.iter();
        let found = named.find(|(stream, _)| *stream as usize == number);
        found.map_or(options.file.as_path(), |(_, path)| path.as_path())
    };
    let (played, _) = input.play(rows, "writing", |rows| match rows.failed.take() {
        Some((stream, source)) => Err(failed(path_of(stream), source)),
        None => Ok(()),
    })?;
    core.decoder.malformed = played.collector.malformed();
    for stream in Stream::ALL {
        let announced = survey.streams[stream as usize].rows;
        let written = played.collector.listener.counts[stream as usize];
        if announced != written {
            return Err(ConvertError::Changed {
                path: options.file.clone(),
                stream: stream.name(),
                announced,
                written,
            });
        }
    }
    let writers = played.collector.listener.writers.into_iter().enumerate();
    for (number, writer) in writers {
        if let Some(writer) = writer {
            let finished = writer.finish();
            finished.map_err(|source| failed(path_of(number), source))?;
        }
    }
    for file in new_files {
        file.finish()?;
    }
    Ok(ConvertSummary { files, events: survey.events.len(), left_out, unfilled, differing_s, core })
}

/// Returns the error for a failure to write the file at `path`.
fn failed(path: &Path, source: std::io::Error) -> ConvertError {
    let path = path.to_owned();
    match source.kind() {
        std::io::ErrorKind::InvalidInput => ConvertError::Format(path, source),
        _ => NewFileError::Write { path, source }.into(),
    }
}

impl Conversion {
    /// Creates an output file, and refuses to write to the recording that is read.
    fn create(&self, path: &Path) -> Result<NewFile, NewFileError> {
        let inputs = [self.file.clone()];
        NewFile::create(path, Existing::from_force(self.force), &inputs)
    }
}

/// Returns the files to write: one for each stream that has rows. `objection` is the core's reason,
/// if any, for publishing nothing from the device.
fn outputs(
    options: &Conversion,
    survey: &Survey,
    objection: Option<String>,
) -> Result<Vec<(Stream, PathBuf)>, ConvertError> {
    let present = |stream: &Stream| survey.streams[*stream as usize].rows > 0;
    let outputs = Stream::ALL.into_iter().filter(present).map(|stream| {
        let name = format!("{}.{}", stream.name(), options.to.extension());
        (stream, options.file.with_extension(name))
    });
    let outputs: Vec<_> = outputs.collect();
    if outputs.is_empty() {
        let path = options.file.clone();
        let source = match objection {
            Some(objection) => RecordingError::NothingUsable(objection),
            None if options.classifier.is_some() => RecordingError::NothingUsable(
                "it has no codes or samples, and no features of this classifier; name the \
                 --classifier with which it was recorded"
                    .to_owned(),
            ),
            None => RecordingError::NoDevice,
        };
        return Err(ConvertError::Recording(path, source));
    }
    // Check that every file can be created before the first one is written.
    for (_, path) in &outputs {
        options.create(path)?;
    }
    Ok(outputs)
}

/// Creates the writer of a stream's file in `format`; `None` if the stream has no rows.
fn writer(
    format: FileFormat,
    file: File,
    survey: &Survey,
    stream: Stream,
) -> std::io::Result<Option<Box<dyn RowWriter>>> {
    let rows = &survey.streams[stream as usize];
    let Some(first) = &rows.first else {
        return Ok(None);
    };
    let events = survey.placed(stream).into_iter();
    let description = StreamFile {
        first,
        rows: rows.rows,
        start_ns: rows.start_ns(),
        events: events.map(|(row, event)| (row, event.clone())).collect(),
    };
    Ok(Some(match format {
        FileFormat::Csv => Box::new(CsvRows::new(file, &description)?),
        FileFormat::Gdf => Box::new(RecordRows::gdf(file, &description)?),
        FileFormat::Bdf => Box::new(RecordRows::bdf(file, &description)?),
        FileFormat::Npz => Box::new(NpzRows::new(file, &description)?),
    }))
}

/// The recording to read, the model to decode it with, and the function that shows the progress.
struct Input<'a, P> {
    path: &'a Path,
    /// Length of the recording when the conversion began. What a program appends to the file later
    /// is not read, so that both passes read the same bytes.
    bytes: u64,
    model: Arc<Model>,
    classifier: Option<&'a Classifier>,
    progress: P,
}

impl<R: Read, P: Fn(File, &'static str) -> R> Input<'_, P> {
    /// Plays the recording to `listener`. Calls `check` after each record, and stops if `check`
    /// fails.
    fn play<L: Listener>(
        &self,
        listener: L,
        what: &'static str,
        mut check: impl FnMut(&mut L) -> Result<(), ConvertError>,
    ) -> Result<(Playback<L>, LeftOut), ConvertError> {
        let unusable = |source| ConvertError::Recording(self.path.to_owned(), source);
        let file = File::open(self.path).map_err(|error| unusable(error.into()))?;
        let source = (self.progress)(file, what).take(self.bytes);
        let mut reader = RecordingReader::new(source).map_err(unusable)?;
        let settings = settings(reader.header());
        let mut playback = Playback::new(settings, Arc::clone(&self.model), listener);
        if let Some(classifier) = self.classifier {
            playback.core.set_classifier(classifier.clone());
        }
        while let Some(record) = reader.next_record().map_err(unusable)? {
            playback.play(record);
            check(&mut playback.collector.listener)?;
        }
        playback.finish();
        check(&mut playback.collector.listener)?;
        Ok((playback, reader.left_out()))
    }
}

/// Returns the settings of the bridge's core: streams and mains frequency are the recording's.
fn settings(header: &FileHeader) -> Settings {
    Settings {
        mains_hz: header.mains_hz,
        event_stamps: EventStamps::Scalp,
        streams: header.streams,
        ..Settings::default()
    }
}
