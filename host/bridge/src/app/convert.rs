//! The subcommand `convert`: reads a recording twice and writes one file per stream.

use std::fmt;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Parser;
use indicatif::{ProgressBar, ProgressStyle};
use new_file::{Existing, NewFile, NewFileError};
use tracing::subscriber::NoSubscriber;

use crate::conversion::bdf::BdfRows;
use crate::conversion::block::Stream;
use crate::conversion::collector::Listener;
use crate::conversion::csv::CsvWriter;
use crate::conversion::gdf::GdfRows;
use crate::conversion::npz::NpzRows;
use crate::conversion::playback::Playback;
use crate::conversion::rows::{RowWriter, Rows, StreamFile};
use crate::conversion::survey::Survey;
use crate::decoder::model::Model;
use crate::diagnostics::summary::Summary;
use crate::error::BridgeError;
use crate::recording::error::RecordingError;
use crate::recording::file_header::FileHeader;
use crate::recording::reader::{LeftOut, RecordingReader};
use crate::settings::{AnnouncedStream, EventStamps, FillerPolicy, Settings, StampPoint};

/// Write a recording as files of codes and samples, one for each stream in it.
///
/// FILE.codes.gdf has the codes and FILE.reconstructed.gdf the EEG decoded from them;
/// FILE.raw.gdf and FILE.filtered.gdf exist if these streams were recorded. Each row stands at its
/// time: what was lost, or is missing between two runs of the device, is a filler with a flag. Each
/// event stands at the first row that happened at its time or later. A file appears under its name
/// when it is complete; an existing one is replaced only with --force.
///
/// Exit status: 0 done, 1 a file cannot be written, 2 wrong usage, no usable recording or an existing
/// file.
#[derive(Clone, Debug, Parser)]
#[command(name = "convert")]
pub(crate) struct ConvertOptions {
    /// Recording to read
    pub(crate) file: PathBuf,
    /// Format of the files to write
    #[arg(long, value_enum)]
    pub(crate) to: FileFormat,
    /// Folder of the model to decode with, instead of the built-in one
    #[arg(long, env = "CORTICODE_MODEL", value_name = "FOLDER")]
    pub(crate) model: Option<PathBuf>,
    /// Replace files that exist
    #[arg(long)]
    pub(crate) force: bool,
}

/// Format of the files that `convert` writes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum FileFormat {
    /// GDF 2.20: float32, and the events in a table.
    Gdf,
    /// BDF+: 24 bits, and the events as annotations.
    Bdf,
    /// Comma-separated values with a header line.
    Csv,
    /// Arrays for numpy.
    Npz,
}

impl FileFormat {
    /// Ending of the names of files.
    pub(crate) fn extension(self) -> &'static str {
        match self {
            FileFormat::Gdf => "gdf",
            FileFormat::Bdf => "bdf",
            FileFormat::Csv => "csv",
            FileFormat::Npz => "npz",
        }
    }
}

/// What a conversion wrote and what it had to leave out; prints as lines.
#[derive(Debug)]
pub(crate) struct ConvertSummary {
    files: Vec<(PathBuf, u64)>,
    events: usize,
    left_out: LeftOut,
    /// Number of missing rows for which there are no fillers.
    unfilled: u64,
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
        if within > 0 {
            write!(
                formatter,
                "\nthe recording is damaged: {within} bytes between whole records were left out"
            )?;
        }
        Ok(())
    }
}

/// Converts a recording.
///
/// # Errors
///
/// [`BridgeError`] if the recording or the model cannot be read, or a file cannot be written.
pub(super) fn convert(options: &ConvertOptions) -> Result<ConvertSummary, BridgeError> {
    let model = match &options.model {
        Some(folder) => Model::read(folder),
        None => Model::embedded(),
    };
    let input = Input {
        path: &options.file,
        model: Arc::new(model.map_err(BridgeError::Model)?),
    };
    // The log is that of the second pass.
    let silent = NoSubscriber::default();
    let survey = tracing::subscriber::with_default(silent, || {
        input.play(Survey::default(), "looking for events", |_| Ok(()))
    });
    let (survey, left_out) = survey?;
    let mut core = survey.summary();
    let unfilled = survey.collector.unfilled;
    let objection = survey.objection().map(str::to_owned);
    let survey = survey.collector.listener;
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
    Ok(ConvertSummary {
        files,
        events: survey.events.len(),
        left_out,
        unfilled,
        core,
    })
}

