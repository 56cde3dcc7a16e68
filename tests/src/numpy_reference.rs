//! Runs of `tests/*.py`: the networks once more, in numpy, by programs that share no line with ours.

use std::fs;
use std::io;
use std::path::Path;
use std::process::Command;

use artifact::{CODE, IntegerCode, STEPS};
use model_gen::{IntegerModel, Plane};

use crate::{skip::skipped, workspace};

/// Debian's own Python: another one may have no numpy.
const PYTHON: &str = "/usr/bin/python3";

/// A run without a result.
#[derive(Debug, thiserror::Error)]
pub enum NumpyError {
    /// A file between the programs, or Python itself.
    #[error("{0}: is {PYTHON} there, and the temporary folder writable?")]
    Io(#[from] io::Error),
    /// Python ended with an error.
    #[error("{PYTHON} {script} failed; it said:\n{message}")]
    Failed {
        /// The program.
        script: String,
        /// Its standard error.
        message: String,
    },
}

/// Whether there is a numpy; says loudly that `test` is skipped when there is not.
///
/// # Panics
/// When there is none and `CORTICODE_REQUIRE_ROS=1`, as in CI.
pub fn is_there(test: &str) -> bool {
    let asked = Command::new(PYTHON).args(["-c", "import numpy"]).output();
    if asked.is_ok_and(|output| output.status.success()) {
        return true;
    }
    let why = format!("{PYTHON} has no numpy; `apt-get install python3-numpy`");
    let required = std::env::var("CORTICODE_REQUIRE_ROS").is_ok_and(|value| value == "1");
    assert!(!required, "{test}: CORTICODE_REQUIRE_ROS=1, and {why}");
    skipped(test, &why);
    false
}

/// The codes that numpy computes from the integers of a model.
///
/// # Errors
/// When Python fails or the files between cannot be written.
///
/// # Panics
/// When a window has not 16 planes, or an exponent is none.
pub fn integer_codes<'w>(
    model: &IntegerModel,
    windows: impl IntoIterator<Item = &'w [Plane]>,
) -> Result<Vec<IntegerCode>, NumpyError> {
    let folder = tempfile::tempdir()?;
    let folder = folder.path();
    write_model(folder, model)?;
    let cells = windows.into_iter().flat_map(|window| {
        assert_eq!(window.len(), STEPS, "planes of a window");
        window.as_flattened()
    });
    write(folder, "windows", cells.copied())?;
    run("encoder_numpy.py", folder)?;
    let bytes = fs::read(folder.join("codes.i16"))?;
    let integers = bytes.as_chunks().0.iter().copied().map(i16::from_le_bytes);
    let integers: Vec<i16> = integers.collect();
    let codes = integers.as_chunks::<{ 1 + CODE }>().0.iter();
    Ok(codes
        .map(|&[exponent, ref values @ ..]| IntegerCode {
            exponent: u8::try_from(exponent).expect("an exponent of 0 to 8"),
            values: *values,
        })
        .collect())
}

/// Runs a program of `tests/tests` on a folder and passes on what it prints.
///
/// # Errors
/// When Python does not start or the program fails.
pub fn run(script: &str, folder: &Path) -> Result<(), NumpyError> {
    let path = workspace::root().join("tests/tests").join(script);
    let output = Command::new(PYTHON).arg(path).arg(folder).output()?;
    if output.status.success() {
        print!("{}", String::from_utf8_lossy(&output.stdout));
        return Ok(());
    }
    Err(NumpyError::Failed {
        script: script.to_owned(),
        message: String::from_utf8_lossy(&output.stderr).into_owned(),
    })
}

/// What `encoder_numpy.py` reads of a model.
fn write_model(folder: &Path, model: &IntegerModel) -> io::Result<()> {
    let geometry = &model.geometry;
    let parts = [model.mode.has_convolutions(), model.mode.has_shortcut()];
    write(folder, "parts", parts.map(u8::from))?;
    let lengths = |lengths: [usize; 3]| lengths.map(|n| u8::try_from(n).expect("a grid's length"));
    write(folder, "pads", lengths(geometry.padding.pads()))?;
    write(folder, "pool", lengths(geometry.pool))?;
    write(folder, "hidden_padding", model.hidden_padding)?;
    for (name, conv) in [("conv1", &model.conv1), ("conv2", &model.conv2)] {
        write(folder, &format!("{name}.weights"), conv.weights.clone())?;
        write(folder, &format!("{name}.bias"), conv.bias.clone())?;
        let multipliers = conv.multipliers.clone();
        write(folder, &format!("{name}.multipliers"), multipliers)?;
    }
    for (name, linear) in [("fc", &model.fc), ("shortcut", &model.shortcut)] {
        write(folder, &format!("{name}.weights"), linear.weights.clone())?;
        let multipliers = linear.multipliers.clone();
        write(folder, &format!("{name}.multipliers"), multipliers)?;
    }
    write(folder, "fc.bias", model.fc_bias)?;
    write(folder, "cells", model.cells)?;
    write(folder, "zero_point", model.code_zero_point)?;
    let [least, greatest] = model.code_format.range();
    let exponent = model.code_format.largest_exponent();
    write(folder, "code.range", [least, greatest, exponent.into()])
}

/// Integers of any width as 64 bits, little endian.
fn write(folder: &Path, name: &str, values: impl IntoIterator<Item: Into<i64>>) -> io::Result<()> {
    let values = values.into_iter().map(Into::<i64>::into);
    let bytes: Vec<u8> = values.flat_map(i64::to_le_bytes).collect();
    fs::write(folder.join(format!("{name}.i64")), bytes)
}
