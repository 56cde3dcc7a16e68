//! Names the folder of the model to embed: the one in `CORTICODE_ARTIFACT`, by default
//! `signal/model/artifact/`. `signal/model/build.rs` chooses the same folder.

use std::{
    env,
    path::{Path, PathBuf},
    process::ExitCode,
};

/// Name of the environment variable with the absolute path of the folder of the model to embed.
const ARTIFACT: &str = "CORTICODE_ARTIFACT";

fn main() -> ExitCode {
    println!("cargo::rerun-if-env-changed={ARTIFACT}");
    println!("cargo::rerun-if-changed=build.rs");
    // Read the variable at run time: a script that cargo built for another checkout of the sources,
    // in a shared target folder, has that checkout's path compiled in.
    let package = env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets CARGO_MANIFEST_DIR");
    let artifact = env::var_os(ARTIFACT).map_or_else(
        || Path::new(&package).join("../../signal/model/artifact"),
        PathBuf::from,
    );
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
    let empty = out.join("empty");
    if let Err(error) = std::fs::write(&empty, []) {
        println!("cargo::error={}: {error}", empty.display());
        return ExitCode::FAILURE;
    }
    // Not every model has these files. In place of a missing file the program embeds an empty one.
    for (variable, name) in [
        ("EMBEDDED_WEIGHTS", "weights.safetensors"),
        ("EMBEDDED_PACKED_TOML", "packed.toml"),
        ("EMBEDDED_PACKED_TENSORS", "packed.safetensors"),
    ] {
        let file = artifact.join(name);
        let file = if file.exists() { &file } else { &empty };
        println!("cargo::rustc-env={variable}={}", file.display());
    }
    // The source code includes the model's files from the folder in this variable, so cargo
    // compiles again when one of them changes.
    println!("cargo::rustc-env=EMBEDDED_MODEL={}", artifact.display());
    ExitCode::SUCCESS
}
