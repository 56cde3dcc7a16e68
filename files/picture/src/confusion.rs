//! Confusion matrix: how often each class was decided for each true class.

use std::path::Path;

use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use crate::canvas::{self, Area, Drawn, INK, PictureError, SOURCE};

/// Numbers of trials by true class and decision.
#[derive(Debug, Clone, PartialEq)]
pub struct Confusion {
    /// Names of the classes.
    pub classes: Vec<String>,
    /// Number of trials of each true class (row) for which each class was decided (column).
    pub counts: Vec<Vec<u32>>,
    /// Title of the picture, in one line.
    pub title: String,
    /// Line below the title, such as the accuracy.
    pub subtitle: String,
}

/// Side length of a cell, pixels.
const CELL: i32 = 110;
/// Place of the first cell, pixels.
const FIRST: (i32, i32) = (170, 60);

impl Confusion {
    /// Writes the chart as an SVG file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn draw(&self, path: &Path) -> Result<(), PictureError> {
        let side = CELL.unsigned_abs() * u32::try_from(self.classes.len()).unwrap_or(1);
        let size = ((side + 210).max(640), side + 170);
        canvas::page(path, size, [&self.title, &self.subtitle], |area| {
            self.draw_on(area)
        })
    }

    fn draw_on(&self, area: &Area) -> Drawn {
        let text = |text: String, at: (i32, i32), color, side| {
            let style = canvas::anchored(17, color, side);
            area.draw(&Text::new(text, at, style))
        };
        text(
            "decided".to_owned(),
            (FIRST.0, FIRST.1 - 40),
            INK,
            HPos::Left,
        )?;
        text(
            "true".to_owned(),
            (FIRST.0 - 14, FIRST.1 - 14),
            INK,
            HPos::Right,
        )?;
        let rows = (FIRST.1..).step_by(CELL.unsigned_abs() as usize);
        for ((counts, class), y) in self.counts.iter().zip(&self.classes).zip(rows) {
            let middle = y + CELL / 2;
            text(class.clone(), (FIRST.0 - 14, middle), INK, HPos::Right)?;
            let trials: u32 = counts.iter().sum();
            let columns = (FIRST.0..).step_by(CELL.unsigned_abs() as usize);
            for ((count, class), x) in counts.iter().zip(&self.classes).zip(columns) {
                if y == FIRST.1 {
                    text(class.clone(), (x + CELL / 2, y - 14), INK, HPos::Center)?;
                }
                let part = f64::from(*count) / f64::from(trials.max(1));
                let map = DerivedColorMap::new(&[WHITE, SOURCE]);
                let color = map.get_color_normalized(part, 0.0, 1.0);
                let corners = [(x, y), (x + CELL - 3, y + CELL - 3)];
                area.draw(&Rectangle::new(corners, color.filled()))?;
                area.draw(&Rectangle::new(corners, SOURCE))?;
                let color = if part > 0.6 { WHITE } else { INK };
                text(
                    count.to_string(),
                    (x + CELL / 2, middle - 12),
                    color,
                    HPos::Center,
                )?;
                let percent = format!("{:.0} %", 100.0 * part);
                text(percent, (x + CELL / 2, middle + 12), color, HPos::Center)?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_count_is_shown_with_its_part_of_the_true_class() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("confusion.svg");
        let confusion = Confusion {
            classes: vec!["left".to_owned(), "right".to_owned()],
            counts: vec![vec![13, 7], vec![0, 11]],
            title: String::new(),
            subtitle: String::new(),
        };
        confusion.draw(&path).expect("a file");
        let text = std::fs::read_to_string(path).expect("a file");
        for part in ["13\n", "65 %", "35 %", "11\n", "100 %", "0 %"] {
            assert!(text.contains(part), "{part}");
        }
    }
}
