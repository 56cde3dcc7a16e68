//! The files of a model inside a program.

use crate::folder::Artifact;
use std::fmt::Write as _;
use std::path::Path;

/// Returns the Rust expression of type `&[(&str, &[u8])]` that includes the files of the model in
/// `folder` in a program, for build scripts. The program passes it to [`Artifact::from_files`]. A
/// relative `folder` is relative to the file with the expression.
pub fn embedding(folder: &Path) -> String {
    let mut list = String::from("&[\n");
    for name in Artifact::FILES {
        let path = folder.join(name);
        if path.exists() {
            let path = path.display().to_string();
            // Writing to a String cannot fail.
            let _ = writeln!(list, "    ({name:?}, include_bytes!({path:?})),");
        }
    }
    list + "]\n"
}
