//! The application on the emulated Cortex-M4F in real time, as a board with a TCP port: `cargo xtask qemu --live`.
#![forbid(unsafe_code)]

use std::error::Error;
use std::os::unix::process::CommandExt;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread;
use std::time::Duration;

use clap::Parser;
use emulated::board::APPLICATION;
use emulator::{EmulatorError, Image, MACHINES, Qemu, Uart, installed};
use signal_hook::consts::{SIGINT, SIGTERM};

/// Polling interval for signals and the end of QEMU.
const POLL: Duration = Duration::from_millis(50);

/// Runs the application on an emulated microcontroller in real time, until Ctrl-C.
#[derive(Debug, Parser)]
struct Options {
    /// TCP port on 127.0.0.1.
    #[arg(long, default_value_t = 5555)]
    port: u16,
}

fn main() -> ExitCode {
    match run(Options::parse().port) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            let missing = error.downcast_ref().is_some_and(EmulatorError::is_missing);
            ExitCode::from(if missing { 2 } else { 1 })
        }
    }
}

/// Runs QEMU until SIGINT or SIGTERM. Without a file of samples the image generates synthetic EEG.
fn run(port: u16) -> Result<(), Box<dyn Error>> {
    installed::check()?;
    let [cortex_m4f, _] = MACHINES;
    let image = Image::build(APPLICATION, APPLICATION, cortex_m4f.features)?;
    let folder = image.create_folder("emulated/live")?;
    let mut qemu = Qemu::new(&image, cortex_m4f, &folder, &[APPLICATION]);
    qemu.uart(Uart::Tcp(port));
    let address = format!("tcp:127.0.0.1:{port}");
    eprintln!(
        "{} in real time at {address}, until Ctrl-C; its host, in another terminal: \
         `cargo run --package bridge -- --port {address} --sink ndjson`",
        cortex_m4f.name
    );
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&stop))?;
    }
    let by_hand = qemu.to_string();
    // A separate process group: otherwise the terminal would send Ctrl-C to QEMU, too.
    let mut running = qemu.into_command().process_group(0).spawn()?;
    let ended = loop {
        let ended = running.try_wait()?;
        if ended.is_some() || stop.load(Relaxed) {
            break ended;
        }
        thread::sleep(POLL);
    };
    if let Some(status) = ended {
        let next = format!("is the port occupied? Run it by hand: `{by_hand}`");
        return Err(format!("QEMU ended by itself: {status}\n  next: {next}").into());
    }
    running.kill()?;
    running.wait()?;
    Ok(())
}
