//! Figures of a packed model at all rates, as a table and as JSON.

use packed_fit::RateFigures;
use serde_json::{Value as Json, json};
use std::fmt;

/// Returns the figures of one rate as a JSON object.
pub(crate) fn to_json(figures: &RateFigures) -> Json {
    json!({
        "rate": figures.rate,
        "bits_per_hop": figures.bits,
        "longest_bytes": figures.longest,
        "mse": figures.mse,
        "mse_smoothed": figures.mse_smoothed,
        "band_correlation_8_13": figures.band_correlation[0],
        "band_correlation_13_30": figures.band_correlation[1],
    })
}

/// Returns the cells of a printed row: rate, bits, bytes of the longest block, both errors and both
/// correlations.
pub(crate) fn cells(figures: &RateFigures) -> [String; 7] {
    [
        figures.rate.to_string(),
        format!("{:.1}", figures.bits),
        figures.longest.to_string(),
        format!("{:.5}", figures.mse),
        format!("{:.5}", figures.mse_smoothed),
        format!("{:.3}", figures.band_correlation[0]),
        format!("{:.3}", figures.band_correlation[1]),
    ]
}

/// The figures of all rates, printed as a table.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RateTable<'f>(pub &'f [RateFigures]);

impl fmt::Display for RateTable<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "                                               MSE    correlation of power at"
        )?;
        writeln!(
            f,
            "rate   bits of a block   longest   at once   block later   8-13 Hz   13-30 Hz"
        )?;
        for figures in self.0 {
            let [rate, bits, longest, mse, later, alpha, beta] = cells(figures);
            writeln!(
                f,
                "{rate:>4} {bits:>17} {longest:>7} B {mse:>9} {later:>13} {alpha:>9} {beta:>10}"
            )?;
        }
        Ok(())
    }
}
