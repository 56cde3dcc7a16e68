//! Sets `cfg(smlad)` for targets with ARMv7E-M's DSP extension, for which Rust has no stable `cfg`.

fn main() {
    println!("cargo::rustc-check-cfg=cfg(smlad)");
    println!("cargo::rerun-if-changed=build.rs");
    let target = std::env::var("TARGET").unwrap_or_default();
    if target.starts_with("thumbv7em-") {
        println!("cargo::rustc-cfg=smlad");
    }
}