fn failed(path: &Path, source: std::io::Error) -> BridgeError {
    let path = path.to_owned();
    NewFileError::Write { path, source }.into()
}

impl ConvertOptions {
    /// Creates an output file, which must not be the recording.
    fn create(&self, path: &Path) -> Result<NewFile, NewFileError> {
        let inputs = [self.file.clone()];
        NewFile::create(path, Existing::from_force(self.force), &inputs)
    }
}

/// Returns the names of the files to write: one for each stream of the recording. `objection` is the core's.
fn outputs(
    options: &ConvertOptions,
    survey: &Survey,
    objection: Option<String>,
) -> Result<Vec<(Stream, PathBuf)>, BridgeError> {
    let present = |stream: &Stream| survey.streams[*stream as usize].rows > 0;
    let outputs = Stream::ALL.into_iter().filter(present).map(|stream| {
        let name = format!("{}.{}", stream.name(), options.to.extension());
        (stream, options.file.with_extension(name))
    });
    let outputs: Vec<_> = outputs.collect();
    if outputs.is_empty() {
        let path = options.file.clone();
        let source = match objection {
            Some(objection) => RecordingError::NothingUsable { objection },
            None => RecordingError::NoDevice,
        };
        return Err(BridgeError::Recording { path, source });
    }
    // All names are checked before the first file is written.
    for (_, path) in &outputs {
        options.create(path)?;
    }
    Ok(outputs)
}

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
        FileFormat::Csv => Box::new(CsvWriter::new(file, &description)?),
        FileFormat::Gdf => Box::new(GdfRows::new(file, &description)?),
        FileFormat::Bdf => Box::new(BdfRows::new(file, &description)?),
        FileFormat::Npz => Box::new(NpzRows::new(file, &description)?),
    }))
}

/// A recording to read, and the model to decode it with.
struct Input<'a> {
    path: &'a Path,
    model: Arc<Model>,
}

impl Input<'_> {
    /// Plays the whole recording to a listener. `check` is called after every record.
    fn play<L: Listener>(
        &self,
        listener: L,
        what: &'static str,
        mut check: impl FnMut(&mut L) -> Result<(), BridgeError>,
    ) -> Result<(Playback<L>, LeftOut), BridgeError> {
        let unusable = |source| BridgeError::Recording {
            path: self.path.to_owned(),
            source,
        };
        let file = File::open(self.path).map_err(|error| unusable(error.into()))?;
        let bytes = file.metadata().map_or(0, |metadata| metadata.len());
        let bar = ProgressBar::new(bytes).with_message(what);
        let style = ProgressStyle::with_template("{msg} {wide_bar} {percent}%");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        let mut reader = RecordingReader::new(bar.wrap_read(file)).map_err(unusable)?;
        let settings = settings(reader.header());
        let mut playback = Playback::new(settings, Arc::clone(&self.model), listener);
        let played = self.play_all(&mut reader, &mut playback, &mut check);
        bar.finish_and_clear();
        played.map(|()| (playback, reader.left_out()))
    }

    fn play_all<L: Listener>(
        &self,
        reader: &mut RecordingReader<impl Read>,
        playback: &mut Playback<L>,
        check: &mut impl FnMut(&mut L) -> Result<(), BridgeError>,
    ) -> Result<(), BridgeError> {
        loop {
            let record = reader.next_record();
            let record = record.map_err(|source| BridgeError::Recording {
                path: self.path.to_owned(),
                source,
            })?;
            let Some(record) = record else {
                playback.finish();
                return check(&mut playback.collector.listener);
            };
            playback.play(record);
            check(&mut playback.collector.listener)?;
        }
    }
}

/// Settings of the core: those of the recording, and fillers for everything that is missing.
fn settings(header: &FileHeader) -> Settings {
    Settings {
        stamp: StampPoint::First,
        mains_hz: header.mains_hz,
        filler: FillerPolicy::Last,
        low_latency: false,
        event_stamps: EventStamps::Scalp,
        announced: AnnouncedStream::Encoded,
        streams: header.streams,
        packed_rate: None,
    }
}
