//! Chart of curves over frequency, on a logarithmic axis.

use std::path::Path;

use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use crate::canvas::{self, Area, Drawn, FAINT, GRID, INK, PictureError, REFERENCE};
use crate::lines::{self, Mark, Series};

/// Chart of several curves over frequency.
#[derive(Debug, Clone)]
pub struct Curves {
    /// Title of the picture, on one line.
    pub title: &'static str,
    /// Line below the title, such as the conditions and results of the measurement.
    pub subtitle: String,
    /// Lowest and highest frequency of the x axis, Hz.
    pub x_hz: [f64; 2],
    /// Lowest and highest value on the y axis. Points outside are not drawn; a line that leaves the
    /// range at its lower end is drawn down to that end.
    pub y: [f64; 2],
    /// Quantity and unit that label the y axis.
    pub y_label: &'static str,
    /// Pass band of the filters, Hz; the band is shaded, and its ends are labelled.
    pub band_hz: [f64; 2],
    /// Mains frequency, Hz, which is marked and labelled.
    pub mains_hz: f64,
    /// Curves, the last one drawn on top. Points are frequency in Hz, ascending, and value in the
    /// unit of the y axis. Standard deviations are not drawn.
    pub curves: Vec<Series>,
}

const SIZE: (u32, u32) = (1200, 700);
const TICKS_HZ: [f64; 11] = [0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0];

impl Curves {
    /// Writes the chart as an SVG file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn draw(&self, path: &Path) -> Result<(), PictureError> {
        let heading = [self.title, &self.subtitle];
        canvas::page(path, SIZE, heading, |area| self.draw_on(area))
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
            // Hides the ticks of plotters, which labels only powers of ten; a loop below draws
            // others.
            .x_labels(0)
            .x_label_formatter(&|_| String::new())
            .set_tick_mark_size(LabelAreaPosition::Bottom, 0)
            .y_labels(12)
            .y_label_formatter(&|y| {
                // plotters adds up its ticks, so one can be 0.30000000000000004: round it.
                ((y * 1e6).round() / 1e6).to_string().replace('-', "−")
            })
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
                Mark::Line | Mark::ThinLine => {
                    let points = down_to(low, &points.collect::<Vec<_>>());
                    let style = curve.color.stroke_width(lines::width(curve.mark));
                    chart.draw_series([PathElement::new(points, style)])?;
                }
                Mark::Dots | Mark::Rings => {
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
        (0..).zip(&self.curves).try_for_each(|(place, curve)| {
            lines::draw_entry(area, (90 + width / count * place, 10), curve)
        })
    }
}

/// Returns the part of a line that is at or above `low`. The neighbours of its ends are kept too,
/// moved up to `low`.
fn down_to(low: f64, points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let is_above = |place: usize| points.get(place).is_some_and(|(_, y)| *y >= low);
    let places =
        (0..points.len()).filter(|place| (place.saturating_sub(1)..=place + 1).any(is_above));
    let moved = places.map(|place| (points[place].0, points[place].1.max(low)));
    moved.collect()
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
