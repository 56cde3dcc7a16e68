//! Tables on the terminal.

use std::fmt;

/// Rows of a name and right-aligned cells, under a title.
#[derive(Debug)]
pub(crate) struct Table {
    title: String,
    /// Cells of each row, the name first.
    rows: Vec<Vec<String>>,
}

impl Table {
    pub(crate) fn new(title: impl Into<String>) -> Self {
        Self {
            title: title.into(),
            rows: Vec::new(),
        }
    }

    /// Adds a row; a heading is a row with an empty name.
    pub(crate) fn row(
        &mut self,
        name: impl Into<String>,
        cells: impl IntoIterator<Item = impl Into<String>>,
    ) {
        let mut row = vec![name.into()];
        row.extend(cells.into_iter().map(Into::into));
        self.rows.push(row);
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.title)?;
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let width = |column: usize| {
            let cells = self.rows.iter().filter_map(|row| row.get(column));
            cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
        };
        let widths: Vec<usize> = (0..columns).map(width).collect();
        for row in &self.rows {
            let mut line = format!("  {:<1$}", row[0], widths[0]);
            for (cell, width) in row.iter().zip(&widths).skip(1) {
                line += &format!("    {cell:>width$}");
            }
            writeln!(f, "{}", line.trim_end())?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_as_wide_as_their_widest_cell() {
        let mut table = Table::new("a title");
        table.row("", ["x", "wide"]);
        table.row("name", ["1234", "5"]);
        table.row("no cells", [""; 0]);
        let expected = "a title\n               x    wide\n  name        1234       5\n  no cells\n";
        assert_eq!(table.to_string(), expected);
    }
}
