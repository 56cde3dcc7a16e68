//! Writes a random model for a montage file: a linear code with two values per electrode.
//! `cargo xtask board` builds images with it.
#![forbid(unsafe_code)]

use std::env;
use std::path::Path;
use std::process::ExitCode;

use any_model::any_artifact_for;
use artifact::{Mode, MontageFile};

fn main() -> ExitCode {
    let words: Vec<String> = env::args().skip(1).collect();
    let [montage, folder] = &words[..] else {
        new_file::message!("usage: any-model MONTAGE_FILE FOLDER");
        return ExitCode::from(2);
    };
    match write(Path::new(montage), Path::new(folder)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            new_file::message!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Writes a model for the montage into the folder, unless the same model is already there: a newer
/// file would make cargo build the images again.
fn write(montage: &Path, folder: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let montage = MontageFile::read(montage)?;
    let numbers = 2 * montage.montage().electrodes.len();
    let model = any_artifact_for(2, &montage, Mode::Pca, numbers)?;
    let is_there = artifact::Artifact::read(folder).is_ok_and(|there| there.id == model.id);
    if !is_there {
        model.write(folder)?;
    }
    Ok(())
}
