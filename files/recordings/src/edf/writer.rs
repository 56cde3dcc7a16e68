//! Writes EDF+ and BDF+ files: 16-bit or 24-bit samples at one rate, and events as annotations.
//!
//! Sources: Kemp and Olivan 2003 (EDF+), BioSemi's description of BDF.

use std::env;
use std::io::{self, Seek, SeekFrom, Write};
use std::ops::Range;

use jiff::tz::TimeZone;

use crate::edf::date::LocalStart;
use crate::header::{FileToWrite, SignalToWrite, invalid};
use crate::signal::Calibration;

/// Byte offset of the number of records in the header.
const RECORDS_AT: u64 = 236;
/// Largest number of records that the header's field of 8 digits can state.
const MAX_RECORDS: u64 = 99_999_999;
/// Length in bytes of the time stamp at the start of each record's annotations: `+`, 16 digits with
/// a point, and the bytes 0x14, 0x14, 0.
const TIME_STAMP: usize = 20;

/// An annotation to write: the range of its rows (a row is one sample of each signal), and its
/// text. An empty range means an instant; the annotation then has no duration.
pub type RowAnnotation = (Range<u64>, String);

/// The properties in which EDF+ and BDF+ differ.
#[derive(Debug, Clone, Copy)]
struct Variant {
    /// Length of a sample in bytes.
    bytes: usize,
    /// Smallest and largest integer that a sample can store.
    digital: [f64; 2],
    /// First eight bytes of the file, which identify the format.
    magic: [u8; 8],
    /// Name of the format, which is part of the header and of the annotation signal's label.
    name: &'static str,
}

const EDF: Variant =
    Variant { bytes: 2, digital: [-32_768.0, 32_767.0], magic: *b"0       ", name: "EDF" };
const BDF: Variant =
    Variant { bytes: 3, digital: [-8_388_608.0, 8_388_607.0], magic: *b"\xffBIOSEMI", name: "BDF" };

/// Writes an EDF+ or BDF+ file record by record. A signal's range is mapped to integers of 16 or 24
/// bits. Values are rounded, and values outside the range are clipped to it.
#[derive(Debug)]
pub struct EdfWriter<W> {
    out: W,
    variant: Variant,
    /// Calibration of each signal except the annotation signal.
    lines: Vec<Calibration>,
    rows_per_record: usize,
    rate_hz: u32,
    /// Length in bytes of the annotation signal in a record, a multiple of the sample length.
    annotation_bytes: usize,
    /// Annotations that are not yet written, each with the index of its record, in reverse order,
    /// so that the next annotation can be popped.
    annotations: Vec<(u64, RowAnnotation)>,
    records: u64,
    record: Vec<u8>,
}

impl<W: Write + Seek> EdfWriter<W> {
    /// Writes the header of an EDF+ file with `rows` rows. `annotations` must be in the order of
    /// their first rows; annotations after the last row go into the last record.
    ///
    /// # Errors
    /// `InvalidInput` if the file does not fit the format; otherwise the operating system's error.
    pub fn edf(
        out: W,
        file: &FileToWrite,
        rows: u64,
        annotations: Vec<RowAnnotation>,
    ) -> io::Result<EdfWriter<W>> {
        Self::new(EDF, out, file, rows, annotations)
    }

    /// Writes the header of a BDF+ file; arguments as in [`Self::edf`].
    ///
    /// # Errors
    /// The errors of [`Self::edf`].
    pub fn bdf(
        out: W,
        file: &FileToWrite,
        rows: u64,
        annotations: Vec<RowAnnotation>,
    ) -> io::Result<EdfWriter<W>> {
        Self::new(BDF, out, file, rows, annotations)
    }

