//! Curves over the logarithm of the frequency.

use std::path::Path;

use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::canvas::{self, Area, Drawn, FAINT, GRID, INK, PictureError, REFERENCE};

/// How a curve is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Mark {
    /// A line through the points.
    Line,
    /// A circle around each.
    Circles,
}

/// One curve.
#[derive(Debug, Clone)]
pub(crate) struct Curve {
    /// Words in the legend.
    pub(crate) label: String,
    /// Colour.
    pub(crate) color: RGBColor,
    /// Line or circles.
    pub(crate) mark: Mark,
    /// Frequency in Hz, rising, and value.
    pub(crate) points: Vec<(f64, f64)>,
}

/// Curves on common axes.
#[derive(Debug, Clone)]
pub(crate) struct Chart {
    /// Title of the picture.
    pub(crate) title: &'static str,
    /// One line under it.
    pub(crate) subtitle: String,
    /// Ends of the frequency axis, Hz.
    pub(crate) x_hz: [f64; 2],
    /// Ends of the other axis; points beyond are left out, but for the one to which a line goes down.
    pub(crate) y: [f64; 2],
    /// What the other axis shows, with its unit.
    pub(crate) y_words: &'static str,
    /// What is shaded and marked as the band that the filters pass, Hz.
    pub(crate) band_hz: [f64; 2],
    /// What is marked as the mains, Hz.
    pub(crate) mains_hz: f64,
    /// The curves, the last one on top.
    pub(crate) curves: Vec<Curve>,
}

const SIZE: (u32, u32) = (1200, 700);
const TICKS_HZ: [f64; 11] = [0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0];

impl Chart {
    /// Writes the picture.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(crate) fn draw(&self, path: &Path) -> Result<(), PictureError> {
        canvas::page(path, SIZE, [self.title, &self.subtitle], |area| {
            self.draw_on(area)
        })
    }

    fn draw_on(&self, area: &Area) -> Drawn {
        let ([first, last], [low, high]) = (self.x_hz, self.y);
        let mut chart = ChartBuilder::on(area)
            .margin_top(40)
            .margin_left(20)
            .margin_right(36)
            .margin_bottom(16)
            .x_label_area_size(52)
            .y_label_area_size(66)
            .build_cartesian_2d((first..last).log_scale(), low..high)?;
        let shaded = self.band_hz.map(|hz| hz.clamp(first, last));
        let shaded = Rectangle::new(
            [(shaded[0], low), (shaded[1], high)],
            REFERENCE.mix(0.07).filled(),
        );
        chart.draw_series([shaded])?;
        chart
            .configure_mesh()
            .light_line_style(WHITE.mix(0.0))
            .bold_line_style(GRID)
            .axis_style(FAINT)
            .disable_x_mesh()
            .x_labels(0)
            // Our own ticks, below: plotters labels powers of ten only.
            .x_label_formatter(&|_| String::new())
            .set_tick_mark_size(LabelAreaPosition::Bottom, 0)
            .y_labels(12)
            .y_label_formatter(&|y| rounded(*y).to_string().replace('-', "−"))
            .x_desc("frequency (Hz)")
            .y_desc(self.y_words)
            .label_style(canvas::text(15, INK))
            .axis_desc_style(canvas::text(16, INK))
            .draw()?;
        for hz in TICKS_HZ
            .into_iter()
            .filter(|hz| (first..=last).contains(hz))
        {
            chart.draw_series([PathElement::new(vec![(hz, low), (hz, high)], GRID)])?;
            let (x, y) = chart.backend_coord(&(hz, low));
            let at = (x, y - area.get_base_pixel().1 + 16);
            let style = canvas::anchored(15, INK, HPos::Center);
            area.draw(&Text::new(hz.to_string(), at, style))?;
        }
        for curve in &self.curves {
            let points = curve.points.iter().copied();
            let inside: Vec<(f64, f64)> = points
                .filter(|(hz, y)| (first..=last).contains(hz) && *y <= high)
                .collect();
            match curve.mark {
                Mark::Line => {
                    let points = down_to(low, &inside);
                    chart.draw_series([PathElement::new(points, curve.color.stroke_width(3))])?;
                }
                Mark::Circles => {
                    let circle = |point| Circle::new(point, 4, curve.color.stroke_width(2));
                    let inside = inside.into_iter().filter(|(_, y)| *y >= low);
                    chart.draw_series(inside.map(circle))?;
                }
            }
        }
        let height = high - low;
        for (hz, side, gap) in [
            (self.band_hz[0], HPos::Left, 1.02),
            (self.mains_hz, HPos::Right, 0.98),
            (self.band_hz[1], HPos::Left, 1.02),
        ] {
            if (first..=last).contains(&hz) {
                let line = vec![(hz, high), (hz, high - 0.05 * height)];
                chart.draw_series([PathElement::new(line, REFERENCE.stroke_width(2))])?;
                let label = canvas::anchored(15, REFERENCE, side);
                let at = (hz * gap, high - 0.025 * height);
                chart.draw_series([Text::new(format!("{hz} Hz"), at, label)])?;
            }
        }
        let (width, _) = area.dim_in_pixel();
        let column = i32::try_from(width).unwrap_or(i32::MAX).saturating_sub(100);
        let count = i32::try_from(self.curves.len()).unwrap_or(i32::MAX);
        for (place, curve) in (0..).zip(&self.curves) {
            let at = (90 + column / count * place, 10);
            canvas::legend(area, at, curve.color, &curve.label)?;
        }
        Ok(())
    }
}

/// The points not below `low`, and at `low` those beside them.
fn down_to(low: f64, points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let above = |place: usize| points.get(place).is_some_and(|(_, y)| *y >= low);
    let places = (0..points.len()).filter(|place| {
        above(*place) || above(place + 1) || place.checked_sub(1).is_some_and(above)
    });
    places
        .map(|place| (points[place].0, points[place].1.max(low)))
        .collect()
}

/// What a tick says: plotters reckons 0.1 + 0.2.
fn rounded(y: f64) -> f64 {
    (y * 1e6).round() / 1e6
}

#[cfg(test)]
mod tests {
    use super::super::canvas::{RESULT, SOURCE};
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

    #[test]
    fn lines_and_circles_are_drawn_within_the_axes() {
        let curve = |mark, color, label: &str| Curve {
            label: label.to_owned(),
            color,
            mark,
            points: (1..=60)
                .map(|hz| (hz.into(), 1.0 / f64::from(hz)))
                .collect(),
        };
        let chart = Chart {
            title: "a title",
            subtitle: "made-up data".to_owned(),
            x_hz: [1.0, 60.0],
            y: [0.0, 0.5],
            y_words: "a quantity",
            band_hz: [0.5, 40.0],
            mains_hz: 50.0,
            curves: vec![
                curve(Mark::Line, SOURCE, "a line"),
                curve(Mark::Circles, RESULT, "some circles"),
            ],
        };
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("curves.svg");
        chart.draw(&path).expect("drawn");
        let text = std::fs::read_to_string(path).expect("written");
        for words in [
            "a title",
            "made-up data",
            "a quantity",
            "a line",
            "some circles",
            "40 Hz",
            "50 Hz",
        ] {
            assert!(text.contains(words), "{words}");
        }
        assert!(!text.contains("0.5 Hz"), "a mark beyond the axis");
        // The first of 60, at 1, lies above the axis.
        assert_eq!(text.matches("<circle").count(), 59);
    }
}
