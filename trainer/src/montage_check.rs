//! Checks a montage file: every mistake at once, and notes about what is allowed but unusual.

use artifact::{
    ADC_RATES_HZ, CHIP_CHANNELS, ELECTRODES, EMPTY, GAINS, Grid, LARGEST_CHAIN, LARGEST_SIDE,
    MontageFile,
};
use recordings::{Electrode, Position};
use std::fmt;

/// Angle between neighbours on the grid from which a note is printed, degrees: twice the angle between
/// neighbours of the 10-20 system on the midline.
const FAR_DEGREES: f64 = 72.0;
/// Smallest numbers of rows and columns that a pool of 2 x 2 cells needs; the pools of a row must cover
/// at least three columns.
const POOLED: [usize; 2] = [2, 4];
/// Rows, and columns, that two convolutions of 3 x 3 cells without padding remove.
const REMOVED: usize = 4;

/// Row and column of a cell, from 1.
pub type Cell = (usize, usize);

/// Why no model can have this montage.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Mistake {
    /// A label is not an electrode.
    #[error("{label} (row {}, column {}) is not an electrode of the 10-20, 10-10 or 10-5 system; write _ for an empty cell", cell.0, cell.1)]
    UnknownElectrode {
        /// The label.
        label: String,
        /// Its cell.
        cell: Cell,
    },
    /// A label is on the grid twice.
    #[error("{label} is in two cells: row {}, column {} and row {}, column {}; empty one of them", cells[0].0, cells[0].1, cells[1].0, cells[1].1)]
    DoubledCell {
        /// The label.
        label: String,
        /// Both cells.
        cells: [Cell; 2],
    },
    /// Two labels denote one electrode.
    #[error("{} and {} are the same electrode; remove one of them", labels[0], labels[1])]
    DoubledElectrode {
        /// Both labels.
        labels: [String; 2],
    },
    /// A row has another number of cells than the first.
    #[error("row {row} has {found} cells, row 1 has {expected}; fill the shorter one with _")]
    UnevenRow {
        /// Number of the row, from 1.
        row: usize,
        /// Its number of cells.
        found: usize,
        /// Number of cells of the first row.
        expected: usize,
    },
    /// The grid has too many rows or columns, or none.
    #[error(
        "the grid has {rows} rows and {columns} columns; 1 to {LARGEST_SIDE} of both are possible"
    )]
    GridSize {
        /// Number of rows.
        rows: usize,
        /// Largest number of cells in a row.
        columns: usize,
    },
    /// An electrode has a channel but no cell.
    #[error("{label} is in the order of channels but in no cell of the grid")]
    NoCell {
        /// The label.
        label: String,
    },
    /// An electrode has a cell but no channel.
    #[error("{label} is on the grid but not in the order of channels")]
    NoChannel {
        /// The label.
        label: String,
    },
    /// An electrode has two channels.
    #[error("{label} has two channels: {} and {}; remove one from the order", channels[0], channels[1])]
    DoubledChannel {
        /// The label.
        label: String,
        /// Both channels, from 1.
        channels: [usize; 2],
    },
    /// There are too few or too many electrodes for any model.
    #[error("the montage has {found} electrodes; {} to {} are possible", ELECTRODES.start(), ELECTRODES.end())]
    Electrodes {
        /// Number of electrodes.
        found: usize,
    },
    /// There are more electrodes than channels.
    #[error("{electrodes} electrodes need more than the {channels} channels; write channels = {needed}, for {} converters", needed / CHIP_CHANNELS)]
    TooManyElectrodes {
        /// Number of electrodes.
        electrodes: usize,
        /// Number of channels.
        channels: usize,
        /// Number of channels that fits.
        needed: usize,
    },
    /// No chain of converters has this number of channels.
    #[error("no chain of converters has {channels} channels; write a multiple of {CHIP_CHANNELS} up to {}", CHIP_CHANNELS * LARGEST_CHAIN)]
    Channels {
        /// Number of channels.
        channels: usize,
    },
    /// The converter has no such gain.
    #[error("an ADS1299 has no gain of {gain}; it has {}", list(&GAINS))]
    Gain {
        /// The gain.
        gain: u32,
    },
    /// The converter has no such rate.
    #[error("an ADS1299 has no rate of {rate_hz} Hz here; possible are {}", list(&ADC_RATES_HZ))]
    Rate {
        /// The rate, Hz.
        rate_hz: u32,
    },
}

