//! Checks the pipeline with the built-in model: checksums in flash, codes, packed blocks.

use core::hint::black_box;

use model::{CODE, NETWORK, NETWORK_CHECKSUM};
use pipeline::{Acquisition, Code, Encoder, FeatureExtractor, Mains, Step};
#[cfg(not(feature = "f446"))]
use {
    model::{PACKED, PACKED_CHECKSUM},
    pipeline::{PackedEncoder, Rate},
};

use crate::{
    golden,
    mismatch::{Mismatch, expect_equal},
    signal,
};

/// State of the whole pipeline; it is too large for a stack.
#[derive(Debug)]
pub struct Device {
    pub(crate) acquisition: Acquisition,
    pub(crate) encoder: Encoder<'static>,
    pub(crate) features: FeatureExtractor,
    #[cfg(not(feature = "f446"))]
    pub(crate) packed: PackedEncoder,
}

impl Device {
    /// Creates the state as it is before the first sample.
    pub const fn new() -> Self {
        Self {
            acquisition: Acquisition::new(Mains::Hz50),
            encoder: Encoder::new(),
            features: FeatureExtractor::NEW,
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

/// Checks the network in flash against its checksum from the build.
pub(crate) fn check_network_sum() -> Result<(), Mismatch> {
    // `black_box` hides the network's contents from the compiler, so the compiled code must read
    // the flash.
    expect_equal("sum", &[NETWORK_CHECKSUM], &[black_box(&NETWORK).checksum()])
}

/// Encodes each golden window with a restarted encoder and compares the code with the code of
/// model-gen's batch reference. The index of a mismatch counts values from the first code on.
pub(crate) fn check_windows(encoder: &mut Encoder<'static>) -> Result<(), Mismatch> {
    let mut made = 0;
    for (window, expected) in golden::WINDOWS.iter().zip(&golden::WINDOW_CODES) {
        encoder.restart();
        let mut code = None;
        for &plane in window {
            code = encoder.encode_step(&Step { plane, ..Step::default() });
        }
        if let Some(code) = code {
            expect_equal("values", expected, &code.values.levels())
                .map_err(|mismatch| mismatch.offset_by(CODE * made))?;
            made += 1;
        }
    }
    let made = u32::try_from(made).unwrap_or(u32::MAX);
    expect_equal("codes", &[golden::WINDOWS_IN_ALL], &[made])
}

/// Number of integers into which [`numbers`] turns a code.
const NUMBERS: usize = 8;

/// Restarts the device and compares its codes for [`signal::samples`] with `codes`, in every field.
/// The index of a mismatch counts fields, or values, from the first code on.
pub(crate) fn check(device: &mut Device, mains: Mains, codes: &[Code]) -> Result<(), Mismatch> {
    device.acquisition.restart(mains);
    device.encoder.restart();
    let mut made = signal::samples().filter_map(|sample| {
        let step = device.acquisition.process_sample(&sample)?;
        device.encoder.encode_step(&step)
    });
    for (index, expected) in codes.iter().enumerate() {
        // Never executed: the samples are endless.
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
/// clipped values, settling, and the saturated channels as two 32-bit masks, the lower channels
/// first.
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

/// Restarts the device and compares its features for [`signal::samples`] with the golden ones. The
/// index of a mismatch counts levels from the first hop on.
pub(crate) fn check_features(device: &mut Device) -> Result<(), Mismatch> {
    device.acquisition.restart(Mains::Hz50);
    device.features.restart();
    device.features.set_filters(signal::filters());
    let mut samples = signal::samples();
    for (hop, expected) in golden::FEATURES.iter().enumerate() {
        let made = samples.find_map(|sample| {
            let step = device.acquisition.process_sample(&sample)?;
            device.features.add_step(&step)
        });
        let made = made.as_ref().map_or(&[][..], |features| features.levels());
        expect_equal("levels", expected, made)
            .map_err(|mismatch| mismatch.offset_by(expected.len() * hop))?;
    }
    Ok(())
}

/// Checks the packed model in flash against its checksum from the build.
#[cfg(not(feature = "f446"))]
pub(crate) fn check_packed_sum() -> Result<(), Mismatch> {
    let read = black_box(&PACKED).as_ref().map(model::Packed::checksum);
    let [expected, read] = [PACKED_CHECKSUM, read].map(Option::unwrap_or_default);
    expect_equal("sum", &[expected], &[read])
}

/// Restarts the device and compares its packed blocks for [`signal::samples`], and then its state,
/// with the golden ones. The rates 0 to 15 are used in turn, one for each block. The index of a
/// mismatch counts bytes from the first block on.
#[cfg(not(feature = "f446"))]
pub(crate) fn check_blocks(device: &mut Device) -> Result<(), Mismatch> {
    device.acquisition.restart(Mains::Hz50);
    device.packed.restart();
    let mut samples = signal::samples();
    let mut bytes = 0;
    for (index, expected) in (0_u8..).zip(&golden::BLOCKS) {
        device.packed.set_rate(Rate::new(index % 16).unwrap_or(Rate::MIDDLE));
        let block = samples.find_map(|sample| {
            let step = device.acquisition.process_sample(&sample)?;
            device.packed.encode_step(&step)
        });
        // There is always a block, because the samples are endless.
        let made = block.as_ref().map_or(&[][..], |block| block.bytes());
        expect_equal("bytes", expected, made).map_err(|mismatch| mismatch.offset_by(bytes))?;
        bytes += made.len();
    }
    expect_equal("state", &golden::PACKED_STATE, device.packed.state())
}
