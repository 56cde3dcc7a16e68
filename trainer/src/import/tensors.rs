//! Collects the tensors of a model from a safetensors file, and reports all mistakes together.

use super::spec::Spec;
use crate::error::TrainerError;
use artifact::{
    Description, Geometry, List, ScalpGrid, Tensors, calibration_shapes, weight_shapes,
};
use safetensors::{Dtype, SafeTensors};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::Path;

/// Name of the counter in PyTorch's batch norm, which inference does not need.
const COUNTER: &str = "num_batches_tracked";
/// Prefix of the tensors from which the model is calibrated.
const CALIBRATION: &str = "calibration.";
/// Names of the tensors to compare with: windows, their codes and, optionally, their
/// reconstructions.
const REFERENCE: [&str; 3] = ["reference.windows", "reference.codes", "reference.reconstructions"];

/// The tensors of a file by name, with any names, shapes and element types.
#[derive(Debug)]
pub(super) struct StateDict(BTreeMap<String, Entry>);

#[derive(Debug)]
struct Entry {
    shape: Vec<usize>,
    /// Element type as in the file, for example `F32`.
    element_type: String,
    /// Elements, last dimension fastest; `None` if they are not 32-bit or 64-bit floats.
    values: Option<Vec<f32>>,
}

/// The tensors that an import takes from a file.
#[derive(Debug)]
pub(super) struct Collected {
    pub(super) weights: Tensors,
    /// Ranges from which the int8 scales are derived, or windows on which to measure these ranges.
    pub(super) calibration: Calibration,
    /// Windows and outputs of the exported network to compare with; `None` if the file has none.
    pub(super) reference: Option<Reference>,
}

/// Source of the ranges from which the int8 scales are derived.
#[derive(Debug)]
pub(super) enum Calibration {
    Ranges(Tensors),
    /// Windows, each in the order step, electrode (the last fastest), in units of `sd_uv`.
    Windows(Vec<Vec<f32>>),
}

/// Windows, with the codes and reconstructions of the exported network.
#[derive(Debug)]
pub(super) struct Reference {
    /// Windows on the scalp grid, each in the order step, row, column.
    pub(super) windows: Vec<Vec<f32>>,
    pub(super) codes: Vec<Vec<f32>>,
    /// Reconstruction of each window on the scalp grid; `None` if the file has none.
    pub(super) reconstructions: Option<Vec<Vec<f32>>>,
}

impl StateDict {
    /// Reads a safetensors file.
    ///
    /// # Errors
    /// If the file cannot be read or is no safetensors file.
    pub(super) fn read(path: &Path) -> Result<Self, TrainerError> {
        let bytes = std::fs::read(path).map_err(TrainerError::file(path))?;
        let file = SafeTensors::deserialize(&bytes)
            .map_err(|source| TrainerError::Safetensors(path.to_owned(), source))?;
        let entries = file.iter().map(|(name, view)| {
            let entry = Entry {
                shape: view.shape().to_vec(),
                element_type: view.dtype().to_string(),
                values: floats(view.dtype(), view.data()),
            };
            (name.to_owned(), entry)
        });
        Ok(Self(entries.collect()))
    }

    /// Returns weights, calibration and reference.
    ///
    /// # Errors
    /// The texts of all mistakes in names, shapes, element types and values.
    pub(super) fn collect(
        &self,
        spec: &Spec,
        description: &Description,
    ) -> Result<Collected, Vec<String>> {
        let mut search =
            Search { file: self, used: BTreeSet::new(), mistakes: Vec::new(), missing: Vec::new() };
        let dimensions = description.dimensions();
        let shapes = weight_shapes(description.mode, &Geometry::new(description));
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
        search.check_unused();
        match (calibration, search.mistakes.is_empty()) {
            (Some(calibration), true) => Ok(Collected { weights, calibration, reference }),
            _ => Err(search.mistakes),
        }
    }
}

