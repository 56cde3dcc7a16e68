//! Runs the networks' numpy implementations, `tests/acceptance/tests/it/*.py`, which share no code
//! with the Rust implementations.

use std::fs;
use std::io;
use std::path::Path;
use std::process::Command;

use artifact::{Dimensions, IntegerCode};
use model_gen::IntegerModel;

use emulator::skip::skip_unless_required;

use crate::workspace;

/// Path of Debian's Python. Another Python on the PATH may lack numpy.
const PYTHON: &str = "/usr/bin/python3";

/// Reason why a numpy program gave no result.
#[derive(Debug, thiserror::Error)]
pub enum NumpyError {
    /// Python does not start, or a file that is exchanged with it cannot be written or read.
    #[error("{0}: does {PYTHON} exist, and is the temporary folder writable?")]
    Io(#[from] io::Error),
    /// The Python program ended with an error.
    #[error("{PYTHON} {script} failed:\n{message}")]
    Failed {
        /// Name of the Python program, or of the array that it reads.
        script: String,
        /// What the program wrote to its standard error.
        message: String,
    },
}

/// Returns whether numpy is installed; reports `test` as skipped if it is not.
///
/// # Panics
/// When numpy is not installed and `CORTICODE_REQUIRE_ROS=1`, as in CI.
pub fn available(test: &str) -> bool {
    let import = Command::new(PYTHON).args(["-c", "import numpy"]).output();
    if import.is_ok_and(|output| output.status.success()) {
        return true;
    }
    let why = format!("{PYTHON} has no numpy; `apt-get install python3-numpy`");
    skip_unless_required(test, why);
    false
}

/// Returns the codes that `encoder_numpy.py` computes for `windows` from the integers of `model`.
///
/// # Errors
/// When Python fails, or an exchanged file cannot be written or read.
///
/// # Panics
/// When a window has another length than the model's windows, or an exponent is out of range.
pub fn integer_codes<'w>(
    model: &IntegerModel,
    windows: impl IntoIterator<Item = &'w [i8]>,
) -> Result<Vec<IntegerCode>, NumpyError> {
    let folder = tempfile::tempdir()?;
    let folder = folder.path();
    write_model(folder, model)?;
    let dimensions = &model.geometry.dimensions;
    let cells = windows.into_iter().flat_map(|window| {
        assert_eq!(window.len(), dimensions.window_cells(), "cells of a window");
        window
    });
    write(folder, "windows", cells.copied())?;
    run("encoder_numpy.py", folder)?;
    let bytes = fs::read(folder.join("codes.i16"))?;
    let integers = bytes.as_chunks().0.iter().copied().map(i16::from_le_bytes);
    let integers: Vec<i16> = integers.collect();
    let codes = integers.chunks_exact(1 + dimensions.numbers);
    Ok(codes
        .map(|code| IntegerCode {
            exponent: u8::try_from(code[0]).expect("an exponent of 0 to 8"),
            values: code[1..].to_vec(),
        })
        .collect())
}

/// Returns the values of the array `name` in the `.npz` file `archive`, in row-major order.
///
/// # Errors
/// When Python fails, or the file has no such array.
pub fn array(archive: &Path, name: &str) -> Result<Vec<f64>, NumpyError> {
    let program = "import sys, numpy\n\
                   array = numpy.load(sys.argv[1])[sys.argv[2]]\n\
                   sys.stdout.buffer.write(array.astype('<f8').tobytes())";
    let mut python = Command::new(PYTHON);
    let bytes = output(python.args(["-c", program]).arg(archive).arg(name), name)?;
    let values = bytes.as_chunks().0.iter().copied().map(f64::from_le_bytes);
    Ok(values.collect())
}

/// Runs the Python program `script` with `folder` as its argument, and prints the program's output.
/// A relative path starts at `tests/acceptance/tests/it`.
///
/// # Errors
/// When Python does not start or the program fails.
pub fn run(script: impl AsRef<Path>, folder: &Path) -> Result<(), NumpyError> {
    let script = script.as_ref();
    let path = workspace::root().join("tests/acceptance/tests/it").join(script);
    let mut python = Command::new(PYTHON);
    let printed = output(python.arg(path).arg(folder), &script.to_string_lossy())?;
    print!("{}", String::from_utf8_lossy(&printed));
    Ok(())
}

/// Returns what `python` writes to its standard output; an error names the program `script`.
fn output(python: &mut Command, script: &str) -> Result<Vec<u8>, NumpyError> {
    let output = python.output()?;
    if output.status.success() {
        return Ok(output.stdout);
    }
    Err(NumpyError::Failed {
        script: script.to_owned(),
        message: String::from_utf8_lossy(&output.stderr).into_owned(),
    })
}

/// Writes `model` to `folder` as the files that `encoder_numpy.py` reads.
fn write_model(folder: &Path, model: &IntegerModel) -> io::Result<()> {
    let geometry = &model.geometry;
    let parts = [model.mode.has_convolutions(), model.mode.has_shortcut()];
    write(folder, "parts", parts.map(u8::from))?;
    let lengths = |lengths: [usize; 3]| lengths.map(|n| u8::try_from(n).expect("a grid's length"));
    let Dimensions { steps, rows, columns, .. } = geometry.dimensions;
    write(folder, "window", lengths([steps, rows, columns]))?;
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
    write(folder, "fc.bias", model.fc.bias.clone())?;
    write(folder, "cells", model.cells.clone())?;
    write(folder, "zero_point", model.code_zero_point.clone())?;
    let [least, greatest] = model.code_format.range();
    let exponent = model.code_format.largest_exponent();
    write(folder, "code.range", [least, greatest, exponent.into()])
}

/// Writes integers to the file `NAME.i64` in `folder`, each as 64 bits, little endian.
fn write(folder: &Path, name: &str, values: impl IntoIterator<Item: Into<i64>>) -> io::Result<()> {
    let values = values.into_iter().map(Into::<i64>::into);
    let bytes: Vec<u8> = values.flat_map(i64::to_le_bytes).collect();
    fs::write(folder.join(format!("{name}.i64")), bytes)
}
