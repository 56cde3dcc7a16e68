//! Standard output and standard error, whose reader may leave before the program ends.

use std::fmt::Display;
use std::io::{self, ErrorKind, Write};

use crate::error::NewFileError;

/// Prints a text to standard output. Does nothing if its reader has gone, such as `head` after the
/// first lines; `println!` would panic.
///
/// # Errors
/// [`NewFileError::Write`] if the output cannot be written for another reason, such as a full disk.
pub fn print(text: impl Display) -> Result<(), NewFileError> {
    let mut out = io::stdout().lock();
    match write!(out, "{text}").and_then(|()| out.flush()) {
        Err(source) if source.kind() != ErrorKind::BrokenPipe => Err(NewFileError::Write {
            path: "standard output".into(),
            source,
        }),
        _ => Ok(()),
    }
}

/// Prints a line to standard error; call it through [`message!`](crate::message!).
pub fn print_message(line: impl Display) {
    // Nobody is left to be told that a message could not be written.
    let _ = writeln!(io::stderr(), "{line}");
}

/// Prints a line to standard error, as `eprintln!` does, but does nothing if its reader has gone.
#[macro_export]
macro_rules! message {
    ($($text:tt)*) => { $crate::print_message(format_args!($($text)*)) };
}
