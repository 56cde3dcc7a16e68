//! The built-in network: its checksum, and its codes for the artifact's golden windows.

use core::hint::black_box;

use model::{CODE, NETWORK, NETWORK_CHECKSUM};
use pipeline::{Encoder, Step};

use crate::{
    golden,
    mismatch::{Mismatch, expect_equal},
};

/// Compares the checksum that was computed at compile time with the checksum of the network in
/// flash.
pub(crate) fn check_sum() -> Result<(), Mismatch> {
    // `black_box` hides the network's contents from the compiler, so that the flash is read.
    expect_equal(
        "sum",
        &[NETWORK_CHECKSUM],
        &[black_box(&NETWORK).checksum()],
    )
}

/// Encodes each golden window with a restarted encoder and compares the code with that of
/// model-gen's batch reference. The index of a mismatch counts the values of all codes.
pub(crate) fn check_codes(encoder: &mut Encoder<'static>) -> Result<(), Mismatch> {
    let mut made = 0;
    for (window, expected) in golden::WINDOWS.iter().zip(&golden::WINDOW_CODES) {
        encoder.restart();
        let mut code = None;
        for &plane in window {
            code = encoder.encode_step(&Step {
                plane,
                ..Step::default()
            });
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
