//! Small maps of the head, seen from above, with values of either sign.

use std::path::Path;

use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use crate::canvas::{self, Area, Drawn, FAINT, INK, PictureError};
use crate::scalp_map::{Head, interpolated};

/// Maps of several patterns over the same electrodes.
#[derive(Debug, Clone, PartialEq)]
pub struct Patterns {
    /// Positions of the electrodes on the map, as [`crate::scalp_map::on_map`] returns them; at
    /// least one.
    pub places: Vec<[f64; 2]>,
    /// Title of each pattern, and its value at each electrode, -1 to 1.
    pub patterns: Vec<(String, Vec<f64>)>,
    /// Title of the picture, in one line.
    pub title: String,
    /// Line below the title.
    pub subtitle: String,
}

/// Width and height of the area of one map, pixels.
const CELL: (i32, i32) = (300, 310);
const IN_ROW: usize = 4;
/// Number of colour levels for each sign.
const LEVELS: f64 = 12.0;
/// Colours of -1, 0 and 1.
const COLORS: [RGBColor; 3] =
    [RGBColor(0x21, 0x5a, 0xa0), RGBColor(0xfa, 0xfa, 0xfa), RGBColor(0xb8, 0x2e, 0x2e)];

impl Patterns {
    /// Writes the maps as an SVG file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn draw(&self, path: &Path) -> Result<(), PictureError> {
        let (in_row, rows) = self.layout();
        let pixels =
            |count: usize, pixels: i32| pixels.unsigned_abs() * small(count).unsigned_abs();
        let size =
            (pixels(in_row, CELL.0) + 20, pixels(rows, CELL.1) + canvas::HEAD.unsigned_abs() + 50);
        canvas::page(path, size, [&self.title, &self.subtitle], |area| self.draw_on(area))
    }

    /// Returns the number of maps in a row, and the number of rows.
    fn layout(&self) -> (usize, usize) {
        let rows = self.patterns.len().div_ceil(IN_ROW).max(1);
        (self.patterns.len().div_ceil(rows).max(2), rows)
    }

    fn draw_on(&self, area: &Area) -> Drawn {
        let (in_row, rows) = self.layout();
        for (index, (title, values)) in self.patterns.iter().enumerate() {
            let (column, row) = (small(index % in_row), small(index / in_row));
            let centre = (CELL.0 / 2 + 10 + CELL.0 * column, 180 + CELL.1 * row);
            let style = canvas::anchored(16, INK, HPos::Center);
            area.draw(&Text::new(title.clone(), (centre.0, centre.1 - 160), style))?;
            let head = Head { centre, radius: 126, square: 3 };
            head.draw(area, |at| {
                let electrodes = self.places.iter().copied().zip(values.iter().copied());
                interpolated(electrodes, at).map(color_of)
            })?;
            for place in &self.places {
                area.draw(&Circle::new(head.pixel(*place), 2, INK.filled()))?;
            }
        }
        let (top, left, width) = (CELL.1 * small(rows) + 16, 60, 12);
        for level in -12..=12 {
            let x = left + (level + 12) * width;
            let color = color_of(f64::from(level) / LEVELS).filled();
            area.draw(&Rectangle::new([(x, top), (x + width, top + 14)], color))?;
        }
        for (value, x) in [("-1", left - 22), ("1", left + 25 * width + 8)] {
            let style = canvas::anchored(15, FAINT, HPos::Left);
            area.draw(&Text::new(value, (x, top + 7), style))?;
        }
        Ok(())
    }
}

/// Converts a number of maps to the integer type of pixel coordinates.
fn small(count: usize) -> i32 {
    i32::try_from(count).unwrap_or(i32::MAX / 1000)
}

/// Returns the colour of a value from -1 to 1, rounded to one of [`LEVELS`] levels per sign.
fn color_of(value: f64) -> RGBColor {
    let level = (value.clamp(-1.0, 1.0) * LEVELS).round();
    DerivedColorMap::new(&COLORS).get_color_normalized(level, -LEVELS, LEVELS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn either_sign_has_its_colour_at_its_electrode() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("patterns.svg");
        let patterns = Patterns {
            places: vec![[-0.5, 0.0], [0.5, 0.0]],
            patterns: (0..5).map(|n| (format!("filter {n}"), vec![-1.0, 1.0])).collect(),
            title: String::new(),
            subtitle: String::new(),
        };
        patterns.draw(&path).expect("a file");
        let text = std::fs::read_to_string(path).expect("a file");
        assert!(text.contains("filter 4"));
        // Each head and the scale have both colours; a dot marks each electrode.
        for color in ["#215AA0", "#B82E2E"] {
            assert!(text.matches(color).count() > 5, "{color}");
        }
        assert_eq!(text.matches("r=\"2\"").count(), 10);
    }
}
