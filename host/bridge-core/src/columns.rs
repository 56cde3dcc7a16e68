//! Tables of text.

use std::fmt;

/// Writes a header and rows. Every column is as wide as its widest cell; columns marked in `right`
/// are aligned to the right.
pub fn write_columns<const N: usize>(
    formatter: &mut fmt::Formatter<'_>,
    header: [&str; N],
    right: [bool; N],
    rows: impl Iterator<Item = [String; N]>,
) -> fmt::Result {
    let mut table = vec![header.map(str::to_owned)];
    table.extend(rows);
    let widest = |column: usize| {
        let cells = table.iter().map(|row| row[column].chars().count());
        cells.max().unwrap_or(0)
    };
    let widths: [usize; N] = std::array::from_fn(widest);
    for row in &table {
        let cells = row.iter().zip(widths).zip(right);
        let cells: Vec<String> = cells
            .map(|((cell, width), right)| {
                if right {
                    format!("{cell:>width$}")
                } else {
                    format!("{cell:<width$}")
                }
            })
            .collect();
        writeln!(formatter, "{}", cells.join("  ").trim_end())?;
    }
    Ok(())
}
