//! The emulated microcontroller behind a TCP port, as fast as the wall's clock.

use std::env;
use std::fs::OpenOptions;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use rustix::fs::{CWD, FileType, Mode, mknodat};

use crate::process::Process;
use crate::skip::skipped;
use crate::workspace::cargo;

/// The image of the application.
const IMAGE: &str = "board-qemu";

/// What the image reads its samples from.
const SAMPLES: &str = "samples.i32";

/// Samples in a second.
const RATE_HZ: u32 = 512;

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

/// Starts the image on a Cortex-M4F; its UART is a TCP port of 127.0.0.1, its converter reads these
/// counts.
///
/// Its time is counted in instructions, but it waits for each sample, which comes when it is due on the
/// wall's clock: where the PC is late, so is everything, and the emulated board does not notice.
///
/// # Panics
/// When the folder cannot be written, or QEMU does not start.
pub fn start(
    image: &Path,
    port: u16,
    folder: &Path,
    samples: impl Iterator<Item = [i32; pipeline::CHANNELS]> + Send + 'static,
) -> Process {
    let pipe = folder.join(SAMPLES);
    let mode = Mode::RUSR | Mode::WUSR;
    mknodat(CWD, &pipe, FileType::Fifo, mode, 0).expect("a pipe with a name");
    // It ends with QEMU, the pipe's reader.
    thread::spawn(move || feed(&pipe, samples));
    let mut qemu = Command::new("qemu-system-arm");
    qemu.args(["-machine", "mps2-an386"])
        .args(["-display", "none", "-monitor", "none"])
        .args(["-icount", "shift=4,sleep=off"])
        .arg("-semihosting-config")
        .arg(format!("enable=on,target=native,arg={IMAGE}"))
        .arg("-serial")
        .arg(format!("tcp:127.0.0.1:{port},server=on,wait=off"))
        .arg("-kernel")
        .arg(image)
        .current_dir(folder);
    Process::start("qemu", &mut qemu, folder).expect("QEMU starts")
}

/// Writes each sample when it is due.
fn feed(pipe: &Path, samples: impl Iterator<Item = [i32; pipeline::CHANNELS]>) -> io::Result<()> {
    // Waits until the image has opened it.
    let mut pipe = OpenOptions::new().write(true).open(pipe)?;
    let begin = Instant::now();
    for (index, counts) in (1..).zip(samples) {
        let due = begin + Duration::from_secs(1) * index / RATE_HZ;
        thread::sleep(due.saturating_duration_since(Instant::now()));
        pipe.write_all(counts.map(i32::to_le_bytes).as_flattened())?;
    }
    Ok(())
}
