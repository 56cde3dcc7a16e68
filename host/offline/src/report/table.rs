//! The errors of all electrodes as comma-separated values.

use std::fmt::Write as _;

use artifact::Description;

use super::entry::Entry;
use picture::csv_field::field;

/// Returns one line for each recording and electrode.
pub(super) fn electrodes(description: &Description, entries: &[Entry]) -> String {
    let mut text = "recording,electrode,origin,steps,mse,mse_uv2,prd_percent\n".to_owned();
    let unit = description.input.sd_uv.powi(2);
    for entry in entries {
        let Some(comparison) = entry.compared() else {
            continue;
        };
        let labels = description.montage.electrodes.iter();
        let errors = comparison.electrodes.iter().zip(&comparison.origins);
        for (label, (error, origin)) in labels.zip(errors) {
            let mse_uv2 = comparison.mse_uv2(*error, 1);
            // Writing to a string never fails.
            let _ = writeln!(
                text,
                "{},{label},{origin},{},{},{mse_uv2},{}",
                field(&entry.name),
                comparison.steps,
                mse_uv2 / unit,
                error.prd_percent()
            );
        }
    }
    text
}
