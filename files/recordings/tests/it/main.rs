//! Tests the readers and the virtual ADC with synthetic and real files.
#![allow(clippy::float_cmp, reason = "values that a header scales by powers of two are exact")]

/// Asserts that a file is refused with an error that matches `$error`.
macro_rules! assert_refused {
    ($bytes:expr, $error:pat) => {
        let error = crate::open($bytes).err().expect("refused");
        assert!(matches!(error, $error), "{error}");
    };
}

mod any_header;
mod defects;
mod files;
mod live_adc;
mod real_files;
mod synthetic_edf;
mod synthetic_gdf;
mod virtual_adc;
mod written;

use std::io::Cursor;

use recordings::{
    AdcSpec, Block, Event, EventLabel, Missing, MontageMap, Recording, RecordingError, VirtualAdc,
};

/// Opens a recording from the bytes of its file.
fn open(bytes: Vec<u8>) -> Result<Recording, RecordingError> {
    Recording::from_source(Cursor::new(bytes))
}

/// Returns an event that concerns all signals.
fn event(onset_s: f64, duration_s: Option<f64>, label: EventLabel) -> Event {
    Event { onset_s, duration_s, signal: None, label }
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

/// Returns a virtual ADC that plays a recording on the electrodes of a montage, at 512 Hz and with
/// the scale of an ADS1299.
fn played(recording: Recording, montage: &[&str], missing: Missing) -> VirtualAdc {
    let map = MontageMap::new(&recording.labels(), montage, missing).expect("a montage");
    VirtualAdc::new(recording, &map, AdcSpec::ads1299(512)).expect("usable rates")
}
