//! Build script: embeds the model from the folder that `CORTICODE_ARTIFACT` names, by default
//! `signal/model/artifact/`. `signal/model/build.rs` chooses the same folder.

use std::{
    env,
    path::{Path, PathBuf},
    process::ExitCode,
};

/// Environment variable that holds the absolute path of the model's folder.
const ARTIFACT: &str = "CORTICODE_ARTIFACT";

fn main() -> ExitCode {
    println!("cargo::rerun-if-env-changed={ARTIFACT}");
    println!("cargo::rerun-if-changed=build.rs");
    // Read `CARGO_MANIFEST_DIR` at run time. With a shared target folder, cargo can run a script
    // that it built for another checkout, whose path `env!` would have compiled in.
    let package = env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets CARGO_MANIFEST_DIR");
    let artifact = env::var_os(ARTIFACT)
        .map_or_else(|| Path::new(&package).join("../../signal/model/artifact"), PathBuf::from);
    if artifact.is_relative() {
        println!(
            "cargo::error={ARTIFACT} is {}, but cargo runs each build script in the folder of its package: \
             set it to an absolute path",
            artifact.display()
        );
        return ExitCode::FAILURE;
    }
    println!("cargo::rerun-if-changed={}", artifact.display());
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    let embedded = out.join("embedded_model.rs");
    if let Err(error) = std::fs::write(&embedded, artifact::embedding(&artifact)) {
        println!("cargo::error={}: {error}", embedded.display());
        return ExitCode::FAILURE;
    }
    ExitCode::SUCCESS
}
