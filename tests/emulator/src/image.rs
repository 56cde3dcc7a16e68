//! Builds images for microcontrollers with cargo, and stores a copy of each.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Mutex, PoisonError};

use serde_json::Value;

use crate::error::EmulatorError;
use crate::installed::check_target;
use crate::qemu::TARGET;

/// Locked during a build: tests run in parallel, and cargo writes the image of any feature set to
/// the same path.
static BUILDS: Mutex<()> = Mutex::new(());

/// A linked program for a microcontroller: the path of its ELF file.
#[derive(Debug, Clone)]
pub struct Image {
    path: PathBuf,
}

/// A model with which an image is built instead of the checked-in one.
#[derive(Debug, Clone, Copy)]
pub struct OtherModel<'p> {
    /// Absolute path of the folder that holds the model's artifact.
    pub artifact: &'p Path,
    /// Cargo's target folder for the build. In the usual folder, builds with this model and with
    /// the checked-in one would each recompile the crates that depend on the model.
    pub target: &'p Path,
}

impl Image {
    /// Builds the program `bin` of `package` with cargo's profile `firmware`. The model is the
    /// checked-in one, or the one that `CORTICODE_ARTIFACT` names; `features` are arguments of
    /// cargo.
    ///
    /// Cargo writes the images of all feature sets to the same path, so the image is copied to a
    /// folder named after its features. Compiler messages go to standard error. A program that runs
    /// under cargo uses the same cargo.
    ///
    /// # Errors
    /// The target is missing, the image does not build, or it cannot be copied.
    pub fn build(package: &str, bin: &str, features: &[&str]) -> Result<Self, EmulatorError> {
        Self::build_by(|_| (), package, bin, features)
    }

    /// Builds an image as [`Image::build`] does, but with the model `model`.
    ///
    /// # Errors
    /// As [`Image::build`].
    pub fn build_with_model(
        model: OtherModel<'_>,
        package: &str,
        bin: &str,
        features: &[&str],
    ) -> Result<Self, EmulatorError> {
        let configure = |cargo: &mut Command| {
            cargo.env("CORTICODE_ARTIFACT", model.artifact).env("CARGO_TARGET_DIR", model.target);
        };
        Self::build_by(configure, package, bin, features)
    }

    fn build_by(
        configure: impl FnOnce(&mut Command),
        package: &str,
        bin: &str,
        features: &[&str],
    ) -> Result<Self, EmulatorError> {
        check_target()?;
        let _build = BUILDS.lock().unwrap_or_else(PoisonError::into_inner);
        let mut cargo = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
        cargo
            .args(["build", "--profile=firmware", "--target", TARGET])
            .args(["--package", package, "--bin", bin])
            .args(features)
            .arg("--message-format=json-render-diagnostics")
            .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("../.."))
            .stderr(Stdio::inherit());
        configure(&mut cargo);
        let command = format!("{cargo:?}");
        let failed = |why: String| EmulatorError::Build { command, why };
        let output = match cargo.output() {
            Ok(output) if output.status.success() => output,
            Ok(output) => return Err(failed(output.status.to_string())),
            Err(error) => return Err(failed(error.to_string())),
        };
        let Some(built) = executable(&String::from_utf8_lossy(&output.stdout), bin) else {
            return Err(failed("its messages name no executable".to_owned()));
        };
        let variant = match features {
            [] => "default".to_owned(),
            features => features.join("-").replace("--features=", ""),
        };
        let variant = variant.replace(['/', ','], "-");
        let image = Self { path: built };
        let folder = image.create_folder(Path::new("emulator").join(variant))?;
        let [path, copy] = [folder.join(bin), folder.join(format!("{bin}.new"))];
        // Rename the copy into place, because an emulator may be reading the old file.
        let copied = fs::copy(&image.path, &copy).and_then(|_| fs::rename(&copy, &path));
        copied.map_err(EmulatorError::file(&path))?;
        Ok(Self { path })
    }

    /// Returns the image in an existing ELF file, such as a modified copy.
    pub fn at(path: impl Into<PathBuf>) -> Self {
        Self { path: path.into() }
    }

    /// Returns the path of the image's ELF file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Creates the folder `name` in cargo's target folder, for files of a run; returns its path.
    ///
    /// # Errors
    /// The folder cannot be created.
    pub fn create_folder(&self, name: impl AsRef<Path>) -> Result<PathBuf, EmulatorError> {
        // Both `target/TRIPLE/PROFILE/bin` and the copy `target/emulator/VARIANT/bin` are three
        // levels deep.
        let target = self.path.ancestors().nth(3).unwrap_or(Path::new("."));
        let folder = target.join(name);
        fs::create_dir_all(&folder).map_err(EmulatorError::file(&folder))?;
        Ok(folder)
    }
}

/// Returns the path of the built program `bin` from the JSON lines that cargo's build has printed.
fn executable(messages: &str, bin: &str) -> Option<PathBuf> {
    let messages = messages.lines();
    let messages = messages.filter_map(|line| serde_json::from_str::<Value>(line).ok());
    messages
        .filter(|message| message["target"]["name"] == bin)
        .filter_map(|message| message["executable"].as_str().map(PathBuf::from))
        .next_back()
}