/// A search for tensors in a file, and the mistakes found so far.
struct Search<'a> {
    file: &'a StateDict,
    used: BTreeSet<String>,
    mistakes: Vec<String>,
    /// For each missing tensor: index of its message in the list of mistakes, and expected shape.
    missing: Vec<(usize, Vec<usize>)>,
}

impl Search<'_> {
    /// Records a mistake for each entry of `[names]` that matches neither a tensor nor a layer.
    fn check_names<'n>(&mut self, spec: &Spec, names: impl Iterator<Item = &'n str>) {
        let names: Vec<&str> = names.collect();
        for entry in spec.names.keys() {
            let is_known = |name: &&str| {
                let rest = name.strip_prefix(entry.as_str());
                rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
            };
            if !names.iter().any(is_known) {
                self.mistakes.push(format!(
                    "[names] has {entry}, which is no tensor or layer of a model of this mode"
                ));
            }
        }
    }

    /// Returns the elements of a required tensor, or records what is wrong with the tensor. A
    /// length of 0 in `shape` stands for any length of at least 1.
    fn tensor(&mut self, name: &str, shape: &[usize]) -> Option<Vec<f32>> {
        self.used.insert(name.to_owned());
        let expected = in_words(shape);
        let Some(entry) = self.file.0.get(name) else {
            self.missing.push((self.mistakes.len(), shape.to_vec()));
            let mistake = format!("{name} is missing, expected with shape {expected}");
            self.mistakes.push(mistake);
            return None;
        };
        let fits = fits(&entry.shape, shape);
        if !fits {
            let found = List(&entry.shape);
            self.mistakes.push(format!("{name} has shape {found}, expected {expected}"));
        }
        let Some(values) = &entry.values else {
            self.mistakes.push(format!(
                "{name} has elements of type {}, expected F32 or F64; export `model.float()`",
                entry.element_type
            ));
            return None;
        };
        if let Some(index) = values.iter().position(|value| !value.is_finite()) {
            self.mistakes.push(format!(
                "{name}, element {index}, is {}, expected a finite number; the training diverged",
                values[index]
            ));
        }
        fits.then(|| values.clone())
    }

    /// Returns the rows of a required tensor; each row has the shape `row`.
    fn rows(&mut self, name: &str, row: &[usize]) -> Option<Vec<Vec<f32>>> {
        let values = self.tensor(name, &[&[0], row].concat())?;
        let length = row.iter().product();
        Some(values.chunks_exact(length).map(<[f32]>::to_vec).collect())
    }

    fn has(&self, name: &str) -> bool {
        self.file.0.contains_key(name)
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
        if !self.file.0.keys().any(|name| name.starts_with(CALIBRATION)) {
            self.mistakes.push(format!(
                "calibration.windows is missing, expected with shape {}: some hundred windows of \
                 the training data, from which the ranges of the integers are measured; or \
                 calibration.input.max_abs (uV), .code.min, .code.max, .activation1.max and \
                 .activation2.max",
                in_words(&[&[0], window].concat())
            ));
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
        let [windows_name, codes_name, reconstructions_name] = REFERENCE;
        let missing = match (self.has(windows_name), self.has(codes_name)) {
            (false, false) => return None,
            (true, true) => None,
            (true, false) => Some(codes_name),
            (false, true) => Some(windows_name),
        };
        if let Some(missing) = missing {
            self.mistakes.push(format!(
                "{missing} is missing; {windows_name} and {codes_name} are checked together"
            ));
            self.used.extend(REFERENCE.map(str::to_owned));
            return None;
        }
        let windows = self.rows(windows_name, window);
        let count = windows.as_ref().map_or(0, Vec::len);
        let codes = self.rows(codes_name, &[numbers]);
        let reconstructions = if self.has(reconstructions_name) {
            Some(self.rows(reconstructions_name, window)?)
        } else {
            None
        };
        let (windows, codes) = (windows?, codes?);
        let others = reconstructions.as_ref().map_or(count, Vec::len);
        for (name, found, row) in
            [(codes_name, codes.len(), &[numbers][..]), (reconstructions_name, others, window)]
        {
            if found != count {
                let [found, expected] = [found, count].map(|count| [&[count], row].concat());
                let (found, expected) = (List(&found), in_words(&expected));
                self.mistakes.push(format!("{name} has shape {found}, expected {expected}"));
                return None;
            }
        }
        Some(Reference { windows, codes, reconstructions })
    }

    /// Records a mistake for each tensor of windows that has values other than 0 in cells without
    /// an electrode.
    fn check_empty_cells(&mut self, description: &Description) {
        let dimensions = description.dimensions();
        let (cells, columns) = (dimensions.cells(), dimensions.columns);
        let grid = ScalpGrid::new(description);
        let is_empty = |cell: usize| !grid.cell_of_electrode().contains(&cell);
        for name in ["calibration.windows", "reference.windows"] {
            let entry = self.file.0.get(name);
            let values = entry.and_then(|entry| entry.values.as_ref());
            let found = values.and_then(|values| {
                let is_wrong = |(at, value): (usize, &f32)| *value != 0.0 && is_empty(at % cells);
                (0..).zip(values).position(is_wrong)
            });
            if let Some(at) = found {
                let (window, cell) = (at / dimensions.window_cells(), at % cells);
                self.mistakes.push(format!(
                    "{name}, window {window}, has a value in row {}, column {} (counted from 0), \
                     where the montage has no electrode; expected 0",
                    cell / columns,
                    cell % columns
                ));
            }
        }
    }

    /// Records a mistake for each tensor that is not part of the model, and suggests it for a
    /// missing tensor of the same shape.
    fn check_unused(&mut self) {
        let unused = self.file.0.iter();
        let unused: Vec<_> = unused
            .filter(|(name, _)| !self.used.contains(*name) && !name.ends_with(COUNTER))
            .collect();
        for (mistake, shape) in &self.missing {
            let same = unused.iter().filter(|(_, entry)| entry.shape == *shape);
            let same: Vec<&str> = same.map(|(name, _)| name.as_str()).collect();
            if !same.is_empty() {
                // Writing to a string cannot fail.
                let _ = write!(
                    self.mistakes[*mistake],
                    "; {} of the file has this shape: if it is the same tensor, add it to [names]",
                    same.join(" or ")
                );
            }
        }
        self.mistakes.extend(unused.iter().map(|(name, _)| {
            format!(
                "{name} is no part of a model of this mode; rename it in [names], or leave it out \
                 of the file"
            )
        }));
    }
}

