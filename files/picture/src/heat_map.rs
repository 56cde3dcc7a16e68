//! Chart of codes over time: one row for each value of a code, one column for each code.

use std::path::Path;

use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use crate::canvas::{self, Area, Drawn, FAINT, INK, PictureError, real};
use crate::spread::Spread;

/// Codes of one run of the signal path, in the order of their windows.
#[derive(Debug, Clone)]
pub struct HeatMap {
    /// Dequantised codes of 128 values each; `None` stands for a lost code.
    pub codes: Vec<Option<Vec<f32>>>,
    /// Time from the device's start to the first code, s.
    pub start_s: f64,
    /// Time between two codes, s.
    pub interval_s: f64,
    /// Number of codes at the start that were made before the filters had settled.
    pub settling: usize,
    /// Line below the title, such as the numbers of received and lost codes.
    pub subtitle: String,
}

const SIZE: (u32, u32) = (1200, 860);
/// Highest colour level. Each value of a code is drawn at one of the levels -10 to 10, which
/// depends on its deviation from the mean of the same component over the codes.
const STRONGEST: i32 = 10;
/// Deviation from the mean, in standard deviations, that is drawn at the highest level.
const REACH: f64 = 2.5;
/// Colours of the lowest level, of level 0 and of the highest level; the colours of all other
/// levels are interpolated.
const COLORS: [RGBColor; 3] = [RGBColor(0x21, 0x5a, 0xa0), WHITE, RGBColor(0xb8, 0x2e, 0x2e)];
/// Colour of a lost code.
const ABSENT: RGBColor = RGBColor(0xbd, 0xc4, 0xcc);

impl HeatMap {
    /// Writes the chart as an SVG file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn draw(&self, path: &Path) -> Result<(), PictureError> {
        let heading = ["The codes: 128 numbers every 62.5 ms", &self.subtitle];
        canvas::page(path, SIZE, heading, |area| self.draw_on(area))
    }

    fn draw_on(&self, area: &Area) -> Drawn {
        let (map, scale) = area.split_horizontally(area.dim_in_pixel().0 - 120);
        let components = self.codes.iter().flatten().map(Vec::len).max().unwrap_or(1);
        let start_of = |code: usize| self.start_s + real(code) * self.interval_s;
        let end_s = start_of(self.codes.len());
        let mut chart = canvas::chart(&map, [26, 20, 10], 62)
            .build_cartesian_2d(self.start_s..end_s, real(components)..0.0)?;
        chart
            .configure_mesh()
            .disable_mesh()
            .axis_style(FAINT)
            .x_labels(11)
            .x_label_formatter(&|seconds| format!("{seconds:.1}"))
            .y_labels(9)
            .y_label_formatter(&|component| format!("{component:.0}"))
            .x_desc("time since the device's start (s)")
            .y_desc("component of the code")
            .label_style(canvas::text(15, INK))
            .axis_desc_style(canvas::text(16, INK))
            .draw()?;
        for component in 0..components {
            // One rectangle for adjacent codes with the same level makes the file a third smaller.
            let mut code = 0;
            for run in self.levels(component).chunk_by(|a, b| a == b) {
                let (left, right) = (start_of(code), start_of(code + run.len()));
                code += run.len();
                let corners = [(left, real(component)), (right, real(component + 1))];
                let color = run[0].map_or(ABSENT, color_of);
                chart.draw_series([Rectangle::new(corners, color.filled())])?;
            }
        }
        let settled_s = start_of(self.settling);
        if settled_s > self.start_s && settled_s < end_s {
            let line = vec![(settled_s, 0.0), (settled_s, real(components))];
            chart.draw_series([PathElement::new(line, INK.stroke_width(2))])?;
            let (x, y) = canvas::inside(&map, chart.backend_coord(&(settled_s, 0.0)));
            map.draw(&Text::new(
                "until here the filters settle on the electrodes' offsets",
                (x - 6, y - 12),
                canvas::anchored(15, INK, HPos::Right),
            ))?;
        }
        draw_scale(&scale)
    }

    /// Returns the colour level of value number `component` of every code; `None` for a lost code.
    ///
    /// The level is the component's deviation from its mean, in standard deviations (SD), divided
    /// by [`REACH`] / 10 and rounded. It is relative to the SD because components differ a
    /// hundredfold in size. Mean and SD are computed over the codes after settling.
    fn levels(&self, component: usize) -> Vec<Option<f64>> {
        let value = |code: &Vec<f32>| code.get(component).copied().map(f64::from);
        let settled = match self.codes.get(self.settling..) {
            Some(settled) if !settled.is_empty() => settled,
            _ => &self.codes,
        };
        let seen: Vec<f64> = settled.iter().flatten().filter_map(value).collect();
        let Spread { mean, sd } = Spread::from_values(&seen);
        let most = f64::from(STRONGEST);
        let level = |x: f64| {
            let deviation = if sd > 0.0 { (x - mean) / sd } else { 0.0 };
            (deviation / REACH * most).round().clamp(-most, most)
        };
        let levels = self.codes.iter().map(|code| code.as_ref().and_then(value).map(level));
        levels.collect()
    }
}

/// Draws the colour scale, from the highest level at the top to the lowest, and the colour of a
/// lost code.
fn draw_scale(area: &Area) -> Drawn {
    let (top, bottom, left, right) = (60, 560, 14, 34);
    let count = 2 * STRONGEST + 1;
    // Adding half of `count` before the division rounds to the nearest pixel.
    let row = |place| top + ((bottom - top) * place + count / 2) / count;
    for place in 0..count {
        let corners = [(left, row(place)), (right, row(place + 1))];
        let color = color_of(f64::from(STRONGEST - place));
        area.draw(&Rectangle::new(corners, color.filled()))?;
    }
    area.draw(&Rectangle::new([(left, top), (right, bottom)], FAINT))?;
    let lost = [(left, bottom + 30), (right, bottom + 50)];
    area.draw(&Rectangle::new(lost, ABSENT.filled()))?;
    for (text, y) in [
        (format!("+{REACH} SD"), top),
        ("mean".to_owned(), i32::midpoint(top, bottom)),
        (format!("−{REACH} SD"), bottom),
        ("lost".to_owned(), bottom + 40),
    ] {
        let style = canvas::anchored(15, INK, HPos::Left);
        area.draw(&Text::new(text, (right + 8, y), style))?;
    }
    Ok(())
}

fn color_of(level: f64) -> RGBColor {
    let most = f64::from(STRONGEST);
    DerivedColorMap::new(&COLORS).get_color_normalized(level, -most, most)
}
