//! Names the folder of the model that the program embeds: `signal/model/artifact/`, or the folder
//! in `CORTICODE_ARTIFACT`, as `signal/model/build.rs` does.

use std::{
    env,
    path::{Path, PathBuf},
    process::ExitCode,
};

/// Environment variable with the absolute path of the folder of another artifact.
const ARTIFACT: &str = "CORTICODE_ARTIFACT";

fn main() -> ExitCode {
    println!("cargo::rerun-if-env-changed={ARTIFACT}");
    println!("cargo::rerun-if-changed=build.rs");
    let artifact = env::var_os(ARTIFACT).map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../signal/model/artifact"),
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
    // The program embeds an empty file in place of one that the artifact lacks.
    for (variable, name) in [
        ("EMBEDDED_WEIGHTS", "weights.safetensors"),
        ("EMBEDDED_PACKED_TOML", "packed.toml"),
        ("EMBEDDED_PACKED_TENSORS", "packed.safetensors"),
    ] {
        let file = artifact.join(name);
        let file = if file.exists() { &file } else { &empty };
        println!("cargo::rustc-env={variable}={}", file.display());
    }
    // The compiler reads the files, and cargo compiles again when one of them changes.
    println!("cargo::rustc-env=EMBEDDED_MODEL={}", artifact.display());
    ExitCode::SUCCESS
}
