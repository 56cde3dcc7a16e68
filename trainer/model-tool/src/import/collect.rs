//! Finds the tensors of a model in a file, and every mistake at once.

use super::mistake::Mistake;
use super::spec::Spec;
use super::state_dict::StateDict;
use artifact::{
    Description, Dimensions, Geometry, ScalpGrid, Tensors, calibration_shapes, weight_shapes,
};
use std::collections::BTreeSet;

/// Counter of PyTorch's batch norm, which inference does not need.
const COUNTER: &str = "num_batches_tracked";
/// Prefix of the tensors from which the model is calibrated.
const CALIBRATION: &str = "calibration.";

/// What a file holds.
#[derive(Debug)]
pub(super) struct Collected {
    /// Weights with the names of this project.
    pub(super) weights: Tensors,
    /// How to calibrate.
    pub(super) calibration: Calibration,
    /// What to compare with, if the file has it.
    pub(super) reference: Option<Reference>,
}

/// Source of the ranges from which the int8 scales are derived.
#[derive(Debug)]
pub(super) enum Calibration {
    /// Measured ranges.
    Ranges(Tensors),
    /// Windows, each in the order step, electrode (the last fastest), in units of `sd_uv`.
    Windows(Vec<Vec<f32>>),
}

/// Windows, and what the exported network computes from them.
#[derive(Debug)]
pub(super) struct Reference {
    /// Windows on the scalp grid, each in the order step, row, column.
    pub(super) windows: Vec<Vec<f32>>,
    /// Code of each window.
    pub(super) codes: Vec<Vec<f32>>,
    /// Reconstruction of each window on the scalp grid, if the file has it.
    pub(super) reconstructions: Option<Vec<Vec<f32>>>,
}

/// Returns weights, calibration and reference of a file.
///
/// # Errors
/// Every mistake in names, shapes, element types and values.
pub(super) fn collect(
    file: &StateDict,
    spec: &Spec,
    description: &Description,
) -> Result<Collected, Vec<Mistake>> {
    let mut search = Search {
        file,
        used: BTreeSet::new(),
        mistakes: Vec::new(),
    };
    let dimensions = description.dimensions();
    let geometry = Geometry::new(description);
    let shapes = weight_shapes(description.mode, &geometry);
    search.check_names(spec, shapes.iter().map(|(name, _)| *name));
    let mut weights = Tensors::for_weights();
    for (name, shape) in shapes {
        if let Some(values) = search.tensor(&spec.name_in_file(name), &shape) {
            weights.insert(name, &shape, values);
        }
    }
    let window = [1, dimensions.steps, dimensions.rows, dimensions.columns];
    let calibration = search.calibration(description, &window);
    let reference = search.reference(&window, dimensions.numbers);
    search.check_empty_cells(description);
    search.report_unused();
    match (calibration, search.mistakes.is_empty()) {
        (Some(calibration), true) => Ok(Collected {
            weights,
            calibration,
            reference,
        }),
        _ => Err(search.mistakes),
    }
}

/// A search in a file, and the mistakes found so far.
struct Search<'a> {
    file: &'a StateDict,
    used: BTreeSet<String>,
    mistakes: Vec<Mistake>,
}

