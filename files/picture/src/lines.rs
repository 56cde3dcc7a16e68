//! Chart of lines and points on common axes, linear or logarithmic.

use std::path::Path;

use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use crate::axis::Axis;
use crate::canvas::{self, Area, Chart, Drawn, FAINT, GRID, INK, PictureError};

/// How the points of a series are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mark {
    /// A thick line through the points.
    Line,
    /// A thin line through the points.
    ThinLine,
    /// A filled circle at each point.
    Dots,
    /// A circle around each point.
    Rings,
}

/// Points of one quantity, with the colour and mark in which they are drawn.
#[derive(Debug, Clone)]
pub struct Series {
    /// Text in the legend; if empty, the legend does not list the series.
    pub label: String,
    /// Colour, usually one of the colours in [`canvas`].
    pub color: RGBColor,
    /// Line or marker with which the points are drawn.
    pub mark: Mark,
    /// Points (x, y) in drawing order. Points that an axis cannot show are left out, such as 0 on a
    /// logarithmic axis.
    pub points: Vec<(f64, f64)>,
    /// Standard deviation of y at each point, drawn as a vertical bar; empty to draw none.
    pub sd: Vec<f64>,
}

/// Several series on common axes; the points determine the range of the axes.
#[derive(Debug, Clone)]
pub struct Lines {
    /// Title of the picture, in one line.
    pub title: String,
    /// Line below the title, such as the conditions.
    pub subtitle: String,
    /// Horizontal axis, with its label and scale.
    pub x: Axis,
    /// Vertical axis, with its label and scale.
    pub y: Axis,
    /// Series in drawing order: the last one is on top.
    pub series: Vec<Series>,
}

impl Series {
    /// Creates a series without standard deviations.
    pub fn new(
        label: impl Into<String>,
        color: RGBColor,
        mark: Mark,
        points: Vec<(f64, f64)>,
    ) -> Self {
        Self { label: label.into(), color, mark, points, sd: Vec::new() }
    }

    /// Returns each point as x, y and standard deviation, which is 0 if the series has none.
    fn spread_points(&self) -> impl Iterator<Item = (f64, f64, f64)> {
        let points = self.points.iter().enumerate();
        points.map(|(place, &(x, y))| (x, y, self.sd.get(place).copied().unwrap_or(0.0)))
    }
}

const SIZE: (u32, u32) = (1100, 640);
/// Height of a row of the legend, pixels.
const ROW: i32 = 26;
/// Left edge of the legend, pixels.
const LEGEND_LEFT: i32 = 98;
/// Estimated mean width of a character in the legend, pixels.
const CHARACTER: i32 = 8;

impl Lines {
    /// Writes the chart as an SVG file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn draw(&self, path: &Path) -> Result<(), PictureError> {
        canvas::page(path, SIZE, [&self.title, &self.subtitle], |area| self.draw_on(area))
    }

    fn draw_on(&self, area: &Area) -> Drawn {
        let legend = self.legend();
        let rows = legend.last().map_or(0, |(_, (_, y))| y / ROW + 1);
        let points = || self.series.iter().flat_map(Series::spread_points);
        let [left, right] = self.x.coordinates(points().map(|(x, _, _)| x));
        let ys = points().flat_map(|(_, y, sd)| {
            // A bar down to 0 would be infinitely long on a logarithmic axis, so the range includes
            // a bar's lower end only down to half of the value.
            [y, y + sd, (y - sd).max(0.5 * y)]
        });
        let [low, high] = self.y.coordinates(ys);
        let mut chart = canvas::chart(area, [6 + ROW * rows, 16, 30], 76)
            .build_cartesian_2d(left..right, low..high)?;
        chart
            .configure_mesh()
            .disable_mesh()
            .axis_style(FAINT)
            .x_labels(0)
            .y_labels(0)
            .set_all_tick_mark_size(0)
            .x_desc(&self.x.label)
            .y_desc(&self.y.label)
            .axis_desc_style(canvas::text(16, INK))
            .draw()?;
        for (x, text) in self.x.ticks_between([left, right]) {
            chart.draw_series([PathElement::new([(x, low), (x, high)], GRID)])?;
            let (x, y) = canvas::inside(area, chart.backend_coord(&(x, low)));
            let style = canvas::anchored(15, INK, HPos::Center);
            area.draw(&Text::new(text, (x, y + 16), style))?;
        }
        for (y, text) in self.y.ticks_between([low, high]) {
            chart.draw_series([PathElement::new([(left, y), (right, y)], GRID)])?;
            let (x, y) = canvas::inside(area, chart.backend_coord(&(left, y)));
            let style = canvas::anchored(15, INK, HPos::Right);
            area.draw(&Text::new(text, (x - 8, y), style))?;
        }
        for series in &self.series {
            self.draw_series(&mut chart, series, low)?;
        }
        for (series, at) in legend {
            draw_entry(area, at, series)?;
        }
        Ok(())
    }

    /// Draws a series. Bars that extend below `low`, the start of the y axis, end there.
    fn draw_series(&self, chart: &mut Chart, series: &Series, low: f64) -> Drawn {
        let at = |x: f64, y: f64| (self.x.coordinate(x), self.y.coordinate(y));
        let shown = series.spread_points().filter(|(x, y, _)| self.x.has(*x) && self.y.has(*y));
        let shown: Vec<(f64, f64, f64)> = shown.collect();
        for &(x, y, sd) in shown.iter().filter(|(_, _, sd)| *sd > 0.0) {
            let below = y - sd;
            let bottom = if self.y.has(below) { self.y.coordinate(below).max(low) } else { low };
            let bar = vec![(self.x.coordinate(x), bottom), at(x, y + sd)];
            chart.draw_series([PathElement::new(bar, series.color.stroke_width(2))])?;
        }
        let points = shown.iter().map(|&(x, y, _)| at(x, y));
        match series.mark {
            Mark::Line | Mark::ThinLine => {
                let style = series.color.stroke_width(width(series.mark));
                chart.draw_series([PathElement::new(points.collect::<Vec<_>>(), style)])?;
            }
            Mark::Dots => {
                chart.draw_series(points.map(|at| Circle::new(at, 5, series.color.filled())))?;
            }
            Mark::Rings => {
                let style = series.color.stroke_width(2);
                chart.draw_series(points.map(|at| Circle::new(at, 6, style)))?;
            }
        }
        Ok(())
    }

    /// Returns each series that the legend lists, with the pixel position of its entry. A new row
    /// begins where an entry would cross the right edge of the page.
    fn legend(&self) -> Vec<(&Series, (i32, i32))> {
        let right = i32::try_from(SIZE.0).unwrap_or(i32::MAX) - 30;
        let (mut x, mut y) = (LEGEND_LEFT, 8);
        let listed = self.series.iter().filter(|series| !series.label.is_empty());
        let places = listed.map(|series| {
            let count = i32::try_from(series.label.chars().count()).unwrap_or(i32::MAX);
            let width = count.saturating_mul(CHARACTER).saturating_add(62);
            if x > LEGEND_LEFT && x.saturating_add(width) > right {
                (x, y) = (LEGEND_LEFT, y + ROW);
            }
            let at = (x, y);
            x = x.saturating_add(width);
            (series, at)
        });
        places.collect()
    }
}

