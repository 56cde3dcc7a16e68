//! Writes the model that a scenario uploads: packed model and linear code with random weights in the
//! shape of the built-in model. First come the 8 bytes of its id, then the bytes of the upload.

use std::error::Error;
use std::path::PathBuf;
use std::{env, fs};

use any_model::{any_linear_for, any_packed_of};
use artifact::Artifact;

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-changed=build.rs");
    let artifact = Artifact::from_files(model::artifact_files::FILES)?;
    let packed = any_packed_of(model::PACKED_COEFFICIENTS, 7, &artifact.description);
    let artifact = any_linear_for(2, &artifact)?.with_packed(Some(packed))?;
    let bytes = model_gen::upload(&artifact)?.ok_or("it has a packed model")?;
    let out = PathBuf::from(env::var_os("OUT_DIR").ok_or("cargo sets OUT_DIR")?);
    let file = [&artifact.id.0[..], &bytes].concat();
    Ok(fs::write(out.join("uploaded_model.bin"), file)?)
}
