//! What the readers and the virtual ADC promise, on files written here and on real ones.
#![allow(
    clippy::float_cmp,
    reason = "values that a header scales by powers of two come back exactly"
)]

mod adc;
mod edf_writer;
mod gdf_record_count;
mod gdf_writer;
mod lying_headers;
mod real_files;
mod written_edf;
mod written_gdf;

use std::io::Cursor;

use recordings::{Block, Recording, RecordingError};

/// Opens bytes as if they were a file.
fn open(bytes: Vec<u8>) -> Result<Recording, RecordingError> {
    Recording::from_source(Cursor::new(bytes))
}

/// All samples of all signals, each in its own unit.
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
