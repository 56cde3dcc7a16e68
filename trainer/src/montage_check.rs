//! Checks a montage file, compares a recording with it, and reports all mistakes at once, with
//! notes about what is permitted but unusual.

use crate::error::TrainerError;
use crate::selection::file_name;
use artifact::{
    ADC_RATES_HZ, CHIP_CHANNELS, ELECTRODES, EMPTY, GAINS, Grid, LARGEST_CHAIN, LARGEST_SIDE,
    MontageFile,
};
use packed_fit::FitError;
use recordings::montage_map::Origin;
use recordings::{Electrode, Missing, MontageMap, Position, Recording};
use std::fmt;
use std::path::Path;

/// Angle above which a note about neighbours on the grid is printed, degrees: twice the angle
/// between neighbours of the 10-20 system on the midline.
const FAR_DEGREES: f64 = 72.0;
/// Smallest numbers of rows and columns that a feature map needs for max-pools of 2 x 2 cells. The
/// pools of a row must cover at least three columns, so a row needs two pools.
const POOLED: [usize; 2] = [2, 4];
/// Number of rows, and of columns, that two convolutions of 3 x 3 cells without padding remove.
const REMOVED: usize = 4;

/// Row and column of a cell, from 1.
type Cell = (usize, usize);

/// Result of checking a montage file. `Display` prints the grid, all mistakes and all notes.
#[derive(Clone, Debug, PartialEq)]
pub struct MontageCheck {
    name: String,
    grid: Grid,
    /// Every mistake, in words. A model needs a montage without mistakes.
    pub mistakes: Vec<String>,
    /// Properties that limit the choice of a model or its quality, in words.
    pub notes: Vec<String>,
}

impl MontageCheck {
    /// Checks a montage file for mistakes and for unusual properties.
    pub fn new(file: &MontageFile) -> Self {
        let grid = file.grid();
        let mut mistakes = size_mistakes(&grid);
        mistakes.extend(label_mistakes(&grid));
        if let Some(order) = &file.order {
            mistakes.extend(order_mistakes(&grid.electrodes(), order));
        }
        mistakes.extend(adc_mistakes(file, grid.electrodes().len()));
        Self { name: file.name.clone(), notes: notes(&grid), grid, mistakes }
    }
}

fn list(values: &[u32]) -> String {
    let values: Vec<String> = values.iter().map(ToString::to_string).collect();
    values.join(", ")
}

/// Returns the label and the cell of each electrode, row by row.
fn electrodes(grid: &Grid) -> Vec<(&str, Cell)> {
    let mut electrodes = Vec::new();
    for (row, cells) in (1..).zip(&grid.cells) {
        let cells = (1..).zip(cells).filter(|(_, label)| *label != EMPTY);
        electrodes.extend(cells.map(|(column, label)| (label.as_str(), (row, column))));
    }
    electrodes
}

fn size_mistakes(grid: &Grid) -> Vec<String> {
    let mut mistakes = Vec::new();
    let (rows, expected) = (grid.rows, grid.columns);
    let columns = grid.cells.iter().map(Vec::len).max().unwrap_or(0);
    let sides = 1..=LARGEST_SIDE;
    if !sides.contains(&rows) || !sides.contains(&columns) {
        mistakes.push(format!(
            "the grid has {rows} rows and {columns} columns; 1 to {LARGEST_SIDE} of both are possible"
        ));
    }
    for (row, cells) in (1..).zip(&grid.cells) {
        let found = cells.len();
        if found != expected {
            mistakes.push(format!(
                "row {row} has {found} cells, row 1 has {expected}; fill the shorter one with _"
            ));
        }
    }
    mistakes
}

fn label_mistakes(grid: &Grid) -> Vec<String> {
    let mut mistakes = Vec::new();
    let all = electrodes(grid);
    for (index, &(label, (row, column))) in all.iter().enumerate() {
        let electrode = Electrode::parse(label);
        if electrode.is_none() {
            mistakes.push(format!(
                "{label} (row {row}, column {column}) is not an electrode of the 10-20, 10-10 or 10-5 \
                 system; write _ for an empty cell"
            ));
        }
        let is_same = |other: &str| electrode.is_some() && Electrode::parse(other) == electrode;
        let mut before = all[..index].iter();
        if let Some((_, first)) = before.clone().find(|(other, _)| *other == label) {
            mistakes.push(format!(
                "{label} is in two cells: row {}, column {} and row {row}, column {column}; empty one \
                 of them",
                first.0, first.1
            ));
        } else if let Some((other, _)) = before.find(|(other, _)| is_same(other)) {
            mistakes
                .push(format!("{other} and {label} are the same electrode; remove one of them"));
        }
    }
    mistakes
}

fn order_mistakes(grid: &[String], order: &[String]) -> Vec<String> {
    let mut mistakes = Vec::new();
    for (index, label) in order.iter().enumerate() {
        if let Some(first) = order[..index].iter().position(|other| other == label) {
            mistakes.push(format!(
                "{label} has two channels: {} and {}; remove one from the order",
                first + 1,
                index + 1
            ));
        } else if !grid.contains(label) {
            mistakes
                .push(format!("{label} is in the order of channels but in no cell of the grid"));
        }
    }
    let without = grid.iter().filter(|label| !order.contains(label));
    mistakes.extend(
        without.map(|label| format!("{label} is on the grid but not in the order of channels")),
    );
    mistakes
}