    fn new(
        variant: Variant,
        mut out: W,
        file: &FileToWrite,
        rows: u64,
        annotations: Vec<RowAnnotation>,
    ) -> io::Result<EdfWriter<W>> {
        let [least, most] = variant.digital;
        let fits = |signal: &SignalToWrite| {
            !signal.is_integer || (signal.range[0] >= least && signal.range[1] <= most)
        };
        if variant.bytes == EDF.bytes && !file.signals.iter().all(fits) {
            return Err(invalid(
                "an EDF+ file holds integers of 16 bits with their sign; choose BDF",
            ));
        }
        let rows_per_record = u64::from(file.rows_per_record.max(1));
        let record_of = |row: u64| row.min(rows.saturating_sub(1)) / rows_per_record;
        let annotations = annotations.into_iter();
        let mut annotations: Vec<_> = annotations.map(|of| (record_of(of.0.start), of)).collect();
        let in_record = annotations.chunk_by(|a, b| a.0 == b.0).map(|of| {
            let lists = of.iter().map(|(_, of)| list(of, file.rate_hz).len());
            lists.sum::<usize>()
        });
        let annotation_bytes =
            (TIME_STAMP + in_record.max().unwrap_or(0)).next_multiple_of(variant.bytes);
        annotations.reverse();
        let lines = file.signals.iter().map(|signal| calibration(signal, variant));
        let lines: Vec<Calibration> = lines.collect::<io::Result<_>>()?;
        let samples = annotation_bytes / variant.bytes;
        out.write_all(&header(variant, file, &lines, samples)?)?;
        Ok(EdfWriter {
            out,
            variant,
            lines,
            rows_per_record: file.rows_per_record as usize,
            rate_hz: file.rate_hz,
            annotation_bytes,
            annotations,
            records: 0,
            record: Vec::new(),
        })
    }

    /// Writes one record. `rows` holds the values of all signals in the first row, then in the
    /// second row, and so on.
    ///
    /// # Errors
    /// `InvalidInput` if `rows` is not exactly one record, or if the format allows no further
    /// record; otherwise the operating system's error.
    pub fn write_record(&mut self, rows: &[f32]) -> io::Result<()> {
        let signals = self.lines.len();
        if rows.len() != signals * self.rows_per_record {
            return Err(invalid("a record has another number of values"));
        }
        self.record.clear();
        for (signal, line) in self.lines.iter().enumerate() {
            for value in rows.iter().skip(signal).step_by(signals) {
                let [least, most] = line.digital;
                let digital = (f64::from(*value) - line.physical[0]) / line.gain() + least;
                #[expect(clippy::cast_possible_truncation, reason = "clamped to the range")]
                let digital = digital.round().clamp(least, most) as i32;
                self.record.extend(&digital.to_le_bytes()[..self.variant.bytes]);
            }
        }
        let end = self.record.len() + self.annotation_bytes;
        let first_row = self.records * self.rows_per_record as u64;
        let start = onset(first_row, self.rate_hz);
        self.record.extend(format!("+{start}\x14\x14\0").bytes());
        let records = self.records;
        while let Some((_, annotation)) = self.annotations.pop_if(|(record, _)| *record == records)
        {
            self.record.extend(list(&annotation, self.rate_hz));
        }
        if self.records >= MAX_RECORDS || self.record.len() > end {
            return Err(invalid(
                "a file of EDF+ or BDF+ has at most 99,999,999 records, none of which starts later than 10^8 s (3 years) \
                 after the first; choose another format, such as GDF",
            ));
        }
        self.record.resize(end, 0);
        self.records += 1;
        self.out.write_all(&self.record)
    }

    /// Writes the number of records into the header and returns the output.
    ///
    /// # Errors
    /// The operating system's error.
    pub fn finish(mut self) -> io::Result<W> {
        self.out.seek(SeekFrom::Start(RECORDS_AT))?;
        let records = self.records;
        self.out.write_all(format!("{records:<8}").as_bytes())?;
        self.out.flush()?;
        Ok(self.out)
    }
}

/// Returns the calibration that a reader of the file will compute. It differs a little from the
/// signal's range, because the header states the ends of the range in at most 8 characters.
///
/// # Errors
/// `InvalidInput` if the range is not finite, or if its ends, written in 8 characters, are equal.
fn calibration(signal: &SignalToWrite, variant: Variant) -> io::Result<Calibration> {
    let [least, most] = signal.range;
    let [least, most] = if least < most { [least, most] } else { [least - 1.0, least + 1.0] };
    let physical = [least, most].map(|end| number(end).parse().unwrap_or(f64::NAN));
    let digital = if signal.is_integer { [least, most] } else { variant.digital };
    Calibration::new(digital, physical).ok_or_else(|| {
        invalid("the ends of a signal's range are finite, and differ within 8 characters")
    })
}

/// Formats a number with as many decimal places as fit into 8 characters.
fn number(value: f64) -> String {
    let texts = (0..8).rev().map(|digits| format!("{value:.digits$}"));
    let mut fitting = texts.filter(|text| text.len() <= 8);
    fitting.next().unwrap_or_else(|| "99999999".to_owned())
}

