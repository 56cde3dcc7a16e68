//! Electrodes over time, what went in and what came back.

use std::path::Path;

use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::canvas::{self, Area, Drawn, FAINT, GRID, INK, PictureError, RESULT, SOURCE};

/// One electrode's signal, twice.
#[derive(Debug, Clone)]
pub(crate) struct Trace {
    /// Electrode.
    pub(crate) label: String,
    /// After filters and decimation, uV.
    pub(crate) source_uv: Vec<f32>,
    /// Decoded from the codes, uV; as many values.
    pub(crate) result_uv: Vec<f32>,
}

/// Traces below each other on one time axis.
#[derive(Debug, Clone)]
pub(crate) struct Traces {
    /// The electrodes, from top to bottom; at least one, all equally long.
    pub(crate) rows: Vec<Trace>,
    /// Samples per second, Hz.
    pub(crate) rate_hz: f64,
    /// Time of the first value since the device's start, seconds.
    pub(crate) begin_s: f64,
    /// One line under the title.
    pub(crate) subtitle: String,
}

const SIZE: (u32, u32) = (1200, 820);
const LEFT: i32 = 86;
const RIGHT: i32 = 96;

impl Traces {
    /// Writes the picture.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(crate) fn draw(&self, path: &Path) -> Result<(), PictureError> {
        let title = "EEG after the filters, and decoded from the codes";
        canvas::page(path, SIZE, [title, &self.subtitle], |area| {
            self.draw_on(area)
        })
    }

    fn draw_on(&self, area: &Area) -> Drawn {
        let spacing = self.spacing_uv();
        let count = cast(self.rows.len());
        let steps = self
            .rows
            .iter()
            .map(|trace| trace.source_uv.len())
            .max()
            .unwrap_or(0);
        let end_s = self.begin_s + cast(steps) / self.rate_hz;
        let (width, _) = area.dim_in_pixel();
        let right = i32::try_from(width).unwrap_or(i32::MAX);
        canvas::legend(
            area,
            (right - 610, 6),
            SOURCE,
            "filtered, 128 Hz (reference)",
        )?;
        canvas::legend(
            area,
            (right - 320, 6),
            RESULT,
            "decoded from 128 int8 per 62.5 ms",
        )?;

        let mut chart = ChartBuilder::on(area)
            .margin_top(22)
            .margin_right(RIGHT)
            .margin_left(LEFT)
            .margin_bottom(16)
            .x_label_area_size(52)
            .build_cartesian_2d(self.begin_s..end_s, (0.3 - count) * spacing..0.7 * spacing)?;
        chart
            .configure_mesh()
            .disable_y_mesh()
            .light_line_style(WHITE)
            .bold_line_style(GRID)
            .axis_style(FAINT)
            .x_labels(11)
            .x_label_formatter(&|seconds| format!("{seconds:.1}"))
            .x_desc("time since the device's start (s)")
            .label_style(canvas::text(15, INK))
            .axis_desc_style(canvas::text(16, INK))
            .draw()?;
        for (row, trace) in self.rows.iter().enumerate() {
            let zero = -cast(row) * spacing;
            let line = |values: &[f32]| -> Vec<(f64, f64)> {
                let point = |(step, uv): (usize, &f32)| {
                    (
                        self.begin_s + cast(step) / self.rate_hz,
                        zero + f64::from(*uv),
                    )
                };
                values.iter().enumerate().map(point).collect()
            };
            let zero_line = vec![(self.begin_s, zero), (end_s, zero)];
            chart.draw_series([PathElement::new(zero_line, GRID)])?;
            let source = SOURCE.mix(0.85).stroke_width(2);
            chart.draw_series([PathElement::new(line(&trace.source_uv), source)])?;
            let result = RESULT.stroke_width(2);
            chart.draw_series([PathElement::new(line(&trace.result_uv), result)])?;
            let (_, y) = chart.backend_coord(&(self.begin_s, zero));
            let at = (LEFT - 14, y - area_top(area));
            let label = Text::new(
                trace.label.clone(),
                at,
                canvas::anchored(17, INK, HPos::Right),
            );
            area.draw(&label)?;
        }

        // The vertical scale, once, as a bar: every trace has the same.
        let bar_uv = scale_bar_uv(spacing);
        let base = chart.backend_coord(&(end_s, -(count - 1.0) * spacing - bar_uv / 2.0));
        let top = chart.backend_coord(&(end_s, -(count - 1.0) * spacing + bar_uv / 2.0));
        let offset = area_top(area);
        let (x, base, top) = (base.0 + 16, base.1 - offset, top.1 - offset);
        area.draw(&PathElement::new(
            vec![(x, base), (x, top)],
            INK.stroke_width(3),
        ))?;
        let words = format!("{bar_uv:.0} µV");
        area.draw(&Text::new(
            words,
            (x + 10, i32::midpoint(base, top)),
            canvas::anchored(16, INK, HPos::Left),
        ))
    }

    /// Distance of two zero lines, uV: what nearly all values stay within.
    fn spacing_uv(&self) -> f64 {
        let mut sizes: Vec<f32> = self
            .rows
            .iter()
            .flat_map(|trace| &trace.source_uv)
            .map(|uv| uv.abs())
            .collect();
        sizes.sort_by(f32::total_cmp);
        let high = sizes.get(sizes.len() * 99 / 100).copied().unwrap_or(1.0);
        (2.0 * f64::from(high)).max(1.0)
    }
}

/// The largest of 1, 2, 5, 10, 20, 50, .. uV that is no more than 60 % of the spacing.
fn scale_bar_uv(spacing: f64) -> f64 {
    let limit = 0.6 * spacing;
    let decade = 10_f64.powf(limit.log10().floor());
    [5.0, 2.0]
        .into_iter()
        .map(|step| step * decade)
        .find(|bar| *bar <= limit)
        .unwrap_or(decade)
}

/// Pixel row of the area's top in the page: charts answer in the page's pixels, areas draw in their own.
fn area_top(area: &Area) -> i32 {
    area.get_base_pixel().1
}

fn cast(count: usize) -> f64 {
    f64::from(u32::try_from(count).unwrap_or(u32::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scale_bar_is_a_round_number_below_the_spacing() {
        assert!((scale_bar_uv(100.0) - 50.0).abs() < 1e-9);
        assert!((scale_bar_uv(60.0) - 20.0).abs() < 1e-9);
        assert!((scale_bar_uv(20.0) - 10.0).abs() < 1e-9);
        assert!((scale_bar_uv(3.0) - 1.0).abs() < 1e-9);
    }
}