/// What is allowed, but limits the choice of a model or its quality.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Note {
    /// The grid is too small for convolutions without padding.
    #[error("{rows} x {columns} cells are too few for convolutions without padding; what fits: {}", if *rows < POOLED[0] || *columns < POOLED[1] { "--mode pca" } else { "--padding space, or --mode pca" })]
    SmallGrid {
        /// Number of rows.
        rows: usize,
        /// Number of columns.
        columns: usize,
    },
    /// Two electrodes are neighbours on the grid but far apart on the scalp.
    #[error("{} and {} are neighbours on the grid but {degrees:.0} degrees apart on the scalp (between Fz and Cz are 36)", labels[0], labels[1])]
    FarNeighbours {
        /// Both labels.
        labels: [String; 2],
        /// Angle between them, seen from the centre of the head, degrees.
        degrees: f64,
    },
}

/// The result of a check. `Display` prints the grid, all mistakes and all notes.
#[derive(Clone, Debug, PartialEq)]
pub struct MontageCheck {
    name: String,
    grid: Grid,
    /// Every mistake; none in a valid montage.
    pub mistakes: Vec<Mistake>,
    /// Every note.
    pub notes: Vec<Note>,
}

impl MontageCheck {
    /// Checks a montage.
    pub fn new(file: &MontageFile) -> Self {
        let grid = file.grid();
        let mut mistakes = size_mistakes(&grid);
        mistakes.extend(label_mistakes(&grid));
        if let Some(order) = &file.order {
            mistakes.extend(order_mistakes(&grid.electrodes(), order));
        }
        mistakes.extend(adc_mistakes(file, grid.electrodes().len()));
        Self {
            name: file.name.clone(),
            notes: notes(&grid),
            grid,
            mistakes,
        }
    }
}

fn list(values: &[u32]) -> String {
    let values: Vec<String> = values.iter().map(ToString::to_string).collect();
    values.join(", ")
}

/// Returns the label and the cell of each electrode, row-major.
fn electrodes(grid: &Grid) -> Vec<(&str, Cell)> {
    let mut electrodes = Vec::new();
    for (row, cells) in (1..).zip(&grid.cells) {
        let cells = (1..).zip(cells).filter(|(_, label)| *label != EMPTY);
        electrodes.extend(cells.map(|(column, label)| (label.as_str(), (row, column))));
    }
    electrodes
}

fn size_mistakes(grid: &Grid) -> Vec<Mistake> {
    let mut mistakes = Vec::new();
    let columns = grid.cells.iter().map(Vec::len).max().unwrap_or(0);
    let sides = 1..=LARGEST_SIDE;
    if !sides.contains(&grid.rows) || !sides.contains(&columns) {
        let rows = grid.rows;
        mistakes.push(Mistake::GridSize { rows, columns });
    }
    for (row, cells) in (1..).zip(&grid.cells) {
        if cells.len() != grid.columns {
            mistakes.push(Mistake::UnevenRow {
                row,
                found: cells.len(),
                expected: grid.columns,
            });
        }
    }
    mistakes
}

