//! Headers of recordings: of files to read, in a form common to all formats, and of files to write.
//! Also contains parsing functions that the EDF and GDF readers share.

use std::io;

use crate::{
    edf,
    error::RecordingError,
    format::Format,
    gdf,
    ratio::Ratio,
    signal::{Calibration, SampleType, Signal, SignalKind, UnusableRange},
    source::{Source, in_memory, read_at},
    warning::Warning,
};

/// Length in bytes of a header's fixed part, and of its part for each signal (EDF, BDF and GDF).
pub(crate) const HEADER_BLOCK: usize = 256;

#[derive(Debug, Clone)]
pub(crate) struct Header {
    pub(crate) format: Format,
    pub(crate) signals: Vec<Signal>,
    /// Byte offset of the first record in the file.
    pub(crate) data_start: u64,
    /// Number of records that the header states; `None` if it states -1 or 0, which mean unknown.
    pub(crate) records: Option<u64>,
    /// Duration of a record, s; `None` if it is 0, as in files that contain annotations only.
    pub(crate) record_duration: Option<Ratio>,
    pub(crate) warnings: Vec<Warning>,
}

impl Header {
    /// Returns the length of one record in bytes, < 2^51.
    pub(crate) fn record_bytes(&self) -> u64 {
        self.signals.iter().map(Signal::record_bytes).sum()
    }

    /// Returns the duration of `records` records together, s.
    #[expect(clippy::cast_precision_loss, reason = "records stay below 2^53")]
    pub(crate) fn seconds(&self, records: u64) -> f64 {
        let length = self.record_duration.map_or(0.0, Ratio::value);
        length * records as f64
    }

    /// Returns the highest sampling rate of all signals, Hz; 1 if all rates are lower.
    pub(crate) fn fastest_rate_hz(&self) -> f64 {
        let rates = self.signals.iter().filter_map(|signal| signal.rate);
        rates.map(Ratio::value).fold(1.0, f64::max)
    }

    /// Checks what every format requires, and adds warnings for defects that do not prevent
    /// reading.
    ///
    /// # Errors
    /// [`RecordingError::Range`] if no signal with samples can be scaled,
    /// [`RecordingError::HeaderField`] if a signal has samples but a record has no duration.
    pub(crate) fn checked(mut self) -> Result<Self, RecordingError> {
        let mut unusable = Vec::new();
        let mut unknown_units = Vec::new();
        let signals = self.signals.iter();
        let with_samples = signals.filter(|signal| signal.kind == SignalKind::Samples);
        let is_bdf = matches!(
            self.format,
            Format::Bdf | Format::BdfPlusContinuous | Format::BdfPlusDiscontinuous
        );
        let mut triggers = with_samples.clone().filter(|signal| is_bdf && signal.label == "Status");
        if let Some(signal) = triggers.next() {
            let label = signal.label.clone();
            self.warnings.push(Warning::Triggers { label });
        }
        for signal in with_samples.clone() {
            if let Err(range) = &signal.calibration {
                unusable.push((signal.label.clone(), range.clone()));
                continue;
            }
            if signal.samples_per_record > 0 && signal.rate.is_none() {
                let reason = "signals with samples need a length > 0";
                return Err(field_error("duration of a record", "the file", "0", reason));
            }
            if signal.unit.microvolts().is_none() {
                let unit = signal.unit.to_string();
                // `Unit` prints a missing unit as `(none)`; all other units get brackets here.
                let is_bare = !unit.starts_with('(');
                let unit = if is_bare { format!("({unit})") } else { unit };
                unknown_units.push(format!("{} {unit}", signal.label));
            }
        }
        if !unusable.is_empty() {
            if unusable.len() == with_samples.count() {
                let (label, range) = unusable.remove(0);
                return Err(RecordingError::Range { label, range });
            }
            let signals = unusable.into_iter();
            let signals = signals.map(|(label, range)| format!("{label} ({range})"));
            self.warnings.push(Warning::Unusable { signals: signals.collect() });
        }
        if !unknown_units.is_empty() {
            self.warnings.push(Warning::UnitUnknown { signals: unknown_units });
        }
        Ok(self)
    }
}

/// Returns the calibration of a signal with these ranges, and adds warnings for doubtful ranges.
/// `stated` returns the digital and the physical range as the header states them.
///
/// # Errors
/// [`UnusableRange`] if the digital range is empty, or an end is not finite.
pub(crate) fn calibration(
    label: &str,
    sample_type: SampleType,
    [digital, mut physical]: [[f64; 2]; 2],
    stated: impl FnOnce() -> [[String; 2]; 2],
    warnings: &mut Vec<Warning>,
) -> Result<Calibration, UnusableRange> {
    #[expect(clippy::float_cmp, reason = "equal as stored means an empty range")]
    let is_empty = physical[0] == physical[1];
    if is_empty || sample_type.is_whole_range(digital, physical) {
        physical = digital;
    }
    let Some(line) = Calibration::new(digital, physical) else {
        return Err(UnusableRange::new(stated()));
    };
    if is_empty {
        let label = label.to_owned();
        warnings.push(Warning::PhysicalRangeEmpty { label });
    }
    if digital[0] > digital[1] {
        let label = label.to_owned();
        warnings.push(Warning::DigitalRangeReversed { label });
    }
    Ok(line)
}

