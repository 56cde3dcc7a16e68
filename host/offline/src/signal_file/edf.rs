//! Decoded signals as an EDF+ or BDF+ file.

use std::{
    fs::File,
    io::{self, BufWriter},
};

use link::Flags;
use recordings::{EdfWriter, FileToWrite, RowAnnotation, SignalToWrite};

use super::{Signal, SignalFile};

/// Range of an EDF file, uV: 16 bits of 0.1 uV.
const EDF_RANGE_UV: [f64; 2] = [-3_276.8, 3_276.7];
/// Start of the signal, nanoseconds since 1970: 1 January 1985, the first day that EDF can state. A
/// file of codes does not state when it was recorded.
const START_NS: i64 = 473_385_600_000_000_000;

/// Writes one record for each hop.
pub(super) struct EdfFile {
    writer: EdfWriter<BufWriter<File>>,
    range_uv: [f64; 2],
    limited: u64,
}

impl EdfFile {
    pub(super) fn edf(file: File, signal: &Signal) -> io::Result<Self> {
        let (to_write, annotations) = describe(signal, EDF_RANGE_UV);
        let writer = EdfWriter::edf(BufWriter::new(file), &to_write, signal.rows, annotations)?;
        Ok(Self {
            writer,
            range_uv: EDF_RANGE_UV,
            limited: 0,
        })
    }

    pub(super) fn bdf(file: File, signal: &Signal) -> io::Result<Self> {
        let full_scale_uv = f64::from(signal.full_scale_uv);
        let range_uv = [-full_scale_uv, full_scale_uv];
        let (to_write, annotations) = describe(signal, range_uv);
        let writer = EdfWriter::bdf(BufWriter::new(file), &to_write, signal.rows, annotations)?;
        Ok(Self {
            writer,
            range_uv,
            limited: 0,
        })
    }
}

impl SignalFile for EdfFile {
    fn write_hop(&mut self, uv: &[f32], _: Flags) -> io::Result<()> {
        let [least, most] = self.range_uv;
        let beyond = uv.iter().map(|value| f64::from(*value));
        let beyond = beyond.filter(|value| !(least..=most).contains(value));
        self.limited += beyond.count() as u64;
        self.writer.write_record(uv)
    }

    fn finish(self: Box<Self>) -> io::Result<u64> {
        self.writer.finish()?;
        Ok(self.limited)
    }
}

fn describe(signal: &Signal, range: [f64; 2]) -> (FileToWrite, Vec<RowAnnotation>) {
    let events = signal.events.iter();
    let annotations = events.map(|event| (event.row, event.text.clone()));
    (file_to_write(signal, range), annotations.collect())
}

/// Describes a file of electrodes.
pub(super) fn file_to_write(signal: &Signal, range: [f64; 2]) -> FileToWrite {
    let signals = signal.labels.iter().map(|label| SignalToWrite {
        label: label.clone(),
        is_microvolt: true,
        is_integer: false,
        range,
    });
    FileToWrite {
        signals: signals.collect(),
        rate_hz: signal.rate_hz,
        rows_per_record: signal.rows_per_hop,
        start_ns: START_NS,
        description: signal.description.clone(),
    }
}
