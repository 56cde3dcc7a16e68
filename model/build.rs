//! Generates the model from `artifact/`.

use std::{
    error::Error,
    path::{Path, PathBuf},
    process::ExitCode,
};

fn main() -> ExitCode {
    let artifact = Path::new(env!("CARGO_MANIFEST_DIR")).join("artifact");
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

/// An error and its causes in one line.
fn chain(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        text = format!("{text}: {error}");
        cause = error.source();
    }
    text
}
