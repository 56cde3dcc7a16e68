//! Chart of electrode signals over time, before encoding and after decoding.

use std::path::Path;

use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use crate::canvas::{self, Area, Drawn, FAINT, GRID, INK, PictureError, RESULT, SOURCE, real};

/// The signal of one electrode before encoding and after decoding.
#[derive(Debug, Clone)]
pub struct Trace {
    /// Name of the electrode, such as "Cz".
    pub label: String,
    /// Signal before encoding, after filters and decimation, uV.
    pub source_uv: Vec<f32>,
    /// Signal after decoding, uV; as many values as `source_uv`.
    pub result_uv: Vec<f32>,
}

/// Chart of the signals of several electrodes, one below the other, on one time axis.
#[derive(Debug, Clone)]
pub struct Traces {
    /// Electrodes from top to bottom; at least one, all with the same number of values.
    pub rows: Vec<Trace>,
    /// Sampling rate of the signals, Hz.
    pub rate_hz: f64,
    /// Time from the moment that `since` names to the first value, s.
    pub start_s: f64,
    /// Moment from which time is counted, such as "the device's start".
    pub since: String,
    /// Name of the decoded signal in the legend, such as "decoded from 128 int8 per 62.5 ms".
    pub result: String,
    /// Line below the title, such as the number of electrodes and the reconstruction error.
    pub subtitle: String,
}

const SIZE: (u32, u32) = (1200, 820);
const LEFT: i32 = 86;
const RIGHT: i32 = 96;

impl Traces {
    /// Writes the chart as an SVG file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn draw(&self, path: &Path) -> Result<(), PictureError> {
        let heading = ["EEG after the filters, and decoded", &self.subtitle];
        canvas::page(path, SIZE, heading, |area| self.draw_on(area))
    }

    fn draw_on(&self, area: &Area) -> Drawn {
        let spacing = self.spacing_uv();
        let count = real(self.rows.len());
        let lengths = self.rows.iter().map(|trace| trace.source_uv.len());
        let end_s = self.start_s + real(lengths.max().unwrap_or(0)) / self.rate_hz;
        let right = i32::try_from(area.dim_in_pixel().0).unwrap_or(i32::MAX);
        let source = format!("filtered, {} Hz (reference)", self.rate_hz);
        for (x, color, label) in
            [(right - 610, SOURCE, &source), (right - 320, RESULT, &self.result)]
        {
            canvas::legend(area, (x, 6), color, label)?;
        }

        let mut chart = canvas::chart(area, [22, LEFT, RIGHT], 0)
            .build_cartesian_2d(self.start_s..end_s, (0.3 - count) * spacing..0.7 * spacing)?;
        chart
            .configure_mesh()
            .disable_y_mesh()
            .light_line_style(WHITE)
            .bold_line_style(GRID)
            .axis_style(FAINT)
            .x_labels(11)
            .x_label_formatter(&|seconds| format!("{seconds:.1}"))
            .x_desc(format!("time since {} (s)", self.since))
            .label_style(canvas::text(15, INK))
            .axis_desc_style(canvas::text(16, INK))
            .draw()?;
        for (row, trace) in self.rows.iter().enumerate() {
            let zero = -real(row) * spacing;
            let point = |(index, uv): (usize, &f32)| {
                let seconds = self.start_s + real(index) / self.rate_hz;
                (seconds, zero + f64::from(*uv))
            };
            let zero_line = vec![(self.start_s, zero), (end_s, zero)];
            chart.draw_series([PathElement::new(zero_line, GRID)])?;
            for (values, color) in
                [(&trace.source_uv, SOURCE.mix(0.85)), (&trace.result_uv, RESULT.to_rgba())]
            {
                let line: Vec<(f64, f64)> = values.iter().enumerate().map(point).collect();
                chart.draw_series([PathElement::new(line, color.stroke_width(2))])?;
            }
            let (_, y) = canvas::inside(area, chart.backend_coord(&(self.start_s, zero)));
            let style = canvas::anchored(17, INK, HPos::Right);
            area.draw(&Text::new(trace.label.clone(), (LEFT - 14, y), style))?;
        }

        // One scale bar, next to the lowest trace, is enough: all traces have the same scale.
        let bar_uv = scale_bar_uv(spacing);
        let lowest = (1.0 - count) * spacing;
        let [base, top] = [-0.5, 0.5].map(|part| {
            let end = chart.backend_coord(&(end_s, lowest + part * bar_uv));
            let (x, y) = canvas::inside(area, end);
            (x + 16, y)
        });
        area.draw(&PathElement::new([base, top], INK.stroke_width(3)))?;
        let place = (base.0 + 10, i32::midpoint(base.1, top.1));
        let style = canvas::anchored(16, INK, HPos::Left);
        area.draw(&Text::new(format!("{bar_uv:.0} µV"), place, style))
    }

    /// Returns the distance between the zero lines of adjacent traces, uV: twice the 99th
    /// percentile of the magnitudes before encoding.
    fn spacing_uv(&self) -> f64 {
        let values = self.rows.iter().flat_map(|trace| &trace.source_uv);
        let mut sizes: Vec<f32> = values.map(|uv| uv.abs()).collect();
        sizes.sort_by(f32::total_cmp);
        let high = sizes.get(sizes.len() * 99 / 100).copied().unwrap_or(1.0);
        (2.0 * f64::from(high)).max(1.0)
    }
}

/// Returns the largest of 1, 2, 5, 10, 20, 50, .. uV that is at most 60 % of `spacing`, uV.
fn scale_bar_uv(spacing: f64) -> f64 {
    let limit = 0.6 * spacing;
    let decade = 10_f64.powf(limit.log10().floor());
    let mut bars = [5.0, 2.0].into_iter().map(|multiple| multiple * decade);
    bars.find(|bar| *bar <= limit).unwrap_or(decade)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scale_bar_is_a_round_number_below_the_spacing() {
        for (spacing, bar) in [(100.0, 50.0), (60.0, 20.0), (20.0, 10.0), (3.0, 1.0)] {
            assert!((scale_bar_uv(spacing) - bar).abs() < 1e-9, "{spacing}");
        }
    }
}
