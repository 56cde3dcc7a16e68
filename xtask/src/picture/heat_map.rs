//! The codes over time: 128 components, one column per code.

use std::path::Path;

use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::canvas::{self, Area, Drawn, FAINT, INK, PictureError};
use crate::spread::Spread;

/// Codes in the order of their windows.
#[derive(Debug, Clone)]
pub(crate) struct HeatMap {
    /// Dequantised codes, 128 values each; `None` is a lost one.
    pub(crate) codes: Vec<Option<Vec<f32>>>,
    /// Time of the first code since the device's start, seconds.
    pub(crate) begin_s: f64,
    /// Distance of two codes, seconds.
    pub(crate) interval_s: f64,
    /// Codes at the beginning that were made before the filters had settled.
    pub(crate) settling: usize,
    /// One line under the title.
    pub(crate) subtitle: String,
}

const SIZE: (u32, u32) = (1200, 860);
/// Colours of the scale, both signs; odd, so that zero has one of its own.
const LEVELS: i16 = 21;
/// Deviation that gets the strongest colour, in SDs.
const REACH: f64 = 2.5;
/// A lost code.
const ABSENT: RGBColor = RGBColor(0xbd, 0xc4, 0xcc);

impl HeatMap {
    /// Writes the picture.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(crate) fn draw(&self, path: &Path) -> Result<(), PictureError> {
        let title = "The codes: 128 numbers every 62.5 ms";
        canvas::page(path, SIZE, [title, &self.subtitle], |area| {
            self.draw_on(area)
        })
    }

    fn draw_on(&self, area: &Area) -> Drawn {
        let (width, _) = area.dim_in_pixel();
        let (map, scale) = area.split_horizontally(width - 120);
        let columns = cast(self.codes.len());
        let components = self.codes.iter().flatten().map(Vec::len).max().unwrap_or(1);
        let end_s = self.begin_s + columns * self.interval_s;
        let mut chart = ChartBuilder::on(&map)
            .margin_top(26)
            .margin_left(20)
            .margin_right(10)
            .margin_bottom(16)
            .x_label_area_size(52)
            .y_label_area_size(62)
            .build_cartesian_2d(self.begin_s..end_s, cast(components)..0.0)?;
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

        let levels = self.levels(components);
        for (component, row) in levels.iter().enumerate() {
            // Neighbours of one colour make one rectangle: the file gets a third smaller.
            for run in runs(row) {
                let left = self.begin_s + cast(run.begin) * self.interval_s;
                let right = self.begin_s + cast(run.end) * self.interval_s;
                let corners = [(left, cast(component)), (right, cast(component + 1))];
                let color = run.level.map_or(ABSENT, color_of);
                chart.draw_series([Rectangle::new(corners, color.filled())])?;
            }
        }
        let settled_s = self.begin_s + cast(self.settling) * self.interval_s;
        if settled_s > self.begin_s && settled_s < end_s {
            let line = vec![(settled_s, 0.0), (settled_s, cast(components))];
            chart.draw_series([PathElement::new(line, INK.stroke_width(2))])?;
            let (x, y) = chart.backend_coord(&(settled_s, 0.0));
            let at = (x - 6, y - map.get_base_pixel().1 - 12);
            let label = canvas::anchored(15, INK, HPos::Right);
            map.draw(&Text::new(
                "until here the filters settle on the electrodes' offsets",
                at,
                label,
            ))?;
        }
        Self::draw_scale(&scale)
    }

    /// Level of every component and code, or `None` where the code was lost.
    ///
    /// Each component is shown in SDs around its own mean: their scales differ a hundredfold, and
    /// the largest few would leave the others white. Mean and SD are those of the settled codes.
    fn levels(&self, components: usize) -> Vec<Vec<Option<i16>>> {
        (0..components)
            .map(|component| {
                let value = |code: &Vec<f32>| code.get(component).copied().map(f64::from);
                let settled = self
                    .codes
                    .get(self.settling..)
                    .filter(|codes| !codes.is_empty());
                let settled = settled.unwrap_or(&self.codes).iter().flatten();
                let seen: Vec<f64> = settled.filter_map(value).collect();
                let Spread { mean, sd } = Spread::of(&seen);
                let level = |x: f64| level_of(if sd > 0.0 { (x - mean) / sd } else { 0.0 });
                self.codes
                    .iter()
                    .map(|code| code.as_ref().and_then(value).map(level))
                    .collect()
            })
            .collect()
    }

    fn draw_scale(area: &Area) -> Drawn {
        let (top, bottom, left, right) = (60_i32, 560_i32, 14_i32, 34_i32);
        let step = f64::from(bottom - top) / f64::from(LEVELS);
        let row = |level: i16| -> i32 {
            #[expect(
                clippy::cast_possible_truncation,
                reason = "a row of a page: below 10 000"
            )]
            let row = (f64::from(top) + f64::from(level) * step).round() as i32;
            row
        };
        for level in 0..LEVELS {
            let corners = [(left, row(level)), (right, row(level + 1))];
            area.draw(&Rectangle::new(
                corners,
                color_of(LEVELS - 1 - level).filled(),
            ))?;
        }
        area.draw(&Rectangle::new([(left, top), (right, bottom)], FAINT))?;
        let label = canvas::anchored(15, INK, HPos::Left);
        for (words, y) in [
            (format!("+{REACH} SD"), top),
            ("mean".to_owned(), i32::midpoint(top, bottom)),
            (format!("−{REACH} SD"), bottom),
        ] {
            area.draw(&Text::new(words, (right + 8, y), label.clone()))?;
        }
        let lost = [(left, bottom + 30), (right, bottom + 50)];
        area.draw(&Rectangle::new(lost, ABSENT.filled()))?;
        area.draw(&Text::new("lost", (right + 8, bottom + 40), label))
    }
}

/// Neighbouring codes of one level.
#[derive(Debug, PartialEq, Eq)]
struct Run {
    begin: usize,
    end: usize,
    level: Option<i16>,
}

fn runs(row: &[Option<i16>]) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    for (index, level) in row.iter().enumerate() {
        match runs.last_mut() {
            Some(run) if run.level == *level => run.end = index + 1,
            _ => runs.push(Run {
                begin: index,
                end: index + 1,
                level: *level,
            }),
        }
    }
    runs
}

fn level_of(deviations: f64) -> i16 {
    let half = f64::from(LEVELS - 1) / 2.0;
    let level = (deviations / REACH * half).round().clamp(-half, half) + half;
    #[expect(clippy::cast_possible_truncation, reason = "0..LEVELS after the clamp")]
    let level = level as i16;
    level
}

/// Blue below the mean, white at it, red above.
fn color_of(level: i16) -> RGBColor {
    let half = f64::from(LEVELS - 1) / 2.0;
    let x = (f64::from(level) - half) / half;
    let end = if x < 0.0 {
        [0x21, 0x5a, 0xa0]
    } else {
        [0xb8, 0x2e, 0x2e]
    };
    let [red, green, blue] = end.map(|channel: u8| {
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

fn cast(count: usize) -> f64 {
    f64::from(u32::try_from(count).unwrap_or(u32::MAX))
}
