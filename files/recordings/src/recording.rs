//! Reads recordings of all supported formats block by block.

use std::{fs::File, io::SeekFrom, path::Path};

use crate::{
    edf::annotations::RecordAnnotations,
    error::RecordingError,
    event::{Event, Onsets},
    format::{self, Format},
    gdf::events::{PREFIX, TablePrefix, records_before_table},
    header::{self, Header},
    ratio::Ratio,
    signal::{Signal, SignalKind},
    source::{BLOCK_BYTES, Source, in_memory, is_damaged_by_text_mode, read_at},
    timeline::{Gaps, Timeline},
    warning::Warning,
};

/// An open recording: its header, and the position of the next record to read.
///
/// Keeps in memory the header (256 bytes for each signal) and the raw bytes of one block of at
/// least one record; [`Recording::events`] also loads the event table of a GDF file. No read buffer
/// is larger than the file, even if the header is damaged.
pub struct Recording {
    source: Box<dyn Source>,
    header: Header,
    record_bytes: u64,
    records: u64,
    truncated: bool,
    file_bytes: u64,
    next_record: u64,
    raw: Vec<u8>,
    timeline: Timeline,
}

/// The samples of consecutive records of a recording, in physical units.
#[derive(Debug, Default, Clone, PartialEq)]
pub struct Block {
    /// Index of the block's first record, counted from the start of the file.
    pub first_record: u64,
    /// Number of whole records in the block; 0 after the end of the recording.
    pub records: u64,
    /// Samples of each signal, in the unit of the signal; empty for annotation signals and for
    /// signals without a calibration.
    pub samples: Vec<Vec<f64>>,
}

impl Recording {
    /// Opens a file and reads its header.
    ///
    /// # Errors
    /// [`RecordingError::Open`], [`RecordingError::Folder`], [`RecordingError::OtherFormat`] and
    /// all errors of [`Recording::from_source`].
    pub fn open(path: impl AsRef<Path>) -> Result<Self, RecordingError> {
        let path = path.as_ref();
        let file = File::open(path)
            .map_err(|source| RecordingError::Open { path: path.to_owned(), source })?;
        if file.metadata().is_ok_and(|metadata| metadata.is_dir()) {
            let path = path.to_owned();
            return Err(RecordingError::Folder { path });
        }
        Self::from_source(file).map_err(|error| format::explain(path, error))
    }

    /// Reads the header of a recording from a file or from memory.
    ///
    /// # Errors
    /// [`RecordingError::Empty`] if there are no bytes; [`RecordingError::TextMode`] if a transfer
    /// in text mode has damaged the file; [`RecordingError::UnknownFormat`] if no format matches;
    /// [`RecordingError::HeaderTruncated`], [`RecordingError::HeaderField`],
    /// [`RecordingError::Range`] or [`RecordingError::SampleType`] for an unusable header;
    /// [`RecordingError::NoData`] if the file has no whole record; [`RecordingError::Read`] if
    /// reading fails.
    pub fn from_source(source: impl Source + 'static) -> Result<Self, RecordingError> {
        let mut source: Box<dyn Source> = Box::new(source);
        let file_bytes = source.seek(SeekFrom::End(0)).map_err(|source| RecordingError::Read {
            at: 0,
            bytes: 0,
            source,
        })?;
        let header = match header::read(&mut *source, file_bytes) {
            Err(error) if error.is_about_the_header() => {
                if is_damaged_by_text_mode(&mut *source, file_bytes)? {
                    return Err(RecordingError::TextMode);
                }
                return Err(error);
            }
            header => header?,
        };
        Self::with_header(source, header, file_bytes)
    }