/// Returns the sampling rate of a signal, Hz; `None` if the signal has no samples or the record has
/// no duration.
pub(crate) fn sampling_rate(samples_per_record: u32, duration: Option<Ratio>) -> Option<Ratio> {
    let duration = duration?;
    Ratio::new(u64::from(samples_per_record) * duration.denominator(), duration.numerator())
}

/// Reads the header fields of the signals. A header stores them field by field: the first field of
/// all signals, then the second field of all signals, and so on.
pub(crate) struct SignalFields<'a> {
    bytes: &'a [u8],
    signals: usize,
    at: usize,
}

impl<'a> SignalFields<'a> {
    /// Starts at the first field of the signals. `header` is the whole header, including the fixed
    /// part before the signals.
    pub(crate) fn new(header: &'a [u8], signals: usize) -> Self {
        Self { bytes: header, signals, at: HEADER_BLOCK }
    }

    /// Returns the next header field of every signal; the field is `width` bytes wide.
    pub(crate) fn next_field(&mut self, width: usize) -> Vec<&'a [u8]> {
        let start = self.at;
        self.at += width * self.signals;
        let field = self.bytes.get(start..self.at).unwrap_or_default();
        field.chunks_exact(width).collect()
    }

    /// Returns physical minimum, physical maximum, digital minimum and digital maximum, 8 bytes
    /// each, of every signal.
    pub(crate) fn next_ranges(&mut self) -> [Vec<&'a [u8]>; 4] {
        [(); 4].map(|()| self.next_field(8))
    }
}

/// Characters of the bytes 0x80..=0x9f in Windows-1252. Five bytes are undefined; their characters
/// have the byte's value as code. Source: WHATWG, "Encoding", index windows-1252.
const WINDOWS_1252: [char; 32] = [
    '€', '\u{81}', '‚', 'ƒ', '„', '…', '†', '‡', 'ˆ', '‰', 'Š', '‹', 'Œ', '\u{8d}', 'Ž', '\u{8f}',
    '\u{90}', '‘', '’', '“', '”', '•', '–', '—', '˜', '™', 'š', '›', 'œ', '\u{9d}', 'ž', 'Ÿ',
];

/// Decodes text as UTF-8, or as Windows-1252 if it is not valid UTF-8.
pub(crate) fn decoded(bytes: &[u8]) -> String {
    let character = |&byte: &u8| match byte {
        0x80..=0x9f => WINDOWS_1252[usize::from(byte - 0x80)],
        _ => char::from(byte),
    };
    match std::str::from_utf8(bytes) {
        Ok(text) => text.to_owned(),
        Err(_) => bytes.iter().map(character).collect(),
    }
}

/// Decodes text of a header and removes its padding.
pub(crate) fn text(bytes: &[u8]) -> String {
    // GDF pads text with zeros; in some files, uninitialised bytes follow the first zero.
    let end = bytes.iter().position(|&byte| byte == 0);
    decoded(&bytes[..end.unwrap_or(bytes.len())]).trim().to_owned()
}

/// Returns the `N` bytes at offset `at`. Callers must check the length: if `bytes` ends before all
/// `N` bytes, the result is zeros.
pub(crate) fn array_at<const N: usize>(bytes: &[u8], at: usize) -> [u8; N] {
    bytes.get(at..).and_then(|rest| rest.first_chunk()).copied().unwrap_or([0; N])
}

/// Returns the error for a header field that holds `found`; `place` is the field's file or signal.
pub(crate) fn field_error(
    field: &'static str,
    place: &str,
    found: &str,
    reason: &'static str,
) -> RecordingError {
    RecordingError::HeaderField { field, place: place.to_owned(), found: found.to_owned(), reason }
}

/// Converts the number of records that a header states; `None` for -1 or 0, which programs write
/// before they know the number.
///
/// # Errors
/// [`RecordingError::HeaderField`] for any other negative number.
pub(crate) fn record_count(stated: i64) -> Result<Option<u64>, RecordingError> {
    if matches!(stated, -1 | 0) {
        return Ok(None);
    }
    let count = u64::try_from(stated).map_err(|_| {
        let found = stated.to_string();
        field_error("number of records", "the file", &found, "it is negative")
    })?;
    Ok(Some(count))
}

