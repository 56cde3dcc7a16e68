//! Links the image with the memory map of the emulated boards.
#![forbid(unsafe_code)]

use std::{env, fs, path::PathBuf};

fn main() {
    println!("cargo::rerun-if-changed=mps2.x");
    println!("cargo::rerun-if-changed=../../memory.x");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    // memory.x in the workspace's root includes board.x. cortex-m-rt's link.x also includes
    // device.x, which is empty because the vector table names its handlers itself.
    fs::copy("mps2.x", out.join("board.x")).expect("OUT_DIR is writable");
    fs::write(out.join("device.x"), "").expect("OUT_DIR is writable");
    println!("cargo::rustc-link-search={}", out.display());
    println!("cargo::rustc-link-arg-bins=-Tlink.x");
    println!("cargo::rustc-link-arg-bins=--nmagic");
}