    fn with_header(
        mut source: Box<dyn Source>,
        mut header: Header,
        file_bytes: u64,
    ) -> Result<Self, RecordingError> {
        let record_bytes = header.record_bytes();
        let data_bytes = file_bytes - header.data_start;
        let whole = data_bytes.checked_div(record_bytes).unwrap_or(0);
        let left_over = data_bytes - whole * record_bytes;
        let is_gdf = matches!(header.format, Format::Gdf1(_) | Format::Gdf2(_));
        let unstated = header.records.is_none();
        let stated = if unstated && is_gdf {
            records_before_table(&mut *source, &header, file_bytes)?
        } else {
            header.records
        };
        let promised = stated.unwrap_or(whole);
        let truncated = promised > whole || (stated.is_none() && left_over > 0);
        if unstated {
            let derived = promised;
            header.warnings.push(Warning::RecordsUnknown { derived });
        }
        // A GDF file may be longer than its records, because an event table follows them.
        let is_odd_size = !is_gdf && data_bytes != promised.saturating_mul(record_bytes);
        if is_odd_size && is_damaged_by_text_mode(&mut *source, file_bytes)? {
            return Err(RecordingError::TextMode);
        }
        if truncated {
            header.warnings.push(Warning::Truncated { promised, whole, left_over });
        }
        let records = promised.min(whole);
        if records == 0 {
            return Err(RecordingError::NoData { record_bytes, data_bytes });
        }
        let surplus = data_bytes - records * record_bytes;
        // In a GDF file, bytes after the records are the event table, not surplus.
        if !is_gdf && !truncated && surplus > 0 {
            let more = surplus / record_bytes;
            header.warnings.push(Warning::Surplus {
                records: more,
                seconds: header.seconds(more),
                bytes: surplus % record_bytes,
            });
        }
        let raw = Vec::new();
        let timeline = Timeline::new(&header, records);
        let mut recording = Self {
            source,
            header,
            record_bytes,
            records,
            truncated,
            file_bytes,
            next_record: 0,
            raw,
            timeline,
        };
        recording.read_record_times()?;
        Ok(recording)
    }

    /// Returns the file's format, with its variant or version.
    pub fn format(&self) -> Format {
        self.header.format
    }

    /// Returns all signals in file order, including annotation signals.
    pub fn signals(&self) -> &[Signal] {
        &self.header.signals
    }

    /// Returns the labels of all signals in file order, exactly as in the file.
    pub fn labels(&self) -> Vec<&str> {
        self.header.signals.iter().map(|signal| signal.label.as_str()).collect()
    }

    /// Returns the defects found so far that do not prevent reading the file.
    pub fn warnings(&self) -> &[Warning] {
        &self.header.warnings
    }

    /// Returns the number of whole records in the recording, > 0.
    pub fn records(&self) -> u64 {
        self.records
    }

    /// Returns the duration of one record, s; `None` if the file contains only annotations.
    pub fn record_duration(&self) -> Option<Ratio> {
        self.header.record_duration
    }

    /// Returns the duration of all whole records together, s.
    pub fn duration_s(&self) -> f64 {
        self.header.seconds(self.records)
    }

    /// Moves the read position back to the first record.
    pub fn rewind(&mut self) {
        self.next_record = 0;
    }

    /// Reads the next records into `block`, reusing its memory. Returns false at the end of the
    /// recording.
    ///
    /// # Errors
    /// [`RecordingError::Read`] if reading fails or the file has shrunk since it was opened.
    pub fn read_block(&mut self, block: &mut Block) -> Result<bool, RecordingError> {
        block.first_record = self.next_record;
        block.samples.resize_with(self.header.signals.len(), Vec::new);
        block.samples.iter_mut().for_each(Vec::clear);
        block.records =
            (BLOCK_BYTES / self.record_bytes).max(1).min(self.records - self.next_record);
        if block.records == 0 {
            return Ok(false);
        }
        let at = self.header.data_start + self.next_record * self.record_bytes;
        self.raw.resize(in_memory(block.records * self.record_bytes), 0);
        read_at(&mut *self.source, at, &mut self.raw)?;
        for record in self.raw.chunks_exact(in_memory(self.record_bytes)) {
            let mut rest = record;
            for (signal, out) in self.header.signals.iter().zip(&mut block.samples) {
                let (own, others) = rest.split_at(in_memory(signal.record_bytes()));
                rest = others;
                if signal.kind == SignalKind::Samples
                    && let Ok(line) = signal.calibration
                {
                    signal.sample_type.decode(own, |digital| line.physical(digital), out);
                }
            }
        }
        self.next_record += block.records;
        Ok(true)
    }

    /// Returns all events in file order: the annotations of EDF+ and BDF+, which takes a pass over
    /// all records, or the event table of GDF. Damaged annotations or tables add a [`Warning`].
    ///
    /// # Errors
    /// [`RecordingError::Read`] if reading fails.
    pub fn events(&mut self) -> Result<Vec<Event>, RecordingError> {
        match self.header.format {
            Format::Gdf1(_) | Format::Gdf2(_) => self.gdf_events(),
            _ => self.annotated_events(),
        }
    }

    /// Returns all events in file order, each with its time in the signal that a
    /// [`crate::VirtualAdc`] plays, in s since the first sample; `None` for an event outside the
    /// signal.
    ///
    /// # Errors
    /// [`RecordingError::Read`] if reading fails.
    pub fn placed_events(&mut self) -> Result<Vec<(Event, Option<f64>)>, RecordingError> {
        let events = self.events()?.into_iter();
        let placed = events.map(|event| {
            let place_s = self.timeline.place(event.onset_s);
            (event, place_s)
        });
        Ok(placed.collect())
    }