/// Converts the duration of a record that a header states, s; `None` if it is 0.
///
/// # Errors
/// [`RecordingError::HeaderField`] if it is neither 0 nor between 1e-9 and 1e9 s.
pub(crate) fn record_duration(seconds: f64) -> Result<Option<Ratio>, RecordingError> {
    let duration = Ratio::from_f64(seconds);
    if duration.is_none() && seconds != 0.0 {
        let reason = "it must be 0 or between 1e-9 and 1e9 s";
        let found = format!("{seconds:e}");
        return Err(field_error("duration of a record", "the file", &found, reason));
    }
    Ok(duration)
}

/// Recognises the format of a file of `file_bytes` bytes and reads its header.
///
/// # Errors
/// [`RecordingError`] if the file is empty, has no known format, or its header cannot be used.
pub(crate) fn read(source: &mut dyn Source, file_bytes: u64) -> Result<Header, RecordingError> {
    let enough = |needed: u64| {
        if file_bytes < needed {
            Err(RecordingError::HeaderTruncated { needed, found: file_bytes })
        } else {
            Ok(())
        }
    };
    if file_bytes == 0 {
        return Err(RecordingError::Empty);
    }
    let mut magic = [0; 8];
    let length = in_memory(file_bytes).min(magic.len());
    read_at(source, 0, &mut magic[..length])?;
    let known = Format::detect(magic);
    let mut fixed = [0; HEADER_BLOCK];
    if known.is_ok() || file_bytes >= HEADER_BLOCK as u64 {
        enough(HEADER_BLOCK as u64)?;
        read_at(source, 0, &mut fixed)?;
    }
    let is_other_version = known.is_err() && edf::is_other_version(&fixed);
    let format = if is_other_version { Format::Edf } else { known? };
    let is_gdf = matches!(format, Format::Gdf1(_) | Format::Gdf2(_));
    let signals =
        if is_gdf { gdf::signal_count(format, &fixed)? } else { edf::signal_count(&fixed)? };
    // At most 65,536 blocks of 256 bytes. `enough` checks that the file contains them, so a damaged
    // header cannot cause a large allocation.
    let header_bytes = HEADER_BLOCK * (1 + signals);
    enough(header_bytes as u64)?;
    let mut bytes = vec![0; header_bytes];
    read_at(source, 0, &mut bytes)?;
    let mut header = if is_gdf {
        gdf::parse(format, &bytes, signals)?
    } else {
        edf::parse(format, &bytes, signals)?
    };
    enough(header.data_start)?;
    if is_other_version {
        let found = text(&magic);
        header.warnings.push(Warning::Version { found });
    }
    Ok(header)
}

/// Header of one signal of a file to write.
#[derive(Debug, Clone, PartialEq)]
pub struct SignalToWrite {
    /// Label, at most 16 bytes; the rest of a longer label is cut off.
    pub label: String,
    /// True if the values are microvolts, false if they have no unit.
    pub is_microvolt: bool,
    /// True if all values are signed integers of at most 24 bits.
    pub is_integer: bool,
    /// Smallest and largest value that the signal can have.
    pub range: [f64; 2],
}

impl SignalToWrite {
    /// Returns the unit as the header states it; empty for a signal without a unit.
    pub(crate) fn unit(&self) -> &'static str {
        if self.is_microvolt { "uV" } else { "" }
    }
}

/// Content of the header of a file to write.
#[derive(Debug, Clone, PartialEq)]
pub struct FileToWrite {
    /// All signals, in the order of the values in a row.
    pub signals: Vec<SignalToWrite>,
    /// Sampling rate of all signals, Hz.
    pub rate_hz: u32,
    /// Number of rows (samples of each signal) in a record.
    pub rows_per_record: u32,
    /// Wall-clock time of the first row, nanoseconds since 1970, UTC; `None` if it is unknown. EDF
    /// and BDF files state it in the time zone of this machine, as EDF+ requires.
    pub start_ns: Option<i64>,
    /// Text that identifies the recording, such as the device's name.
    pub description: String,
}

impl FileToWrite {
    /// Describes a file of signals in microvolts within `range`, without a start or a description.
    pub fn microvolts(
        labels: impl IntoIterator<Item = impl Into<String>>,
        range: [f64; 2],
        rate_hz: u32,
        rows_per_record: u32,
    ) -> Self {
        let signals = labels.into_iter().map(|label| SignalToWrite {
            label: label.into(),
            is_microvolt: true,
            is_integer: false,
            range,
        });
        Self {
            signals: signals.collect(),
            rate_hz,
            rows_per_record,
            start_ns: None,
            description: String::new(),
        }
    }

    /// Checks what every format requires of a file.
    ///
    /// # Errors
    /// `InvalidInput` if a record has no rows or the rate is 0.
    pub(crate) fn check(&self) -> io::Result<()> {
        if self.rows_per_record == 0 || self.rate_hz == 0 {
            return Err(invalid("a record has rows, and a signal has a rate"));
        }
        Ok(())
    }
}

/// Returns the error of a writer for content that its file format cannot store.
pub(crate) fn invalid(what: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, what)
}
