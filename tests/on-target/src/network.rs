//! The built-in network: what lies in flash, and what it makes of the artifact's golden windows.

use core::hint::black_box;

use model::{CODE, NETWORK, NETWORK_CHECKSUM};
use pipeline::{Encoder, Step};

use crate::{Mismatch, golden, mismatch::same};

/// The sum over the network as the compiler has it, against that of the flash.
pub(crate) fn check_sum() -> Result<(), Mismatch> {
    // The compiler knows the answer, the flash need not.
    same(
        "sum",
        &[NETWORK_CHECKSUM],
        &[black_box(&NETWORK).checksum()],
    )
}

/// Each window alone, as model-gen's batch reference has encoded it. Values count through all codes.
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
            same("values", expected, &code.values.levels())
                .map_err(|mismatch| mismatch.behind(CODE * made))?;
            made += 1;
        }
    }
    let made = u32::try_from(made).unwrap_or(u32::MAX);
    same("codes", &[golden::WINDOWS_IN_ALL], &[made])
}
