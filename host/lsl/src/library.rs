//! Finds and loads liblsl.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use thiserror::Error;

use crate::liblsl::{Functions, LoadError};

/// File names under which the system's loader finds liblsl.
const SYSTEM_NAMES: &[&str] = if cfg!(target_os = "macos") {
    &["liblsl.dylib", "liblsl.2.dylib"]
} else {
    &["liblsl.so.2", "liblsl.so"]
};

/// Python program that prints the path of the library in the package pylsl, without importing the
/// package.
const FIND_IN_PYLSL: &str = "import importlib.util, pathlib
spec = importlib.util.find_spec('pylsl')
for place in spec.submodule_search_locations if spec else []:
    for name in ('liblsl.so', 'liblsl.so.2', 'liblsl.dylib'):
        file = pathlib.Path(place, 'lib', name)
        if file.exists():
            print(file)
            raise SystemExit";

/// Advice for the user if liblsl is missing; a part of error messages.
const REMEDY: &str = "`pip install pylsl` brings it and is found through python3 on the PATH; or \
     install liblsl from https://github.com/sccn/liblsl/releases; or name its file with --liblsl";

/// The loaded liblsl. It stays loaded until the process ends.
#[derive(Clone, Copy, Debug)]
pub struct Library {
    pub(crate) functions: &'static Functions,
}

/// Why liblsl cannot be used.
#[derive(Debug, Error)]
pub enum LibraryError {
    /// The file that the user named cannot be loaded.
    #[error("{} cannot be loaded as liblsl; name the shared library of liblsl 1.13 or later", .0.display())]
    File(PathBuf, #[source] LoadError),
    /// No liblsl was found.
    #[error("liblsl, the library of the Lab Streaming Layer, is not installed: {REMEDY}")]
    Missing,
    /// The liblsl of this system cannot be used.
    #[error("the system's {0} cannot be used: {REMEDY}")]
    System(String, #[source] LoadError),
}

impl Library {
    /// Loads liblsl from `file`. With `None`, tries the system's libraries, then the package pylsl
    /// of the `python3` on the PATH.
    ///
    /// # Errors
    ///
    /// [`LibraryError`], with the remedy.
    pub fn load(file: Option<&Path>) -> Result<Library, LibraryError> {
        if let Some(file) = file {
            let functions = Functions::load(file.as_os_str());
            let functions =
                functions.map_err(|error| LibraryError::File(file.to_owned(), error))?;
            return Ok(Library { functions });
        }
        let mut unusable = None;
        for name in SYSTEM_NAMES {
            match Functions::load(name.as_ref()) {
                Ok(functions) => return Ok(Library { functions }),
                Err(LoadError::Open(_)) => {}
                Err(error) => unusable = Some(LibraryError::System((*name).to_owned(), error)),
            }
        }
        let Some(file) = in_pylsl() else {
            return Err(unusable.unwrap_or(LibraryError::Missing));
        };
        let functions = Functions::load(file.as_os_str());
        let functions = functions.map_err(|error| LibraryError::File(file, error))?;
        Ok(Library { functions })
    }

    /// Returns version and build of liblsl, as it describes itself.
    pub fn description(self) -> String {
        let version = self.functions.library_version();
        let info = self.functions.library_info();
        format!("liblsl {}.{}: {info}", version / 100, version % 100)
    }
}

/// Returns the path of the library in the package pylsl, if Python has one.
fn in_pylsl() -> Option<PathBuf> {
    let mut python = Command::new("python3");
    let python = python.args(["-c", FIND_IN_PYLSL]).stdin(Stdio::null());
    let output = python.output().ok()?;
    let path = String::from_utf8(output.stdout).ok()?;
    let path = path.trim_end();
    (!path.is_empty()).then(|| PathBuf::from(path))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_is_no_liblsl_is_named_with_the_reason() {
        let error = Library::load(Some(Path::new("/no/such/liblsl.so"))).unwrap_err();
        let text = error.to_string();
        assert!(text.starts_with("/no/such/liblsl.so cannot be loaded"), "{text}");
        // Another library lacks the functions.
        let error = Library::load(Some(Path::new("libm.so.6"))).unwrap_err();
        let LibraryError::File(_, LoadError::Function(name, _)) = error else {
            panic!("{error:?}");
        };
        assert!(name.starts_with("lsl_"), "{name}");
    }
}
