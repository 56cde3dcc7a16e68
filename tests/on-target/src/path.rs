//! The whole pipeline, with the filters as they were compiled for the model.

use model::CODE;
use pipeline::{Code, Mains};

use crate::{Device, Mismatch, mismatch::same, signal};

/// Numbers of a code beside its values.
const NUMBERS: usize = 8;

/// The codes of [`signal::samples`] from rest, one after the other, in every field. Numbers and values count
/// through all codes.
pub(crate) fn check(device: &mut Device, mains: Mains, codes: &[Code]) -> Result<(), Mismatch> {
    device.acquisition.restart(mains);
    device.encoder.restart();
    let mut made = signal::samples().filter_map(|sample| {
        let step = device.acquisition.process_sample(&sample)?;
        device.encoder.encode_step(&step)
    });
    for (index, expected) in codes.iter().enumerate() {
        // Samples do not end, so that there is a next code.
        let Some(code) = made.next() else {
            return same("codes", &[1], &[0]);
        };
        same("numbers", &numbers(expected), &numbers(&code))
            .map_err(|mismatch| mismatch.behind(NUMBERS * index))?;
        same("values", &expected.values.levels(), &code.values.levels())
            .map_err(|mismatch| mismatch.behind(CODE * index))?;
    }
    Ok(())
}

/// Window, first sample, offset, clipped inputs, clipped values, settling, then saturated in two halves,
/// the lower first.
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