fn adc_mistakes(file: &MontageFile, electrodes: usize) -> Vec<String> {
    let mut mistakes = Vec::new();
    let adc = file.adc();
    let (channels, gain, rate_hz) = (adc.channels, adc.gain, adc.rate_hz);
    if !ELECTRODES.contains(&electrodes) {
        mistakes.push(format!(
            "the montage has {electrodes} electrodes; {} to {} are possible",
            ELECTRODES.start(),
            ELECTRODES.end()
        ));
    }
    let largest = CHIP_CHANNELS * LARGEST_CHAIN;
    if channels == 0 || channels > largest || !channels.is_multiple_of(CHIP_CHANNELS) {
        mistakes.push(format!(
            "no chain of converters has {channels} channels; write a multiple of {CHIP_CHANNELS} up \
             to {largest}"
        ));
    }
    if electrodes > channels && electrodes <= largest {
        let needed = electrodes.next_multiple_of(CHIP_CHANNELS);
        mistakes.push(format!(
            "{electrodes} electrodes need more than the {channels} channels; write channels = \
             {needed}, for {} converters",
            needed / CHIP_CHANNELS
        ));
    }
    if !GAINS.contains(&gain) {
        mistakes.push(format!("an ADS1299 has no gain of {gain}; it has {}", list(&GAINS)));
    }
    if !ADC_RATES_HZ.contains(&rate_hz) {
        mistakes.push(format!(
            "an ADS1299 has no rate of {rate_hz} Hz here; possible are {}",
            list(&ADC_RATES_HZ)
        ));
    }
    mistakes
}

fn notes(grid: &Grid) -> Vec<String> {
    let (rows, columns) = (grid.rows, grid.columns);
    let mut notes = Vec::new();
    if rows < POOLED[0] + REMOVED || columns < POOLED[1] + REMOVED {
        let fits = if rows < POOLED[0] || columns < POOLED[1] {
            "--mode pca"
        } else {
            "--padding space, or --mode pca"
        };
        notes.push(format!(
            "{rows} x {columns} cells are too few for convolutions without padding; what fits: {fits}"
        ));
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
                notes.push(format!(
                    "{label} and {other} are neighbours on the grid but {degrees:.0} degrees apart \
                     on the scalp (between Fz and Cz are 36)"
                ));
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

/// Comparison of a recording with a montage. `Display` prints the electrodes with their labels in
/// the recording, the electrodes to interpolate, and the signals that no electrode uses.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordingCheck {
    name: String,
    labels: Vec<String>,
    map: MontageMap,
}

impl RecordingCheck {
    /// Reads the labels of a recording and compares them with a montage.
    ///
    /// # Errors
    /// If the recording cannot be read or has no electrode of the montage.
    pub fn read(path: &Path, montage: &MontageFile) -> Result<Self, TrainerError> {
        let name = file_name(path);
        let recording =
            Recording::open(path).map_err(|source| FitError::Recording(name.clone(), source))?;
        let labels = recording.labels();
        let labels: Vec<String> = labels.iter().map(|label| (*label).to_owned()).collect();
        Self::new(name, labels, montage)
    }

    /// Compares the labels of a recording with a montage.
    ///
    /// # Errors
    /// If the recording has no electrode of the montage.
    pub fn new(
        name: String,
        labels: Vec<String>,
        montage: &MontageFile,
    ) -> Result<Self, TrainerError> {
        let electrodes = montage.montage().electrodes;
        match MontageMap::new(&labels, &electrodes, Missing::Interpolate) {
            Ok(map) => Ok(Self { name, labels, map }),
            Err(source) => Err(FitError::Montage(name, source).into()),
        }
    }
}

impl fmt::Display for RecordingCheck {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let origins = self.map.electrodes().iter().zip(self.map.origins());
        let recorded: Vec<String> = origins
            .filter_map(|(electrode, origin)| match origin {
                Origin::Real(signal) => {
                    let label = self.labels[*signal].trim();
                    Some(if label == electrode {
                        label.to_owned()
                    } else {
                        format!("{electrode} (as {label})")
                    })
                }
                Origin::Interpolated(_) | Origin::Zero => None,
            })
            .collect();
        let missing = self.map.interpolated();
        let unused = self.labels.iter().enumerate();
        let unused =
            unused.filter(|(signal, _)| !self.map.origins().contains(&Origin::Real(*signal)));
        let unused: Vec<&str> = unused.map(|(_, label)| label.trim()).collect();
        writeln!(f, "{}:", self.name)?;
        for (what, labels) in [
            ("recorded", recorded.iter().map(String::as_str).collect()),
            ("missing, would be interpolated", missing),
            ("signals that are no electrode of the montage", unused),
        ] {
            let labels: Vec<&str> = labels;
            let text = format!("  {what}: {} {}", labels.len(), labels.join(" "));
            writeln!(f, "{}", text.trim_end())?;
        }
        for warning in self.map.warnings() {
            writeln!(f, "  note: {warning}")?;
        }
        Ok(())
    }
}
