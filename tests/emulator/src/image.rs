//! Images for microcontrollers, built by cargo.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde::Deserialize;

use crate::error::EmulatorError;
use crate::installed::check_target;
use crate::machine::TARGET;

/// A linked program for a microcontroller, as an ELF file.
#[derive(Debug, Clone)]
pub struct Image {
    path: PathBuf,
}

/// The fields of a cargo message that name a built program.
#[derive(Debug, Deserialize)]
struct Message {
    target: Option<Target>,
    executable: Option<PathBuf>,
}

#[derive(Debug, Deserialize)]
struct Target {
    name: String,
}

impl Image {
    /// Builds the program `bin` of `package` with the profile `firmware`; `features` are arguments of cargo.
    ///
    /// Cargo puts the images of all feature sets at one path, so the image is copied to a folder named after its
    /// features. Compiler messages go to the standard error.
    ///
    /// # Errors
    /// The target is missing, the image does not build, or it cannot be copied.
    pub fn build(package: &str, bin: &str, features: &[&str]) -> Result<Self, EmulatorError> {
        check_target()?;
        let package = format!("--package={package}");
        let target = format!("--target={TARGET}");
        let bin_argument = format!("--bin={bin}");
        let arguments = ["build", &package, &bin_argument, "--profile=firmware"];
        let messages = cargo(&[&arguments[..], &[&target], features].concat())?;
        let built = executable(&messages, bin).ok_or_else(|| EmulatorError::Build {
            command: format!("cargo build {package} {bin_argument}"),
            why: "its messages name no executable".to_owned(),
        })?;
        let words: Vec<&str> = features
            .iter()
            .filter_map(|feature| feature.strip_prefix("--features="))
            .collect();
        let variant = match &words[..] {
            [] => "default".to_owned(),
            words => words.join("-").replace(['/', ','], "-"),
        };
        let folder = target_folder_of(&built).join("emulator").join(variant);
        let path = folder.join(bin);
        fs::create_dir_all(&folder).map_err(EmulatorError::file(&folder))?;
        fs::copy(&built, &path).map_err(EmulatorError::file(&path))?;
        Ok(Self { path })
    }

    /// An image that exists already, such as a modified copy.
    pub fn at(path: impl Into<PathBuf>) -> Self {
        Self { path: path.into() }
    }

    /// Path of the ELF file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Creates the folder `name` in cargo's target folder, for the files of a run.
    ///
    /// # Errors
    /// The folder cannot be created.
    pub fn create_folder(&self, name: impl AsRef<Path>) -> Result<PathBuf, EmulatorError> {
        let folder = target_folder_of(&self.path).join(name);
        fs::create_dir_all(&folder).map_err(EmulatorError::file(&folder))?;
        Ok(folder)
    }
}

/// Returns cargo's target folder: `target/TRIPLE/PROFILE/bin` and `target/emulator/VARIANT/bin` are
/// both three levels deep.
fn target_folder_of(image: &Path) -> &Path {
    image.ancestors().nth(3).unwrap_or(Path::new("."))
}

/// Runs cargo in the workspace's root and returns its messages as JSON lines. If this program runs
/// under cargo, the same cargo is used.
fn cargo(arguments: &[&str]) -> Result<String, EmulatorError> {
    let failed = |why: String| EmulatorError::Build {
        command: format!("cargo {}", arguments.join(" ")),
        why,
    };
    let program = env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(program)
        .args(arguments)
        .arg("--message-format=json-render-diagnostics")
        .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("../.."))
        .stderr(Stdio::inherit())
        .output()
        .map_err(|error| failed(error.to_string()))?;
    if output.status.success() {
        Ok(String::from_utf8_lossy(&output.stdout).into_owned())
    } else {
        Err(failed(output.status.to_string()))
    }
}

/// Returns the path of a program from the messages of a build.
fn executable(messages: &str, bin: &str) -> Option<PathBuf> {
    let messages = messages.lines();
    let messages = messages.filter_map(|line| serde_json::from_str::<Message>(line).ok());
    messages
        .filter(|message| message.target.as_ref().is_some_and(|t| t.name == bin))
        .filter_map(|message| message.executable)
        .next_back()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_program_is_found_among_cargos_messages() {
        let messages = r#"{"reason":"compiler-artifact","target":{"name":"a"},"executable":"/t/x/firmware/a"}
{"reason":"compiler-artifact","target":{"name":"b"},"executable":null}
not JSON
{"reason":"build-finished","success":true}"#;
        assert_eq!(
            executable(messages, "a"),
            Some(PathBuf::from("/t/x/firmware/a"))
        );
        assert_eq!(executable(messages, "b"), None);
        assert_eq!(
            target_folder_of(Path::new("/t/x/firmware/a")),
            Path::new("/t")
        );
    }
}
