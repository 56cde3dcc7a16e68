//! What every format's header comes down to, and the pieces both header parsers share.

use crate::{Format, Ratio, RecordingError, Signal, SignalKind, Warning};

/// Bytes of the fixed part and of each signal's part, the same in EDF, BDF and GDF.
pub(crate) const HEADER_BLOCK: usize = 256;

/// Everything that a header says about its file.
#[derive(Debug, Clone)]
pub(crate) struct Header {
    pub(crate) format: Format,
    pub(crate) signals: Vec<Signal>,
    /// Byte offset of the first record.
    pub(crate) data_start: u64,
    /// `None` when the header says -1.
    pub(crate) records: Option<u64>,
    /// Length of a record, s; `None` when it is 0 (files of annotations alone).
    pub(crate) record_duration: Option<Ratio>,
    pub(crate) warnings: Vec<Warning>,
}

impl Header {
    /// Bytes of one record, < 2^51.
    pub(crate) fn record_bytes(&self) -> u64 {
        self.signals.iter().map(Signal::record_bytes).sum()
    }

    /// Rate of the fastest signal, Hz, >= 1.
    pub(crate) fn fastest_rate_hz(&self) -> f64 {
        let rates = self.signals.iter().filter_map(|signal| signal.rate);
        rates.map(Ratio::value).fold(1.0, f64::max)
    }

    /// Checks what no format may get wrong and notes what it may.
    ///
    /// # Errors
    /// [`RecordingError::Range`] for a signal that cannot be scaled,
    /// [`RecordingError::HeaderField`] when samples have no rate.
    pub(crate) fn checked(mut self) -> Result<Self, RecordingError> {
        let mut unknown_units = Vec::new();
        for signal in &mut self.signals {
            if signal.kind == SignalKind::Annotations {
                continue;
            }
            let line = &mut signal.calibration;
            if !line.is_usable() {
                return Err(RecordingError::Range {
                    label: signal.label.clone(),
                    digital_min: line.digital_min,
                    digital_max: line.digital_max,
                    physical_min: line.physical_min,
                    physical_max: line.physical_max,
                });
            }
            #[expect(clippy::float_cmp, reason = "equal as stored means an empty range")]
            if line.physical_min == line.physical_max {
                let label = signal.label.clone();
                self.warnings.push(Warning::PhysicalRangeEmpty { label });
                (line.physical_min, line.physical_max) = (line.digital_min, line.digital_max);
            }
            if signal.samples_per_record > 0 && signal.rate.is_none() {
                return Err(RecordingError::HeaderField {
                    field: "duration of a record",
                    place: "the file".to_owned(),
                    found: "0".to_owned(),
                    reason: "signals with samples need a length > 0",
                });
            }
            if signal.unit.microvolts().is_none() {
                unknown_units.push(format!("{} {}", signal.label, unit_in_brackets(signal)));
            }
        }
        if !unknown_units.is_empty() {
            self.warnings.push(Warning::UnitUnknown {
                signals: unknown_units,
            });
        }
        Ok(self)
    }
}

fn unit_in_brackets(signal: &Signal) -> String {
    let text = signal.unit.to_string();
    if text.starts_with('(') {
        text
    } else {
        format!("({text})")
    }
}

/// The per-signal part of a header: fields follow each other, each for all signals.
pub(crate) struct SignalFields<'a> {
    bytes: &'a [u8],
    signals: usize,
    at: usize,
}

impl<'a> SignalFields<'a> {
    /// `header` is the whole header, fixed part included.
    pub(crate) fn new(header: &'a [u8], signals: usize) -> Self {
        Self {
            bytes: header,
            signals,
            at: HEADER_BLOCK,
        }
    }

    /// The next field, `width` bytes wide, of every signal.
    pub(crate) fn next(&mut self, width: usize) -> Vec<&'a [u8]> {
        let start = self.at;
        self.at += width * self.signals;
        let field = self.bytes.get(start..self.at).unwrap_or_default();
        field.chunks_exact(width).collect()
    }
}

/// Header text without padding; bytes that are no UTF-8 are read as Latin-1.
pub(crate) fn text(bytes: &[u8]) -> String {
    let text = match std::str::from_utf8(bytes) {
        Ok(text) => text.to_owned(),
        Err(_) => bytes.iter().map(|&byte| char::from(byte)).collect(),
    };
    // GDF pads with zeros, and what follows the first one is rubbish in some files.
    text.split('\0')
        .next()
        .unwrap_or_default()
        .trim()
        .to_owned()
}

/// `N` bytes at `at`; zeros where the slice ends before, which callers rule out by length.
pub(crate) fn array_at<const N: usize>(bytes: &[u8], at: usize) -> [u8; N] {
    bytes
        .get(at..)
        .and_then(|rest| rest.first_chunk())
        .copied()
        .unwrap_or([0; N])
}
