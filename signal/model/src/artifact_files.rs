//! The files of the trained model from which this crate was generated, for programs on a PC that
//! decode codes. The linker removes the files from programs that do not use them.

/// Names and contents of the files that the model id covers, for `artifact::Artifact::from_files`.
pub const FILES: &[(&str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/artifact_files.rs"));
