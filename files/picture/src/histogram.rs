//! Histogram of values, counted in bins of equal width.

use std::path::Path;

use crate::canvas::{self, Area, Drawn, PictureError};

/// A histogram. Each bar shows the share of all values that lie in its bin.
#[derive(Debug, Clone, PartialEq)]
pub struct Histogram {
    /// Lower end of the first bin and upper end of the last bin.
    pub range: [f64; 2],
    /// Number of values in each bin; there must be at least one bin.
    pub counts: Vec<u64>,
    /// Title of the picture, in one line.
    pub title: String,
    /// Line below the title, such as the number of values.
    pub subtitle: String,
    /// Quantity and unit that label the x axis.
    pub x: String,
}

const SIZE: (u32, u32) = (900, 480);

impl Histogram {
    /// Writes the histogram as an SVG file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn draw(&self, path: &Path) -> Result<(), PictureError> {
        canvas::page(path, SIZE, [&self.title, &self.subtitle], |area| self.draw_on(area))
    }

    fn draw_on(&self, area: &Area) -> Drawn {
        let total: u64 = self.counts.iter().sum();
        #[expect(clippy::cast_precision_loss, reason = "far fewer than 2^52 values")]
        let percent = |count: &u64| 100.0 * *count as f64 / total.max(1) as f64;
        let shares: Vec<f64> = self.counts.iter().map(percent).collect();
        let highest = 1.08 * shares.iter().copied().fold(0.1, f64::max);
        let labels = [(self.x.as_str(), 0), ("share of the values (%)", 1)];
        canvas::bars(area, 16, self.range, highest, &shares, labels)?;
        Ok(())
    }
}