    /// Returns the events' starts as times in the signal that a [`crate::VirtualAdc`] plays, in
    /// which gaps between records are closed. Sparse samples of GDF add a [`Warning`].
    ///
    /// # Errors
    /// [`RecordingError::Read`] if reading fails.
    pub fn onsets(&mut self) -> Result<Onsets, RecordingError> {
        let onsets = Onsets::new(self.placed_events()?);
        if onsets.sparse_samples > 0 {
            let count = onsets.sparse_samples;
            self.warn_once(Warning::SparseSamples { count });
        }
        Ok(onsets)
    }

    fn gdf_events(&mut self) -> Result<Vec<Event>, RecordingError> {
        let at = self.header.data_start + self.records * self.record_bytes;
        let bytes = self.file_bytes.saturating_sub(at);
        // A truncated file has lost its event table, which is at the end. A file without a table
        // has no bytes after the records.
        if self.truncated || bytes == 0 {
            return Ok(Vec::new());
        }
        let mut announced = 0;
        if bytes >= PREFIX as u64 {
            let mut prefix = [0; PREFIX];
            read_at(&mut *self.source, at, &mut prefix)?;
            let table = TablePrefix::parse(self.header.format, prefix);
            announced = table.count;
            if let Some(needed) = table.column_bytes()
                && needed <= bytes - PREFIX as u64
            {
                let mut columns = vec![0; in_memory(needed)];
                read_at(&mut *self.source, at + PREFIX as u64, &mut columns)?;
                return Ok(table.events(&columns, self.header.fastest_rate_hz()));
            }
        }
        if is_damaged_by_text_mode(&mut *self.source, self.file_bytes)? {
            return Err(RecordingError::TextMode);
        }
        self.warn_once(Warning::EventTable { announced, bytes });
        Ok(Vec::new())
    }

    /// Reads the start times of all records, or only of the first if the format allows no gaps.
    fn read_record_times(&mut self) -> Result<(), RecordingError> {
        let can_have_gaps = self.header.format.is_discontinuous();
        let timed = if can_have_gaps { self.records } else { 1 };
        let places = self.annotation_places();
        // Without annotation signals, no record states a time.
        for record in (0..timed).take_while(|_| !places.is_empty()) {
            let start_s = self.record_annotations(record, &places)?.record_start_s;
            self.timeline.add_record(record, start_s);
        }
        let Gaps { count, seconds, unstated } = self.timeline.gaps;
        if count > 0 {
            self.warn_once(Warning::Gaps { count, seconds });
        }
        if unstated > 0 && can_have_gaps {
            self.warn_once(Warning::RecordTimes { records: unstated });
        }
        Ok(())
    }

    fn annotated_events(&mut self) -> Result<Vec<Event>, RecordingError> {
        let mut events = Vec::new();
        let (mut lists, mut first_invalid) = (0, None);
        let places = self.annotation_places();
        for record in (0..self.records).take_while(|_| !places.is_empty()) {
            let annotations = self.record_annotations(record, &places)?;
            events.extend(annotations.events);
            lists += annotations.invalid;
            first_invalid = first_invalid.or(annotations.first_invalid);
        }
        if let Some(first) = first_invalid {
            self.warn_once(Warning::Annotations { lists, first });
        }
        Ok(events)
    }

    /// For each annotation signal, returns its offset in a record and its length, both in bytes.
    fn annotation_places(&self) -> Vec<(u64, u64)> {
        let mut places = Vec::new();
        let mut offset = 0;
        for signal in &self.header.signals {
            if signal.kind == SignalKind::Annotations && signal.samples_per_record > 0 {
                places.push((offset, signal.record_bytes()));
            }
            offset += signal.record_bytes();
        }
        places
    }

    fn record_annotations(
        &mut self,
        record: u64,
        places: &[(u64, u64)],
    ) -> Result<RecordAnnotations, RecordingError> {
        let mut found = RecordAnnotations::default();
        for &(offset, length) in places {
            self.raw.resize(in_memory(length), 0);
            let at = self.header.data_start + record * self.record_bytes + offset;
            read_at(&mut *self.source, at, &mut self.raw)?;
            found.add(&self.raw);
        }
        Ok(found)
    }

    pub(crate) fn warn_once(&mut self, warning: Warning) {
        if !self.header.warnings.contains(&warning) {
            self.header.warnings.push(warning);
        }
    }
}