impl Search<'_> {
    /// Reports entries of `[names]` that are neither a tensor nor a layer.
    fn check_names<'n>(&mut self, spec: &Spec, names: impl Iterator<Item = &'n str>) {
        let names: Vec<&str> = names.collect();
        for entry in spec.names.keys() {
            let is_known = |name: &&str| {
                let rest = name.strip_prefix(entry.as_str());
                rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
            };
            if !names.iter().any(is_known) {
                self.mistakes.push(Mistake::Name {
                    name: entry.clone(),
                });
            }
        }
    }

    /// Returns the elements of a tensor that must be there. A length of 0 in `shape` stands for any length but 0.
    fn tensor(&mut self, name: &str, shape: &[usize]) -> Option<Vec<f32>> {
        self.used.insert(name.to_owned());
        let Some(entry) = self.file.get(name) else {
            self.mistakes.push(Mistake::Missing {
                name: name.to_owned(),
                expected: shape.to_vec(),
                candidates: Vec::new(),
            });
            return None;
        };
        if !fits(&entry.shape, shape) {
            self.mistakes.push(Mistake::Shape {
                name: name.to_owned(),
                found: entry.shape.clone(),
                expected: shape.to_vec(),
            });
        }
        let Some(values) = &entry.values else {
            self.mistakes.push(Mistake::ElementType {
                name: name.to_owned(),
                found: entry.element_type.clone(),
            });
            return None;
        };
        if let Some(index) = values.iter().position(|value| !value.is_finite()) {
            self.mistakes.push(Mistake::NotFinite {
                name: name.to_owned(),
                index,
                value: values[index],
            });
        }
        fits(&entry.shape, shape).then(|| values.clone())
    }

    /// Returns the rows of a tensor whose first dimension is their number.
    fn rows(&mut self, name: &str, row: &[usize]) -> Option<Vec<Vec<f32>>> {
        let values = self.tensor(name, &[&[0], row].concat())?;
        let length = row.iter().product();
        Some(values.chunks_exact(length).map(<[f32]>::to_vec).collect())
    }

    fn has(&self, name: &str) -> bool {
        self.file.get(name).is_some()
    }

    fn calibration(&mut self, description: &Description, window: &[usize]) -> Option<Calibration> {
        let windows = format!("{CALIBRATION}windows");
        if self.has(&windows) {
            let windows = self.rows(&windows, window)?;
            let grid = ScalpGrid::new(description);
            return Some(Calibration::Windows(
                windows.iter().map(|window| grid.gather(window)).collect(),
            ));
        }
        let mut tensors = self.file.iter();
        if !tensors.any(|(name, _)| name.starts_with(CALIBRATION)) {
            let window = window.to_vec();
            self.mistakes.push(Mistake::NoCalibration { window });
            return None;
        }
        let mut ranges = Tensors::for_calibration();
        let mut complete = true;
        for (name, shape) in calibration_shapes(description.mode, &description.dimensions()) {
            match self.tensor(&format!("{CALIBRATION}{name}"), &shape) {
                Some(values) => ranges.insert(name, &shape, values),
                None => complete = false,
            }
        }
        complete.then_some(Calibration::Ranges(ranges))
    }

    fn reference(&mut self, window: &[usize], numbers: usize) -> Option<Reference> {
        let names = [
            "reference.windows",
            "reference.codes",
            "reference.reconstructions",
        ];
        let [windows, codes, name] = names;
        match (self.has(windows), self.has(codes)) {
            (false, false) => return None,
            (true, true) => {}
            (has_windows, _) => {
                let missing = if has_windows { codes } else { windows };
                self.mistakes.push(Mistake::HalfReference { missing });
                self.used.extend(names.map(str::to_owned));
                return None;
            }
        }
        let windows = self.rows(windows, window);
        let count = windows.as_ref().map_or(0, Vec::len);
        let codes = self.rows(codes, &[numbers]);
        let reconstructions = if self.has(name) {
            Some(self.rows(name, window)?)
        } else {
            None
        };
        let (windows, codes) = (windows?, codes?);
        let rows = [
            Some(("reference.codes", codes.len(), vec![numbers])),
            reconstructions
                .as_ref()
                .map(|rows| (name, rows.len(), window.to_vec())),
        ];
        for (name, found, row) in rows.into_iter().flatten() {
            if found != count {
                self.mistakes.push(Mistake::Shape {
                    name: name.to_owned(),
                    found: [vec![found], row.clone()].concat(),
                    expected: [vec![count], row].concat(),
                });
                return None;
            }
        }
        Some(Reference {
            windows,
            codes,
            reconstructions,
        })
    }

    /// Reports windows with values in cells without an electrode.
    fn check_empty_cells(&mut self, description: &Description) {
        let Dimensions { columns, .. } = description.dimensions();
        let cells = description.dimensions().cells();
        let grid = ScalpGrid::new(description);
        let empty = |cell: usize| !grid.cell_of_electrode().contains(&cell);
        for name in ["calibration.windows", "reference.windows"] {
            let values = self.file.get(name).and_then(|entry| entry.values.as_ref());
            let found = values.and_then(|values| {
                let is_wrong = |(at, value): &(usize, &f32)| **value != 0.0 && empty(at % cells);
                values.iter().enumerate().find(is_wrong)
            });
            if let Some((at, _)) = found {
                let cell = at % cells;
                self.mistakes.push(Mistake::EmptyCell {
                    name: name.to_owned(),
                    window: at / description.dimensions().window_cells(),
                    cell: [cell / columns, cell % columns],
                });
            }
        }
    }

    /// Reports tensors that nothing asked for, or proposes them where one of their shape is missing.
    fn report_unused(&mut self) {
        let unused: Vec<_> = self
            .file
            .iter()
            .filter(|(name, _)| !self.used.contains(*name) && !name.ends_with(COUNTER))
            .collect();
        for mistake in &mut self.mistakes {
            if let Mistake::Missing {
                expected,
                candidates,
                ..
            } = mistake
            {
                let same = unused.iter().filter(|(_, entry)| entry.shape == *expected);
                candidates.extend(same.map(|(name, _)| (*name).to_owned()));
            }
        }
        let unknown = unused.into_iter().map(|(name, _)| Mistake::Unknown {
            name: name.to_owned(),
        });
        self.mistakes.extend(unknown);
    }
}

/// Returns whether a shape is the expected one, in which 0 stands for any length but 0.
fn fits(found: &[usize], expected: &[usize]) -> bool {
    let mut lengths = found.iter().zip(expected);
    let is_right = |(found, expected): (&usize, &usize)| match *expected {
        0 => *found > 0,
        expected => *found == expected,
    };
    found.len() == expected.len() && lengths.all(is_right)
}
