//! Figures of a packed model at all rates, as a table and as JSON.

use packed_fit::RateFigures;
use serde_json::{Value as Json, json};
use std::fmt;

pub(crate) fn to_json(figures: &RateFigures) -> Json {
    json!({
        "rate": figures.rate,
        "bits_per_hop": figures.bits,
        "longest_bytes": figures.longest,
        "mse": figures.mse,
        "mse_smoothed": figures.mse_smoothed,
    })
}

/// Returns the cells of a printed row: rate, bits, bytes of the longest block, and the errors
/// without and with smoothing.
pub(crate) fn cells(figures: &RateFigures) -> [String; 5] {
    [
        figures.rate.to_string(),
        format!("{:.1}", figures.bits),
        figures.longest.to_string(),
        format!("{:.5}", figures.mse),
        format!("{:.5}", figures.mse_smoothed),
    ]
}

/// The figures of all rates, printed as a table.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RateTable<'f>(pub &'f [RateFigures]);

impl fmt::Display for RateTable<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "                                               MSE")?;
        writeln!(f, "rate   bits of a block   longest   at once   block later")?;
        for figures in self.0 {
            let [rate, bits, longest, mse, later] = cells(figures);
            writeln!(f, "{rate:>4} {bits:>17} {longest:>7} B {mse:>9} {later:>13}")?;
        }
        Ok(())
    }
}
