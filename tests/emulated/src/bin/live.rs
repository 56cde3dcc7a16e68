//! Program that runs the application on the emulated Cortex-M4F in real time, with a TCP port in
//! place of a board's serial port: `cargo xtask qemu --live`.
#![forbid(unsafe_code)]

use std::convert::Infallible;
use std::error::Error;
use std::net::TcpListener;
use std::os::unix::process::CommandExt;
use std::process::ExitCode;

use clap::Parser;
use emulated::board::APPLICATION;
use emulator::{EmulatorError, Image, MACHINES, Qemu, Uart, installed};

/// Runs the application on an emulated microcontroller in real time, until Ctrl-C.
#[derive(Debug, Parser)]
struct Options {
    /// TCP port on 127.0.0.1 at which the application can be reached.
    #[arg(long, default_value_t = 5555)]
    port: u16,
}

fn main() -> ExitCode {
    let Err(error) = run(Options::parse().port);
    eprintln!("{error}");
    let missing = error.downcast_ref().is_some_and(EmulatorError::is_missing);
    ExitCode::from(if missing { 2 } else { 1 })
}

/// Replaces this process with QEMU, which runs until Ctrl-C. The folder holds no file of samples,
/// so the image generates synthetic EEG.
fn run(port: u16) -> Result<Infallible, Box<dyn Error>> {
    installed::check()?;
    let [cortex_m4f, _] = MACHINES;
    let image = Image::build(APPLICATION, APPLICATION, cortex_m4f.features)?;
    let folder = image.create_folder("emulated/live")?;
    let mut qemu = Qemu::new(&image, cortex_m4f, &folder, &[APPLICATION]);
    qemu.uart(Uart::Tcp(port));
    let address = format!("tcp:127.0.0.1:{port}");
    // Check that the port is free. A listener that is closed without a connection frees the port at
    // once.
    TcpListener::bind(("127.0.0.1", port)).map_err(|error| {
        format!("cannot listen on {address}: {error}\n  next: `--port` with another port")
    })?;
    eprintln!(
        "{} in real time at {address}, until Ctrl-C; its host, in another terminal: \
         `cargo run --package bridge -- --port {address} --sink ndjson`",
        cortex_m4f.name
    );
    Err(qemu.into_command().exec().into())
}
