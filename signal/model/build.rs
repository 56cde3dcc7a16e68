//! Generates the model from `artifact/`, or from the folder that `CORTICODE_ARTIFACT` names.

use std::{
    error::Error,
    path::{Path, PathBuf},
    process::ExitCode,
};

/// Environment variable that holds the absolute path of the folder of a trained model to use
/// instead of `artifact/`.
const ARTIFACT: &str = "CORTICODE_ARTIFACT";

fn main() -> ExitCode {
    println!("cargo::rerun-if-env-changed={ARTIFACT}");
    // The path is read when the script runs. In a shared target folder cargo can run a script that
    // it built for another checkout, and `env!` would contain the path of that checkout.
    let package = std::env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets CARGO_MANIFEST_DIR");
    let artifact = std::env::var_os(ARTIFACT)
        .map_or_else(|| Path::new(&package).join("artifact"), PathBuf::from);
    if artifact.is_relative() {
        println!(
            "cargo::error={ARTIFACT} is {:?}, but cargo runs each build script in the folder of its package: \
             set it to an absolute path",
            artifact.display()
        );
        return ExitCode::FAILURE;
    }
    println!("cargo::rerun-if-changed={}", artifact.display());
    let out = PathBuf::from(std::env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    match model_gen::generate(&artifact, &out) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            println!(
                "cargo::error=the model in {} is unusable: {}",
                artifact.display(),
                chain(&error)
            );
            ExitCode::FAILURE
        }
    }
}

/// Formats an error and its causes in one line.
fn chain(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        text = format!("{text}: {error}");
        cause = error.source();
    }
    text
}
