//! Inputs that once broke a promise, stored in the folder `corpus`.

use std::fs;
use std::path::Path;

/// Returns the stored inputs of a target, in the order of their file names.
///
/// # Panics
/// When a stored input cannot be read.
pub fn read(target: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("corpus")
        .join(target);
    let Ok(files) = fs::read_dir(folder) else {
        return Vec::new();
    };
    let mut paths: Vec<_> = files.map(|file| file.expect("a file").path()).collect();
    paths.sort();
    let read = |path| fs::read(path).expect("a readable file");
    paths.iter().map(read).collect()
}
