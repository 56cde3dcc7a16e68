//! Curves over the logarithm of the frequency.

use std::path::Path;

use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use crate::canvas::{self, Area, Drawn, FAINT, GRID, INK, PictureError, REFERENCE};

/// Shape in which a curve's points are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mark {
    /// A line through the points.
    Line,
    /// A circle around each point.
    Circles,
}

/// Points over frequency, with their look and their entry in the legend.
#[derive(Debug, Clone)]
pub struct Curve {
    /// Text in the legend.
    pub label: String,
    /// Colour, one of those in [`canvas`].
    pub color: RGBColor,
    /// Line or circles.
    pub mark: Mark,
    /// Frequency in Hz, ascending, and value.
    pub points: Vec<(f64, f64)>,
}

/// Curves on common axes.
#[derive(Debug, Clone)]
pub struct Curves {
    /// Title of the picture.
    pub title: &'static str,
    /// One line under the title.
    pub subtitle: String,
    /// Lowest and highest frequency of the x axis, Hz.
    pub x_hz: [f64; 2],
    /// Lowest and highest value of the y axis. Points outside are left out, except the first on each
    /// side of a line, which is drawn at the lower end.
    pub y: [f64; 2],
    /// Quantity and unit of the y axis.
    pub y_label: &'static str,
    /// Pass band of the filters, shaded and labelled, Hz.
    pub band_hz: [f64; 2],
    /// Mains frequency, labelled, Hz.
    pub mains_hz: f64,
    /// Curves in drawing order: the last one is on top.
    pub curves: Vec<Curve>,
}

const SIZE: (u32, u32) = (1200, 700);
const TICKS_HZ: [f64; 11] = [0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0];

impl Curves {
    /// Writes the chart as an SVG file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn draw(&self, path: &Path) -> Result<(), PictureError> {
        canvas::page(path, SIZE, [self.title, &self.subtitle], |area| {
            self.draw_on(area)
        })
    }

    fn draw_on(&self, area: &Area) -> Drawn {
        let ([first, last], [low, high]) = (self.x_hz, self.y);
        let is_on_axis = |hz: &f64| (first..=last).contains(hz);
        let mut chart = canvas::chart(area, [40, 20, 36], 66)
            .build_cartesian_2d((first..last).log_scale(), low..high)?;
        let [left, right] = self.band_hz.map(|hz| hz.clamp(first, last));
        let band = REFERENCE.mix(0.07).filled();
        chart.draw_series([Rectangle::new([(left, low), (right, high)], band)])?;
        chart
            .configure_mesh()
            .light_line_style(WHITE.mix(0.0))
            .bold_line_style(GRID)
            .axis_style(FAINT)
            .disable_x_mesh()
            // Ticks are drawn below: plotters labels only powers of ten.
            .x_labels(0)
            .x_label_formatter(&|_| String::new())
            .set_tick_mark_size(LabelAreaPosition::Bottom, 0)
            .y_labels(12)
            .y_label_formatter(&|y| without_noise(*y).to_string().replace('-', "−"))
            .x_desc("frequency (Hz)")
            .y_desc(self.y_label)
            .label_style(canvas::text(15, INK))
            .axis_desc_style(canvas::text(16, INK))
            .draw()?;
        for hz in TICKS_HZ.into_iter().filter(is_on_axis) {
            chart.draw_series([PathElement::new(vec![(hz, low), (hz, high)], GRID)])?;
            let (x, y) = canvas::inside(area, chart.backend_coord(&(hz, low)));
            let style = canvas::anchored(15, INK, HPos::Center);
            area.draw(&Text::new(hz.to_string(), (x, y + 16), style))?;
        }
        for curve in &self.curves {
            let points = curve.points.iter().copied();
            let points = points.filter(|(hz, y)| is_on_axis(hz) && *y <= high);
            match curve.mark {
                Mark::Line => {
                    let points = down_to(low, &points.collect::<Vec<_>>());
                    chart.draw_series([PathElement::new(points, curve.color.stroke_width(3))])?;
                }
                Mark::Circles => {
                    let circle = |point| Circle::new(point, 4, curve.color.stroke_width(2));
                    chart.draw_series(points.filter(|(_, y)| *y >= low).map(circle))?;
                }
            }
        }
        let height = high - low;
        for (hz, side, gap) in [
            (self.band_hz[0], HPos::Left, 1.02),
            (self.mains_hz, HPos::Right, 0.98),
            (self.band_hz[1], HPos::Left, 1.02),
        ] {
            if is_on_axis(&hz) {
                let line = vec![(hz, high), (hz, high - 0.05 * height)];
                chart.draw_series([PathElement::new(line, REFERENCE.stroke_width(2))])?;
                let label = canvas::anchored(15, REFERENCE, side);
                let at = (hz * gap, high - 0.025 * height);
                chart.draw_series([Text::new(format!("{hz} Hz"), at, label)])?;
            }
        }
        let width = i32::try_from(area.dim_in_pixel().0).unwrap_or(i32::MAX) - 100;
        let count = i32::try_from(self.curves.len()).unwrap_or(i32::MAX);
        for (place, curve) in (0..).zip(&self.curves) {
            let at = (90 + width / count * place, 10);
            canvas::legend(area, at, curve.color, &curve.label)?;
        }
        Ok(())
    }
}

/// Keeps the points that are not below `low`, and moves their lower neighbours up to `low`.
fn down_to(low: f64, points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let above = |place: usize| points.get(place).is_some_and(|(_, y)| *y >= low);
    let places = (0..points.len()).filter(|place| {
        above(*place) || above(place + 1) || place.checked_sub(1).is_some_and(above)
    });
    places
        .map(|place| (points[place].0, points[place].1.max(low)))
        .collect()
}

/// Rounds a tick to 6 decimals: plotters computes them as sums such as 0.1 + 0.2.
fn without_noise(y: f64) -> f64 {
    (y * 1e6).round() / 1e6
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_goes_down_to_the_axis_and_not_along_it() {
        let points = [
            (1.0, 5.0),
            (2.0, -3.0),
            (3.0, 4.0),
            (4.0, -1.0),
            (5.0, -2.0),
        ];
        let expected = [(1.0, 5.0), (2.0, 0.0), (3.0, 4.0), (4.0, 0.0)];
        assert_eq!(down_to(0.0, &points), expected);
    }
}
