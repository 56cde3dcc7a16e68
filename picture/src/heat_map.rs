//! Chart of codes over time: one row per component of the code, one column per code.

use std::path::Path;

use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use crate::canvas::{self, Area, Drawn, FAINT, INK, PictureError, real};
use crate::spread::Spread;

/// Codes of one run, in the order of their windows.
#[derive(Debug, Clone)]
pub struct HeatMap {
    /// Dequantised codes, 128 values each; `None` is a lost code.
    pub codes: Vec<Option<Vec<f32>>>,
    /// Time of the first code since the device's start, s.
    pub start_s: f64,
    /// Time between two codes, s.
    pub interval_s: f64,
    /// Number of codes at the start that were made before the filters had settled.
    pub settling: usize,
    /// Text in one line below the title.
    pub subtitle: String,
}

const SIZE: (u32, u32) = (1200, 860);
/// Number of colours for deviations of both signs; odd, so that zero has a colour of its own.
const LEVELS: i16 = 21;
/// Deviation from a component's mean that gets the strongest colour, SDs.
const REACH: f64 = 2.5;
/// Colour of a lost code.
const ABSENT: RGBColor = RGBColor(0xbd, 0xc4, 0xcc);

impl HeatMap {
    /// Writes the chart as an SVG file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn draw(&self, path: &Path) -> Result<(), PictureError> {
        let title = "The codes: 128 numbers every 62.5 ms";
        canvas::page(path, SIZE, [title, &self.subtitle], |area| {
            self.draw_on(area)
        })
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
            // Adjacent codes with the same level share a rectangle, which makes the file a third
            // smaller.
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

    /// Returns the level of a component in every code, or `None` for a lost code.
    ///
    /// A level is the deviation from the component's mean in the component's SDs, because the
    /// scales of the components differ a hundredfold. Mean and SD are those of the codes after
    /// settling.
    fn levels(&self, component: usize) -> Vec<Option<i16>> {
        let value = |code: &Vec<f32>| code.get(component).copied().map(f64::from);
        let settled = self.codes.get(self.settling..).unwrap_or_default();
        let settled = if settled.is_empty() {
            &self.codes
        } else {
            settled
        };
        let seen: Vec<f64> = settled.iter().flatten().filter_map(value).collect();
        let Spread { mean, sd } = Spread::from_values(&seen);
        let level = |x: f64| level_of(if sd > 0.0 { (x - mean) / sd } else { 0.0 });
        let codes = self.codes.iter();
        codes
            .map(|code| code.as_ref().and_then(value).map(level))
            .collect()
    }
}

fn draw_scale(area: &Area) -> Drawn {
    let (top, bottom, left, right) = (60_i32, 560_i32, 14_i32, 34_i32);
    let height = f64::from(bottom - top) / f64::from(LEVELS);
    let row = |level: i16| -> i32 {
        #[expect(
            clippy::cast_possible_truncation,
            reason = "a row of a page: below 10 000"
        )]
        let row = (f64::from(top) + f64::from(level) * height).round() as i32;
        row
    };
    for level in 0..LEVELS {
        let corners = [(left, row(level)), (right, row(level + 1))];
        let color = color_of(LEVELS - 1 - level);
        area.draw(&Rectangle::new(corners, color.filled()))?;
    }
    area.draw(&Rectangle::new([(left, top), (right, bottom)], FAINT))?;
    let label = canvas::anchored(15, INK, HPos::Left);
    for (text, y) in [
        (format!("+{REACH} SD"), top),
        ("mean".to_owned(), i32::midpoint(top, bottom)),
        (format!("−{REACH} SD"), bottom),
    ] {
        area.draw(&Text::new(text, (right + 8, y), label.clone()))?;
    }
    let lost = [(left, bottom + 30), (right, bottom + 50)];
    area.draw(&Rectangle::new(lost, ABSENT.filled()))?;
    area.draw(&Text::new("lost", (right + 8, bottom + 40), label))
}

fn level_of(deviations: f64) -> i16 {
    let half = f64::from(LEVELS - 1) / 2.0;
    let level = (deviations / REACH * half).round().clamp(-half, half) + half;
    #[expect(clippy::cast_possible_truncation, reason = "0..LEVELS after the clamp")]
    let level = level as i16;
    level
}

/// Returns the colour of a level: blue below the component's mean, white at the mean, red above it.
fn color_of(level: i16) -> RGBColor {
    let half = f64::from(LEVELS - 1) / 2.0;
    let x = (f64::from(level) - half) / half;
    let strongest = if x < 0.0 {
        [0x21, 0x5a, 0xa0]
    } else {
        [0xb8, 0x2e, 0x2e]
    };
    let [red, green, blue] = strongest.map(|channel: u8| {
        let mixed = 255.0 + (f64::from(channel) - 255.0) * x.abs();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "between the channel and 255"
        )]
        let mixed = mixed.round() as u8;
        mixed
    });
    RGBColor(red, green, blue)
}
