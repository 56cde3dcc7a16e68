//! Writes decoded signals as arrays for numpy.

use std::{
    fs::File,
    io::{self, Write as _},
};

use link::Flags;
use recordings::npz::NpzWriter;

use super::{Signal, SignalFile};
use crate::exclusions::Exclusions;

/// Writes an NPZ file with the arrays `labels`, `rate_hz`, `group_delay_us`, `event_rows`,
/// `event_texts`, `uv` (rows x electrodes), `flags` (rows) and `excluded` (rows x electrodes, true
/// where the device filled the electrode from the others).
pub(super) struct NpzFile {
    npz: NpzWriter<File>,
    rows_per_hop: usize,
    flags: Vec<Flags>,
    rows: u64,
    electrodes: usize,
    exclusions: Exclusions,
}

impl NpzFile {
    pub(super) fn new(file: File, signal: &Signal) -> io::Result<Self> {
        let mut npz = NpzWriter::new(file);
        npz.texts("labels", signal.labels)?;
        npz.start_array("rate_hz", "'<u4'", &[])?;
        npz.write_all(&signal.rate_hz.to_le_bytes())?;
        npz.start_array("group_delay_us", "'<u4'", &[])?;
        npz.write_all(&signal.group_delay_us.to_le_bytes())?;
        let events = signal.events.len() as u64;
        npz.start_array("event_rows", "'<u8'", &[events])?;
        for event in &signal.events {
            npz.write_all(&event.rows.start.to_le_bytes())?;
        }
        let texts: Vec<&str> = signal.events.iter().map(|event| event.text.as_str()).collect();
        npz.texts("event_texts", &texts)?;
        npz.start_array("uv", "'<f4'", &[signal.rows, signal.labels.len() as u64])?;
        Ok(Self {
            npz,
            rows_per_hop: signal.rows_per_hop as usize,
            flags: Vec::new(),
            rows: signal.rows,
            electrodes: signal.labels.len(),
            exclusions: signal.exclusions.clone(),
        })
    }
}

impl SignalFile for NpzFile {
    fn write_hop(&mut self, uv: &[f32], flags: Flags) -> io::Result<()> {
        self.flags.push(flags);
        let bytes: Vec<u8> = uv.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.npz.write_all(&bytes)
    }

    fn finish(mut self: Box<Self>) -> io::Result<u64> {
        self.npz.start_array("flags", "'<u2'", &[self.rows])?;
        for flags in &self.flags {
            let bytes = flags.bits().to_le_bytes().repeat(self.rows_per_hop);
            self.npz.write_all(&bytes)?;
        }
        let shape = [self.rows, self.electrodes as u64];
        self.npz.start_array("excluded", "'|b1'", &shape)?;
        for row in 0..self.rows {
            let mask = self.exclusions.at(row);
            let excluded = (0..self.electrodes).map(|electrode| mask >> electrode & 1 == 1);
            let bytes: Vec<u8> = excluded.map(u8::from).collect();
            self.npz.write_all(&bytes)?;
        }
        self.npz.finish()?;
        Ok(0)
    }
}
