//! The errors of all electrodes as comma-separated values.

use std::fmt::Write as _;

use artifact::Description;

use super::entry::Entry;

/// Returns one line for each recording and electrode.
pub(super) fn electrodes(description: &Description, entries: &[Entry]) -> String {
    let mut text = "recording,electrode,origin,steps,mse,mse_uv2,prd_percent\n".to_owned();
    let unit = description.input.sd_uv.powi(2);
    for entry in entries {
        let Some(comparison) = &entry.decoded.comparison else {
            continue;
        };
        let labels = description.montage.electrodes.iter();
        let errors = comparison.electrodes.iter().zip(&comparison.measured);
        for (label, (error, measured)) in labels.zip(errors) {
            let origin = if *measured {
                "measured"
            } else {
                "interpolated"
            };
            let mse_uv2 = comparison.mse_uv2(*error, 1);
            // Writing to a string never fails.
            let _ = writeln!(
                text,
                "{},{label},{origin},{},{},{mse_uv2},{}",
                entry.name.replace(',', "_"),
                comparison.steps,
                mse_uv2 / unit,
                error.prd_percent()
            );
        }
    }
    text
}