/// Returns whether a found shape matches the expected shape. An expected length of 0 stands for any
/// length of at least 1.
fn fits(found: &[usize], expected: &[usize]) -> bool {
    let is_right = |(found, expected): (&usize, &usize)| match *expected {
        0 => *found > 0,
        expected => *found == expected,
    };
    found.len() == expected.len() && found.iter().zip(expected).all(is_right)
}

/// Formats an expected shape in brackets, with N for a length of 0, which stands for any length.
fn in_words(shape: &[usize]) -> String {
    let lengths = shape.iter().map(|length| match length {
        0 => "N".to_owned(),
        length => length.to_string(),
    });
    format!("[{}]", lengths.collect::<Vec<_>>().join(", "))
}

#[expect(clippy::cast_possible_truncation, reason = "weights are stored as f32")]
fn floats(element_type: Dtype, bytes: &[u8]) -> Option<Vec<f32>> {
    match element_type {
        Dtype::F32 => {
            let words = bytes.as_chunks().0.iter();
            Some(words.map(|word| f32::from_le_bytes(*word)).collect())
        }
        Dtype::F64 => {
            let words = bytes.as_chunks().0.iter();
            Some(words.map(|word| f64::from_le_bytes(*word) as f32).collect())
        }
        _ => None,
    }
}
