//! The emulated microcontroller, in real time behind a TCP port.

use std::env;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::process::Process;
use crate::skip::skipped;
use crate::workspace::cargo;

/// The image of the application.
const IMAGE: &str = "board-qemu";

/// The microcontroller's target.
const TARGET: &str = "thumbv7em-none-eabihf";

/// Whether there is an emulator, and a standard library for what it emulates; says loudly that `test` is
/// skipped when there is not.
///
/// # Panics
/// When there is none and `CORTICODE_REQUIRE_ROS=1`.
pub fn available(test: &str) -> bool {
    let Some(why) = missing() else { return true };
    let required = env::var("CORTICODE_REQUIRE_ROS").is_ok_and(|value| value == "1");
    assert!(
        !required,
        "{test}: CORTICODE_REQUIRE_ROS=1, and there is {why}"
    );
    skipped(test, &why);
    false
}

fn missing() -> Option<String> {
    let mut qemu = Command::new("qemu-system-arm");
    qemu.arg("--version").stdout(Stdio::null());
    if !qemu.status().is_ok_and(|status| status.success()) {
        return Some("no qemu-system-arm; `apt-get install qemu-system-arm`".to_owned());
    }
    let mut library = Command::new("rustc");
    library.args(["--print=target-libdir", "--target", TARGET]);
    let folder = library
        .output()
        .ok()
        .filter(|output| output.status.success());
    let folder = folder.map(|output| String::from_utf8_lossy(&output.stdout).trim().to_owned());
    let there = folder.is_some_and(|folder| Path::new(&folder).is_dir());
    (!there).then(|| format!("no standard library for {TARGET}; `rustup target add {TARGET}`"))
}

/// Builds the image, with the profile of the boards.
///
/// # Panics
/// When it does not build.
pub fn image() -> PathBuf {
    let package = format!("--package={IMAGE}");
    let target = format!("--target={TARGET}");
    let arguments = ["build", &package, "--profile=firmware", &target];
    let messages = cargo(&[&arguments[..], &["--message-format=json"]].concat());
    let messages = messages.expect("the image builds");
    crate::programs::executable(&messages, IMAGE)
}

/// Starts the image on a Cortex-M4F, with EEG that it makes up; its UART is a TCP port of 127.0.0.1.
///
/// # Panics
/// When QEMU does not start.
pub fn start(image: &Path, port: u16, folder: &Path) -> Process {
    let mut qemu = Command::new("qemu-system-arm");
    qemu.args(["-machine", "mps2-an386"])
        .args(["-display", "none", "-monitor", "none"])
        // Its time is counted in instructions and held back to the wall's: where the PC is late, so is
        // everything, and the emulated board does not notice.
        .args(["-icount", "shift=4,align=on"])
        .arg("-semihosting-config")
        .arg(format!("enable=on,target=native,arg={IMAGE}"))
        .arg("-serial")
        .arg(format!("tcp:127.0.0.1:{port},server=on,wait=off"))
        .arg("-kernel")
        .arg(image)
        .current_dir(folder);
    Process::start("qemu", &mut qemu, folder).expect("QEMU starts")
}