fn label_mistakes(grid: &Grid) -> Vec<Mistake> {
    let mut mistakes = Vec::new();
    let all = electrodes(grid);
    for (index, &(label, cell)) in all.iter().enumerate() {
        let electrode = Electrode::parse(label);
        if electrode.is_none() {
            let label = label.to_owned();
            mistakes.push(Mistake::UnknownElectrode { label, cell });
        }
        let same_label = all[..index].iter().find(|(other, _)| *other == label);
        let same_electrode = all[..index]
            .iter()
            .find(|(other, _)| electrode.is_some() && Electrode::parse(other) == electrode);
        if let Some(&(_, first)) = same_label {
            mistakes.push(Mistake::DoubledCell {
                label: label.to_owned(),
                cells: [first, cell],
            });
        } else if let Some((other, _)) = same_electrode {
            mistakes.push(Mistake::DoubledElectrode {
                labels: [(*other).to_owned(), label.to_owned()],
            });
        }
    }
    mistakes
}

fn order_mistakes(grid: &[String], order: &[String]) -> Vec<Mistake> {
    let mut mistakes = Vec::new();
    for (index, label) in order.iter().enumerate() {
        let label = label.clone();
        if let Some(first) = order[..index].iter().position(|other| *other == label) {
            let channels = [first + 1, index + 1];
            mistakes.push(Mistake::DoubledChannel { label, channels });
        } else if !grid.contains(&label) {
            mistakes.push(Mistake::NoCell { label });
        }
    }
    let without = grid.iter().filter(|label| !order.contains(label));
    mistakes.extend(without.cloned().map(|label| Mistake::NoChannel { label }));
    mistakes
}

fn adc_mistakes(file: &MontageFile, electrodes: usize) -> Vec<Mistake> {
    let mut mistakes = Vec::new();
    let adc = file.adc();
    let (channels, gain, rate_hz) = (adc.channels, adc.gain, adc.rate_hz);
    if !ELECTRODES.contains(&electrodes) {
        mistakes.push(Mistake::Electrodes { found: electrodes });
    }
    let largest = CHIP_CHANNELS * LARGEST_CHAIN;
    if channels == 0 || channels > largest || !channels.is_multiple_of(CHIP_CHANNELS) {
        mistakes.push(Mistake::Channels { channels });
    }
    if electrodes > channels && electrodes <= largest {
        mistakes.push(Mistake::TooManyElectrodes {
            electrodes,
            channels,
            needed: electrodes.next_multiple_of(CHIP_CHANNELS),
        });
    }
    if !GAINS.contains(&gain) {
        mistakes.push(Mistake::Gain { gain });
    }
    if !ADC_RATES_HZ.contains(&rate_hz) {
        mistakes.push(Mistake::Rate { rate_hz });
    }
    mistakes
}

fn notes(grid: &Grid) -> Vec<Note> {
    let (rows, columns) = (grid.rows, grid.columns);
    let mut notes = Vec::new();
    if rows < POOLED[0] + REMOVED || columns < POOLED[1] + REMOVED {
        notes.push(Note::SmallGrid { rows, columns });
    }
    let all = electrodes(grid);
    for (index, &(label, (row, column))) in all.iter().enumerate() {
        for &(other, cell) in &all[index + 1..] {
            if cell != (row, column + 1) && cell != (row + 1, column) {
                continue;
            }
            let positions = Position::from_label(label).zip(Position::from_label(other));
            let degrees = positions.map_or(0.0, |(a, b)| a.angle_to(b).to_degrees());
            if degrees > FAR_DEGREES {
                notes.push(Note::FarNeighbours {
                    labels: [label.to_owned(), other.to_owned()],
                    degrees,
                });
            }
        }
    }
    notes
}

impl fmt::Display for MontageCheck {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}:", self.name)?;
        let widths = self.grid.cells.iter().flatten().map(String::len);
        let width = widths.max().unwrap_or(0) + 1;
        for row in &self.grid.cells {
            let cells: Vec<String> = row.iter().map(|label| format!("{label:width$}")).collect();
            writeln!(f, "  {}", cells.concat().trim_end())?;
        }
        for mistake in &self.mistakes {
            writeln!(f, "mistake: {mistake}")?;
        }
        for note in &self.notes {
            writeln!(f, "note: {note}")?;
        }
        if self.mistakes.is_empty() {
            writeln!(f, "{} electrodes, no mistake", self.grid.electrodes().len())?;
        }
        Ok(())
    }
}