/// Returns the width in pixels of the line that [`Mark::Line`] or [`Mark::ThinLine`] draws.
fn width(mark: Mark) -> u32 {
    if mark == Mark::ThinLine { 1 } else { 3 }
}

/// Draws the entry of a series in the legend: its mark, and its label to the right.
fn draw_entry(area: &Area, at: (i32, i32), series: &Series) -> Drawn {
    let centre = (at.0 + 13, at.1);
    match series.mark {
        Mark::Line | Mark::ThinLine => {
            let style = series.color.stroke_width(width(series.mark));
            area.draw(&PathElement::new([at, (at.0 + 26, at.1)], style))?;
        }
        Mark::Dots => area.draw(&Circle::new(centre, 5, series.color.filled()))?,
        Mark::Rings => area.draw(&Circle::new(centre, 6, series.color.stroke_width(2)))?,
    }
    let style = canvas::anchored(16, INK, HPos::Left);
    area.draw(&Text::new(series.label.clone(), (at.0 + 34, at.1), style))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axis::Scale;
    use crate::canvas::{RESULT, SOURCE};

    fn series(label: &str, mark: Mark, points: &[(f64, f64)]) -> Series {
        let color = if mark == Mark::Line { SOURCE } else { RESULT };
        Series::new(label, color, mark, points.to_vec())
    }

    fn drawn(series: Vec<Series>) -> String {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lines.svg");
        let lines = Lines {
            title: "Title".to_owned(),
            subtitle: "Subtitle".to_owned(),
            x: Axis::new("bits", Scale::Linear),
            y: Axis::new("MSE", Scale::Logarithmic),
            series,
        };
        lines.draw(&path).unwrap();
        std::fs::read_to_string(path).unwrap()
    }

    #[test]
    fn every_point_with_a_place_is_drawn_once_and_the_legend_has_every_label() {
        // Points 3 and 4 are not drawn: a logarithmic axis cannot show NaN and 0.
        let points = [(1.0, 0.5), (2.0, 0.05), (3.0, f64::NAN), (4.0, 0.0), (5.0, 0.003)];
        let line = drawn(vec![series("PCA", Mark::Line, &points)]);
        let drawn_points = line
            .lines()
            .filter(|element| element.contains("#2B6CB0"))
            .filter_map(|element| element.split("points=\"").nth(1)?.split('"').next())
            .map(|points| points.split_whitespace().count());
        // The line has the three other points; its entry in the legend is a line of two points.
        assert_eq!(drawn_points.collect::<Vec<_>>(), [3, 2]);
        assert!(line.contains("PCA") && line.contains("0.005"));
        let dots = drawn(vec![series("model", Mark::Dots, &points)]);
        assert_eq!(dots.matches("<circle").count(), 3 + 1);
        let unlisted = drawn(vec![series("", Mark::Dots, &points)]);
        assert_eq!(unlisted.matches("<circle").count(), 3);
    }

    #[test]
    fn a_standard_deviation_is_a_bar_that_stays_on_the_axis() {
        let mut dots = series("", Mark::Dots, &[(1.0, 0.5), (2.0, 0.5)]);
        dots.sd = vec![0.1, 0.6];
        let text = drawn(vec![dots]);
        let bars = text
            .lines()
            .filter(|element| element.contains("#DD6B20") && element.contains("points=\""));
        assert_eq!(bars.count(), 2);
        assert!(!text.contains("NaN") && !text.contains("inf"), "{text}");
    }

    #[test]
    fn long_legends_have_several_rows() {
        let label = "a label of about forty characters, more";
        let all = (0..5).map(|_| series(label, Mark::Line, &[(0.0, 1.0), (1.0, 2.0)]));
        let lines = Lines {
            title: String::new(),
            subtitle: String::new(),
            x: Axis::new("", Scale::Linear),
            y: Axis::new("", Scale::Linear),
            series: all.collect(),
        };
        let rows: Vec<i32> = lines.legend().iter().map(|(_, (_, y))| *y).collect();
        assert_eq!(rows, [8, 8, 34, 34, 60]);
    }
}
