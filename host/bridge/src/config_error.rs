//! Errors of reading a configuration file.

use std::io;

use thiserror::Error;

/// Reason why a configuration file cannot be used.
#[derive(Debug, Error)]
pub enum ConfigError {
    /// The operating system cannot read the file, or the file is not UTF-8.
    #[error("it cannot be read; check the path and the permissions")]
    Read(#[source] io::Error),
    /// The file is not TOML.
    #[error(
        "line {line}: {message}; write each option as in: port = \"/dev/ttyACM0\"; strings need \
         quotation marks"
    )]
    Syntax {
        /// Line, from 1.
        line: usize,
        /// What the parser of TOML reports.
        message: String,
    },
    /// A key is the name of no option.
    #[error("line {line}: the key {key} is not known; known are {known}")]
    UnknownKey {
        /// Line, from 1.
        line: usize,
        /// Key in the file.
        key: String,
        /// All keys, separated by commas.
        known: String,
    },
    /// A value has another type than the option.
    #[error("line {line}: {key} is of type {found}, and must be {expected}")]
    Type {
        /// Line, from 1.
        line: usize,
        /// Key in the file.
        key: String,
        /// Type in the file.
        found: &'static str,
        /// Type of the option.
        expected: &'static str,
    },
    /// The option cannot have this value.
    #[error("line {line}: {key}: {message}")]
    Value {
        /// Line, from 1.
        line: usize,
        /// Key in the file.
        key: String,
        /// What is wrong, and which values are possible.
        message: String,
    },
}
