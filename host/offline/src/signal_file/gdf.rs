//! Decoded signals as a GDF file.

use std::{
    fs::File,
    io::{self, BufWriter},
};

use link::Flags;
use recordings::GdfWriter;

use super::edf::file_to_write;
use super::{Signal, SignalFile};

/// Writes one record for each hop; values are float32 and unchanged.
pub(super) struct GdfFile {
    writer: GdfWriter<BufWriter<File>>,
    events: Vec<(u64, u16)>,
}

impl GdfFile {
    pub(super) fn new(file: File, signal: &Signal) -> io::Result<Self> {
        let full_scale_uv = f64::from(signal.full_scale_uv);
        let to_write = file_to_write(signal, [-full_scale_uv, full_scale_uv]);
        let events = signal.events.iter().map(|event| (event.row, event.kind));
        Ok(Self {
            writer: GdfWriter::new(BufWriter::new(file), &to_write)?,
            events: events.collect(),
        })
    }
}

impl SignalFile for GdfFile {
    fn write_hop(&mut self, uv: &[f32], _: Flags) -> io::Result<()> {
        self.writer.write_record(uv)
    }

    fn finish(self: Box<Self>) -> io::Result<u64> {
        self.writer.finish(&self.events)?;
        Ok(0)
    }
}
