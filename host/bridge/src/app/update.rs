//! The subcommand `update`: writes an image to a board, through the loader in its ROM.

use std::path::PathBuf;
use std::time::{Duration, Instant};
use std::{fs, io, thread};

use bridge_core::{Answer, DeviceSummary, Request};
use clap::{Args, ValueHint};
use dfuse::Image;
use indicatif::{ProgressBar, ProgressStyle};
use link::ResetInto;
use nusb::DeviceId;
use tokio::runtime::Runtime;

use crate::app::command_line::PortOptions;
use crate::error::BridgeError;
use crate::query::query_port;
use crate::update::usb_loader::{self, UsbLoader};
use crate::update::{Machine, UpdateError, update};

/// Write new firmware to a board over USB, through the boot loader in its microcontroller's ROM.
///
/// Checks file and board before anything is erased, and compares the flash with the file before the
/// board starts it. After an interrupted update, the board has no firmware; repeat the command
/// while the board is in its boot loader, as after a reset with BOOT0 high. The command uses a boot
/// loader only if no device answers.
///
/// Exit status: 0 the device runs the image, 1 the flash differs from the file or the wrong version
/// runs, 2 the file is damaged or for another board, 3 no answer, 4 the device or its boot loader
/// refuses.
#[derive(Args, Clone, Debug)]
pub(crate) struct UpdateOptions {
    /// Image, which `cargo fw` writes: corticode-h743.dfu or corticode-f446.dfu
    #[arg(value_hint = ValueHint::FilePath)]
    pub(crate) image: PathBuf,
    #[command(flatten)]
    pub(crate) at: PortOptions,
}

/// Updates the board, and returns its identity after the update.
///
/// # Errors
///
/// [`BridgeError`] if the image, the device or its loader cannot be used.
pub(crate) fn run(options: UpdateOptions, runtime: Runtime) -> Result<DeviceSummary, BridgeError> {
    let UpdateOptions { image: path, at } = options;
    let file = fs::read(&path).map_err(|error| UpdateError::File(path.clone(), error))?;
    let image = Image::from_dfu(&file).map_err(|error| UpdateError::Image(path, error))?;
    let style = ProgressStyle::with_template("{bar:40} {percent} %, {msg}");
    let bar = ProgressBar::no_length();
    if let Ok(style) = style {
        bar.set_style(style);
    }
    let start = Instant::now();
    let mut machine = ThisMachine { runtime, at, start };
    update(&mut machine, &image, &bar)
}

/// The device at a port, and the loaders on this machine's USB.
struct ThisMachine {
    runtime: Runtime,
    at: PortOptions,
    start: Instant,
}

impl ThisMachine {
    fn query(&self, request: Request) -> Result<DeviceSummary, BridgeError> {
        let query = query_port(&self.at.port, self.at.baud, request);
        Ok(match self.runtime.block_on(query)? {
            Answer::Identified(device)
            | Answer::Restarted(device)
            | Answer::InBootloader(device) => device,
            Answer::SelfTest(report) => report.device,
        })
    }
}

impl Machine for ThisMachine {
    type LoaderId = DeviceId;
    type Loader = UsbLoader;

    fn identify(&mut self) -> Result<DeviceSummary, BridgeError> {
        self.query(Request::Identify)
    }

    fn start_loader(&mut self) -> Result<(), BridgeError> {
        self.query(Request::Reset(ResetInto::Bootloader))?;
        Ok(())
    }

    fn loaders(&mut self) -> io::Result<Vec<DeviceId>> {
        usb_loader::loaders()
    }

    fn open(&mut self, id: DeviceId) -> io::Result<UsbLoader> {
        UsbLoader::open(id)
    }

    fn now(&self) -> Duration {
        self.start.elapsed()
    }

    fn sleep(&mut self, time: Duration) {
        thread::sleep(time);
    }

    fn note(&mut self, line: &str) {
        new_file::message!("corticode-bridge: {line}");
    }
}
