//! Files that a user names as output, and standard output.
//!
//! A [`GrowingFile`] exists under its final name from the start. A [`NewFile`] appears under its
//! name only when it is complete. Until then its bytes are in a temporary file in the same folder,
//! so a killed program leaves no incomplete file under the name. An existing file is replaced only
//! if the user asks for it, and a file that the program reads is never overwritten.
//!
//! ```text
//! create ──> .NAME.XXXXXX.part ──> finish ──> NAME
//!            deleted on drop       renamed; keeps the temporary name if that fails
//! ```
//!
//! ```
//! use std::io::Write as _;
//!
//! use new_file::{Existing, NewFile};
//!
//! let folder = tempfile::tempdir()?;
//! let path = folder.path().join("codes.bin");
//! let mut file = NewFile::create(&path, Existing::Refuse, &[])?;
//! file.write_all(b"code")?;
//! assert!(!path.exists());
//! file.finish()?;
//! assert_eq!(std::fs::read(&path)?, b"code");
//! assert!(NewFile::create(&path, Existing::Refuse, &[]).is_err());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

mod destination;
mod error;
mod file;
mod growing;
mod standard;

pub use destination::Existing;
pub use error::NewFileError;
pub use file::NewFile;
pub use growing::GrowingFile;
pub use standard::{print, print_message};
