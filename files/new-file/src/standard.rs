//! Printing to standard output and standard error without a panic if the reader has closed the
//! pipe.

use std::fmt::Display;
use std::io::{self, ErrorKind, Write};

use crate::error::NewFileError;

/// Prints a text to standard output. Does nothing if the reader has closed the pipe, as `head` does
/// after the first lines; `println!` would panic.
///
/// # Errors
/// [`NewFileError::Write`] if the output cannot be written for another reason, such as a full disk.
pub fn print(text: impl Display) -> Result<(), NewFileError> {
    let mut out = io::stdout().lock();
    match write!(out, "{text}").and_then(|()| out.flush()) {
        Err(source) if source.kind() != ErrorKind::BrokenPipe => {
            Err(NewFileError::Write { path: "standard output".into(), source })
        }
        _ => Ok(()),
    }
}

/// Prints a line to standard error; call it through [`message!`](crate::message!).
pub fn print_message(line: impl Display) {
    // An error is ignored, because there is no other place to report it.
    let _ = writeln!(io::stderr(), "{line}");
}

/// Prints a line to standard error as `eprintln!` does, but without a panic if the pipe is closed.
#[macro_export]
macro_rules! message {
    ($($text:tt)*) => { $crate::print_message(format_args!($($text)*)) };
}