/// Returns the time of a row as text, in seconds since the start of the file.
fn onset(row: u64, rate_hz: u32) -> String {
    let rate_hz = u64::from(rate_hz.max(1));
    let (whole, rest) = (row / rate_hz, row % rate_hz);
    format!("{whole}.{:07}", rest * 10_000_000 / rate_hz)
}

/// Encodes an annotation as a time-stamped annotation list.
fn list((rows, text): &RowAnnotation, rate_hz: u32) -> Vec<u8> {
    // The bytes 0x14, 0x15 and 0 separate the parts of a list, and MNE and edfio skip texts that
    // contain a line feed.
    let text = text.replace(char::is_control, " ");
    let start = onset(rows.start, rate_hz);
    let stamp = if rows.is_empty() {
        start
    } else {
        format!("{start}\x15{}", onset(rows.end - rows.start, rate_hz))
    };
    format!("+{stamp}\x14{text}\x14\0").into_bytes()
}

/// Returns the time zone that the variable `TZ` names; if `TZ` is not set, this machine's zone, or
/// UTC if it has none.
fn zone() -> io::Result<TimeZone> {
    match TimeZone::try_system() {
        Err(_) if env::var_os("TZ").is_some_and(|zone| !zone.is_empty()) => Err(invalid(
            "the time zone that the variable TZ names is not known; set TZ to UTC0 or to a zone of \
             /usr/share/zoneinfo, or install tzdata",
        )),
        zone => Ok(zone.unwrap_or(TimeZone::UTC)),
    }
}

fn header(
    variant: Variant,
    file: &FileToWrite,
    lines: &[Calibration],
    annotation_samples: usize,
) -> io::Result<Vec<u8>> {
    file.check()?;
    let duration = f64::from(file.rows_per_record) / f64::from(file.rate_hz);
    let duration = duration.to_string();
    if file.signals.len() > 9_998 || duration.len() > 8 {
        return Err(invalid(
            "a file of EDF+ or BDF+ holds at most 9,998 signals, and records whose duration has 8 digits",
        ));
    }
    let signals = file.signals.len() + 1;
    let zone = match file.start_ns {
        Some(_) => zone()?,
        None => TimeZone::UTC,
    };
    let date = LocalStart::new(file.start_ns, &zone);
    let mut bytes = variant.magic.to_vec();
    let mut field = |text: &str, length: usize| {
        let ascii = text.chars().filter(char::is_ascii).take(length);
        let text: String = ascii.collect();
        bytes.extend(format!("{text:length$}").bytes());
    };
    field("X X X X", 80);
    let device = file.description.replace(' ', "_");
    field(&format!("Startdate {} X X {device}", date.long_date()), 80);
    field(&date.short_date(), 8);
    field(&date.time(), 8);
    field(&(256 * (signals + 1)).to_string(), 8);
    let name = variant.name;
    field(&format!("{name}+C"), 44);
    field("-1", 8);
    field(&duration, 8);
    field(&signals.to_string(), 4);
    let mut fields = |length: usize, last: &str, of: &dyn Fn(usize) -> String| {
        (0..signals - 1).for_each(|signal| field(&of(signal), length));
        field(last, length);
    };
    fields(16, &format!("{name} Annotations"), &|signal| file.signals[signal].label.clone());
    fields(80, "", &|_| String::new());
    fields(8, "", &|signal| file.signals[signal].unit().to_owned());
    fields(8, "-1", &|signal| number(lines[signal].physical[0]));
    fields(8, "1", &|signal| number(lines[signal].physical[1]));
    let [least, most] = variant.digital.map(|end| end.to_string());
    fields(8, &least, &|signal| lines[signal].digital[0].to_string());
    fields(8, &most, &|signal| lines[signal].digital[1].to_string());
    fields(80, "", &|_| String::new());
    fields(8, &annotation_samples.to_string(), &|_| file.rows_per_record.to_string());
    fields(32, "", &|_| String::new());
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::{EdfWriter, MAX_RECORDS};
    use crate::header::FileToWrite;

    #[test]
    fn a_record_beyond_the_limit_of_the_format_is_refused_with_advice() {
        let file = FileToWrite::microvolts(["Cz"], [-1.0, 1.0], 1, 1);
        let mut writer = EdfWriter::bdf(Cursor::new(Vec::new()), &file, 1, Vec::new()).unwrap();
        writer.records = MAX_RECORDS - 1;
        writer.write_record(&[0.0]).unwrap();
        let error = writer.write_record(&[0.0]).unwrap_err().to_string();
        assert!(error.contains("10^8 s") && error.contains("GDF"), "{error}");
    }
}
