//! Sets `cfg(smlad)` for targets with the DSP extension of ARMv7E-M, for which stable Rust has no
//! `cfg`.

fn main() {
    println!("cargo::rustc-check-cfg=cfg(smlad)");
    println!("cargo::rerun-if-changed=build.rs");
    let target = std::env::var("TARGET").unwrap_or_default();
    if target.starts_with("thumbv7em-") {
        println!("cargo::rustc-cfg=smlad");
    }
}
