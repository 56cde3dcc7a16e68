//! The files of the trained model from which this crate was generated, for programs on a PC that
//! decode codes. A program that does not use them does not contain them.

/// Names and contents of the files that the model id covers, for `artifact::Artifact::from_files`.
pub const FILES: &[(&str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/artifact_files.rs"));
