//! Histogram of values that were counted in equal bins.

use std::path::Path;

use plotters::prelude::*;

use crate::canvas::{self, Area, Drawn, FAINT, GRID, INK, PictureError, SOURCE, real};

/// Shares of values in bins of equal width.
#[derive(Debug, Clone, PartialEq)]
pub struct Histogram {
    /// Lower end of the first bin and upper end of the last one.
    pub range: [f64; 2],
    /// Number of values in each bin; at least one bin.
    pub counts: Vec<u64>,
    /// Line of the title.
    pub title: String,
    /// Line below the title.
    pub subtitle: String,
    /// Description of the x axis.
    pub x: String,
}

const SIZE: (u32, u32) = (900, 480);

impl Histogram {
    /// Writes the histogram as an SVG file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn draw(&self, path: &Path) -> Result<(), PictureError> {
        canvas::page(path, SIZE, [&self.title, &self.subtitle], |area| {
            self.draw_on(area)
        })
    }

    fn draw_on(&self, area: &Area) -> Drawn {
        let [low, high] = self.range;
        let width = (high - low) / real(self.counts.len());
        let total: u64 = self.counts.iter().sum();
        #[expect(clippy::cast_precision_loss, reason = "far fewer than 2^52 values")]
        let percent = |count: &u64| 100.0 * *count as f64 / total.max(1) as f64;
        let top = 1.08 * self.counts.iter().map(percent).fold(0.1, f64::max);
        let mut chart =
            canvas::chart(area, [16, 20, 36], 66).build_cartesian_2d(low..high, 0.0..top)?;
        chart
            .configure_mesh()
            .disable_x_mesh()
            .light_line_style(WHITE)
            .bold_line_style(GRID)
            .axis_style(FAINT)
            .x_labels(9)
            .x_label_formatter(&|level| format!("{level:.0}"))
            .y_labels(6)
            .y_label_formatter(&|percent| format!("{percent:.1}"))
            .x_desc(&self.x)
            .y_desc("share of the values (%)")
            .label_style(canvas::text(15, INK))
            .axis_desc_style(canvas::text(16, INK))
            .draw()?;
        for (bin, count) in self
            .counts
            .iter()
            .enumerate()
            .filter(|(_, count)| **count > 0)
        {
            let left = low + real(bin) * width;
            let corners = [(left, 0.0), (left + width, percent(count))];
            chart.draw_series([Rectangle::new(corners, SOURCE.mix(0.75).filled())])?;
        }
        Ok(())
    }
}
