//! The image in real time, behind a TCP port.

use std::io;
use std::process::ExitStatus;

use tokio::process::Command;
use tokio::signal::unix::{SignalKind, signal};

use super::IMAGE;
use crate::benchmark::emulator::{Image, MACHINES, failed, not_started};
use crate::benchmark::make_folder;
use crate::failure::Failure;

/// Builds the image for the first machine and runs it until Ctrl-C; its EEG is made up.
///
/// # Errors
/// QEMU or the target is missing, the image does not build, or QEMU ends by itself, as it does when
/// the port is taken.
pub(super) fn run(port: u16) -> Result<(), Failure> {
    let [machine, ..] = MACHINES;
    let image = Image::build(IMAGE, IMAGE, machine.features)?;
    let folder = image.target_folder().join("qemu").join("live");
    make_folder(&folder)?;
    let address = format!("tcp:127.0.0.1:{port}");
    let mut command = Command::from(image.command(machine, &folder, &[IMAGE]));
    command.arg("-serial");
    command.arg(format!("{address},server=on,wait=off"));
    // Ctrl-C is ours to handle: the terminal would send it to QEMU too.
    command.process_group(0).kill_on_drop(true);
    eprintln!(
        "{} in real time at {address}, until Ctrl-C; its host, in another terminal: \
         `cargo run --package bridge -- --port {address} --sink ndjson`",
        machine.name
    );
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build();
    let ended = runtime.and_then(|runtime| runtime.block_on(until_a_signal(&mut command)));
    match ended {
        Ok(None) => Ok(()),
        Ok(Some(status)) => Err(failed(
            command.as_std(),
            format!("it ended by itself: {status}"),
        )),
        Err(error) => Err(not_started(command.as_std(), &error)),
    }
}

/// Runs QEMU until Ctrl-C or SIGTERM; how it ended, if it did so before.
async fn until_a_signal(command: &mut Command) -> io::Result<Option<ExitStatus>> {
    let mut terminate = signal(SignalKind::terminate())?;
    let mut emulator = command.spawn()?;
    tokio::select! {
        status = emulator.wait() => return status.map(Some),
        _ = tokio::signal::ctrl_c() => {}
        _ = terminate.recv() => {}
    }
    emulator.kill().await?;
    Ok(None)
}
