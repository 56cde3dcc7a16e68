//! A tensor that is not as the specification describes it.

use artifact::List;
use std::fmt;

/// One mistake in a file of tensors.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Mistake {
    /// A tensor is missing.
    Missing {
        /// Name that was looked up.
        name: String,
        /// Shape that it must have.
        expected: Vec<usize>,
        /// Tensors of the file with this shape that are not part of the model.
        candidates: Vec<String>,
    },
    /// A tensor has another shape.
    Shape {
        /// Name in the file.
        name: String,
        /// Shape in the file.
        found: Vec<usize>,
        /// Shape that it must have.
        expected: Vec<usize>,
    },
    /// A tensor has elements that are not floats of 32 or 64 bits.
    ElementType {
        /// Name in the file.
        name: String,
        /// Element type in the file.
        found: String,
    },
    /// An element is infinite or NaN.
    NotFinite {
        /// Name in the file.
        name: String,
        /// Index of the first such element, last dimension fastest.
        index: usize,
        /// Its value.
        value: f32,
    },
    /// A tensor is no part of the model.
    Unknown {
        /// Name in the file.
        name: String,
    },
    /// An entry of `[names]` is no tensor or layer of the model.
    Name {
        /// Name in the specification.
        name: String,
    },
    /// There is nothing from which the ranges of the integers could be measured.
    NoCalibration {
        /// Shape of a batch of windows, without the first dimension.
        window: Vec<usize>,
    },
    /// A window has a value in a cell without an electrode.
    EmptyCell {
        /// Name in the file.
        name: String,
        /// Index of the window.
        window: usize,
        /// Row and column of the cell.
        cell: [usize; 2],
    },
    /// There are windows without codes, or codes without windows.
    HalfReference {
        /// Tensor that is missing.
        missing: &'static str,
    },
}

impl fmt::Display for Mistake {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing {
                name,
                expected,
                candidates,
            } => {
                write!(
                    f,
                    "{name} is missing, expected with shape {}",
                    Shape(expected)
                )?;
                match candidates.as_slice() {
                    [] => Ok(()),
                    candidates => write!(
                        f,
                        "; {} of the file has this shape: if it is the same tensor, add it to [names]",
                        candidates.join(" or ")
                    ),
                }
            }
            Self::Shape {
                name,
                found,
                expected,
            } => write!(
                f,
                "{name} has shape {}, expected {}",
                List(found),
                Shape(expected)
            ),
            Self::ElementType { name, found } => write!(
                f,
                "{name} has elements of type {found}, expected F32 or F64; export `model.float()`"
            ),
            Self::NotFinite { name, index, value } => write!(
                f,
                "{name}, element {index}, is {value}, expected a finite number; the training diverged"
            ),
            Self::Unknown { name } => write!(
                f,
                "{name} is no part of a model of this mode; rename it in [names], or leave it out of the file"
            ),
            Self::Name { name } => write!(
                f,
                "[names] has {name}, which is no tensor or layer of a model of this mode"
            ),
            Self::NoCalibration { window } => write!(
                f,
                "calibration.windows is missing, expected with shape {}: some hundred windows of the training data, \
                 from which the ranges of the integers are measured; or calibration.input.max_abs (uV), .code.min, \
                 .code.max, .activation1.max and .activation2.max",
                Shape(&[&[0], window.as_slice()].concat())
            ),
            Self::EmptyCell {
                name,
                window,
                cell: [row, column],
            } => write!(
                f,
                "{name}, window {window}, has a value in row {row}, column {column} (counted from 0), where the \
                 montage has no electrode; expected 0"
            ),
            Self::HalfReference { missing } => write!(
                f,
                "{missing} is missing; reference.windows and reference.codes are checked together"
            ),
        }
    }
}

/// An expected shape in brackets; a length of 0 stands for any length but 0.
struct Shape<'a>(&'a [usize]);

impl fmt::Display for Shape<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let lengths = self.0.iter().map(|length| match length {
            0 => "N".to_owned(),
            length => length.to_string(),
        });
        write!(f, "[{}]", lengths.collect::<Vec<_>>().join(", "))
    }
}
