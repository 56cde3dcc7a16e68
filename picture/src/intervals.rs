//! Histogram of the time between codes, with the result of a published paper as a curve.

use std::path::Path;

use plotters::prelude::*;

use crate::canvas::{self, Area, Drawn, FAINT, GRID, INK, PictureError, REFERENCE, RESULT, SOURCE};
use crate::spread::Spread;

/// Intervals between the codes of the paper's node on a PC, ms (arXiv 2008.13485, interval
/// histogram).
const PAPER_MS: Spread = Spread {
    mean: 62.499,
    sd: 0.227,
};

/// Intervals between the codes of one run, to be drawn as a histogram.
#[derive(Debug, Clone)]
pub struct Intervals {
    /// Times between the arrivals of successive codes at the subscriber, ms of the host's clock.
    pub arrival_ms: Vec<f64>,
    /// Differences between the device's time stamps of successive codes, ms of the device's clock.
    pub device_ms: Vec<f64>,
    /// Line below the title, such as the number of codes and the path they took.
    pub subtitle: String,
}

const SIZE: (u32, u32) = (1200, 700);
const BINS: u16 = 80;

impl Intervals {
    /// Writes the chart as an SVG file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn draw(&self, path: &Path) -> Result<(), PictureError> {
        let heading = ["Time between two codes", &self.subtitle];
        canvas::page(path, SIZE, heading, |area| self.draw_on(area))
    }

    fn draw_on(&self, area: &Area) -> Drawn {
        let spread = Spread::from_values(&self.arrival_ms);
        // Wide enough for the paper's curve and nearly all intervals of this run; the legend states how many
        // intervals are outside.
        let reach = (4.0 * spread.sd).clamp(4.0 * PAPER_MS.sd, 6.0);
        let (low, high) = (62.5 - reach, 62.5 + reach);
        let width = (high - low) / f64::from(BINS);
        let mut bins = [0_u32; BINS as usize];
        let mut outside = 0;
        for ms in &self.arrival_ms {
            let bin = (0..BINS).find(|bin| *ms >= low && *ms < low + f64::from(bin + 1) * width);
            match bin {
                Some(bin) => bins[usize::from(bin)] += 1,
                None => outside += 1,
            }
        }
        let inside: u32 = bins.iter().sum();
        let paper = |ms: f64| PAPER_MS.density(ms) * width * f64::from(inside);
        let counts = bins.iter().copied().map(f64::from);
        let top = 1.08 * counts.fold(paper(PAPER_MS.mean), f64::max);

        let mut chart =
            canvas::chart(area, [58, 20, 36], 66).build_cartesian_2d(low..high, 0.0..top)?;
        chart
            .configure_mesh()
            .disable_x_mesh()
            .light_line_style(WHITE)
            .bold_line_style(GRID)
            .axis_style(FAINT)
            .x_labels(9)
            .x_label_formatter(&|ms| format!("{ms:.2}"))
            .y_labels(7)
            .y_label_formatter(&|count| format!("{count:.0}"))
            .x_desc("interval (ms)")
            .y_desc(format!("intervals per {width:.3} ms"))
            .label_style(canvas::text(15, INK))
            .axis_desc_style(canvas::text(16, INK))
            .draw()?;
        for (bin, count) in (0..BINS).zip(bins).filter(|(_, count)| *count > 0) {
            let left = low + f64::from(bin) * width;
            let corners = [(left, 0.0), (left + width, f64::from(count))];
            chart.draw_series([Rectangle::new(corners, SOURCE.mix(0.75).filled())])?;
        }
        let curve = (0..=400).map(|point| low + (high - low) * f64::from(point) / 400.0);
        let curve: Vec<(f64, f64)> = curve.map(|ms| (ms, paper(ms))).collect();
        chart.draw_series([PathElement::new(curve, REFERENCE.stroke_width(3))])?;
        let device = Spread::from_values(&self.device_ms);
        let dashes = (0..36).map(|dash| {
            let start = f64::from(dash) / 36.0 * top;
            let line = vec![(device.mean, start), (device.mean, start + top / 72.0)];
            PathElement::new(line, RESULT.stroke_width(3))
        });
        chart.draw_series(dashes)?;

        let arrival = format!("arrival at the subscriber: {spread} ms, {outside} beyond the axis");
        let device = format!("device stamps: {device} ms");
        let paper = format!("the paper's node on a PC: {PAPER_MS} ms, as a normal curve");
        canvas::legend(area, (90, 6), SOURCE, &arrival)?;
        canvas::legend(area, (90, 32), RESULT, &device)?;
        canvas::legend(area, (620, 6), REFERENCE, &paper)
    }
}
