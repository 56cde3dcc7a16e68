//! Tests of the readers and the virtual ADC with synthetic and real files.
#![allow(
    clippy::float_cmp,
    reason = "values that a header scales by powers of two are exact"
)]

mod edf_file;
mod gdf_file;
mod gdf_record_count;
mod live_adc;
mod mutated_files;
mod real_files;
mod synthetic_edf;
mod synthetic_gdf;
mod virtual_adc;
mod written_edf;
mod written_gdf;

use std::io::Cursor;

use recordings::{Block, Recording, RecordingError};

/// Opens a recording in memory.
fn open(bytes: Vec<u8>) -> Result<Recording, RecordingError> {
    Recording::from_source(Cursor::new(bytes))
}

/// Reads all samples of all signals, each in the signal's unit.
fn read_all(recording: &mut Recording) -> Vec<Vec<f64>> {
    let mut all = vec![Vec::new(); recording.signals().len()];
    let mut block = Block::default();
    while recording.read_block(&mut block).expect("readable") {
        for (all, part) in all.iter_mut().zip(&block.samples) {
            all.extend_from_slice(part);
        }
    }
    all
}
