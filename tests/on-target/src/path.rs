//! The whole pipeline, from samples to codes, with the model's filters.

use model::CODE;
#[cfg(not(feature = "f446"))]
use pipeline::PackedEncoder;
use pipeline::{Acquisition, Code, Encoder, Mains};

use crate::{
    mismatch::{Mismatch, expect_equal},
    signal,
};

/// State of the pipeline; too large for a stack.
#[derive(Debug)]
pub struct Device {
    pub(crate) acquisition: Acquisition,
    pub(crate) encoder: Encoder<'static>,
    #[cfg(not(feature = "f446"))]
    pub(crate) packed: PackedEncoder,
}

impl Device {
    /// Creates a device in its initial state.
    pub const fn new() -> Self {
        Self {
            acquisition: Acquisition::new(Mains::Hz50),
            encoder: Encoder::new(),
            #[cfg(not(feature = "f446"))]
            packed: PackedEncoder::new(),
        }
    }
}

impl Default for Device {
    fn default() -> Self {
        Self::new()
    }
}

/// Number of integers that [`numbers`] returns for a code.
const NUMBERS: usize = 8;

/// Restarts the device and compares its codes for [`signal::samples`] with `codes`, in every field.
/// The index of a mismatch counts the numbers or values of all codes.
pub(crate) fn check(device: &mut Device, mains: Mains, codes: &[Code]) -> Result<(), Mismatch> {
    device.acquisition.restart(mains);
    device.encoder.restart();
    let mut made = signal::samples().filter_map(|sample| {
        let step = device.acquisition.process_sample(&sample)?;
        device.encoder.encode_step(&step)
    });
    for (index, expected) in codes.iter().enumerate() {
        // Not reached: the samples are endless.
        let Some(code) = made.next() else {
            return expect_equal("codes", &[1], &[0]);
        };
        expect_equal("numbers", &numbers(expected), &numbers(&code))
            .map_err(|mismatch| mismatch.offset_by(NUMBERS * index))?;
        expect_equal("values", &expected.values.levels(), &code.values.levels())
            .map_err(|mismatch| mismatch.offset_by(CODE * index))?;
    }
    Ok(())
}

/// Returns all fields of a code except its values: window, first sample, offset, clipped inputs,
/// clipped values, settling, and the bits of the saturated channels, 0 to 31 and 32 to 63.
fn numbers(code: &Code) -> [i64; NUMBERS] {
    let half =
        |shift: u32| i64::from(u32::try_from(code.saturated >> shift & 0xffff_ffff).unwrap_or(0));
    [
        code.window.into(),
        i64::try_from(code.first_sample).unwrap_or(i64::MAX),
        code.offset_us.into(),
        code.clipped.into(),
        code.clipped_values.into(),
        code.settling.into(),
        half(0),
        half(32),
    ]
}
