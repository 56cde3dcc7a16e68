//! Updates the firmware of a board through the loader in its microcontroller's ROM.
//!
//! ```text
//! file .dfu ──► check ──► device: Hello, Reset ──► loader: erase, write, compare, leave ──► Hello
//! ```
//!
//! [`update`] is this flow. It reaches the device and the loaders through a [`Machine`], which
//! tests simulate.

pub(crate) mod flash_layout;
pub(crate) mod programmer;
#[cfg(test)]
mod simulated_board;
#[cfg(test)]
mod tests;
pub(crate) mod usb_loader;

use std::path::PathBuf;
use std::time::Duration;
use std::{io, ops::Range};

use bridge_core::{DeviceSummary, QueryError};
use dfuse::{DfuseError, Image};
use indicatif::ProgressBar;
use thiserror::Error;

use crate::error::BridgeError;
use crate::update::flash_layout::FlashLayout;
use crate::update::programmer::{Loader, program};

/// Names of the boards, with the flash of each as its loader describes it (sectors as in RM0433 and
/// RM0390, embedded flash). A loader with another description belongs to another chip.
const BOARDS: [(&str, &str); 2] = [
    ("NUCLEO-H743ZI2", "@Internal Flash/0x08000000/16*128Kg"),
    ("NUCLEO-F446RE", "@Internal Flash/0x08000000/04*016Kg,01*064Kg,03*128Kg"),
];

/// Time limit for the loader to appear after the reset, and then for udev to permit opening it.
const LOADER_TIMEOUT: Duration = Duration::from_secs(10);
/// Time limit for the new firmware's `Hello`.
const RESTART_TIMEOUT: Duration = Duration::from_secs(20);
/// Time between two attempts of [`retry`].
const RETRY: Duration = Duration::from_millis(200);

/// What an update needs from the machine: the device at its port, and the loaders on USB.
pub(crate) trait Machine {
    type LoaderId: Copy + PartialEq;
    type Loader: Loader;

    /// Asks the device at the port for its identity.
    fn identify(&mut self) -> Result<DeviceSummary, BridgeError>;

    /// Makes the device at the port start its loader.
    fn start_loader(&mut self) -> Result<(), BridgeError>;

    /// Returns the loaders on USB.
    fn loaders(&mut self) -> io::Result<Vec<Self::LoaderId>>;

    fn open(&mut self, id: Self::LoaderId) -> io::Result<Self::Loader>;

    /// Returns the time since a fixed instant.
    fn now(&self) -> Duration;

    fn sleep(&mut self, time: Duration);

    /// Shows a line of text to the user.
    fn note(&mut self, line: &str);
}

/// Why a board is not updated.
#[derive(Debug, Error)]
pub enum UpdateError {
    /// The file cannot be read.
    #[error("{} cannot be read; name the file .dfu that `cargo fw` writes", .0.display())]
    File(PathBuf, #[source] io::Error),
    /// The file is not an intact image.
    #[error(
        "{} is no image for an update, and nothing was sent to the board; copy it again, or write it again \
         with `cargo fw`", .0.display()
    )]
    Image(PathBuf, #[source] DfuseError),
    /// The image is for a board that this program does not know.
    #[error(
        "the image is for a {0}, which this bridge cannot update; use the bridge of the image's release"
    )]
    UnknownBoard(String),
    /// The image does not fit the board.
    #[error(
        "the image takes the addresses {:#010X} to {:#010X}, and the board's flash is {:#010X} to {:#010X}; \
         write the image again, with `cargo fw`", .image.start, .image.end, .flash.start, .flash.end
    )]
    OutsideFlash {
        /// Addresses of the image.
        image: Range<u64>,
        /// Addresses of the flash.
        flash: Range<u32>,
    },
    /// The image is for another board than the device.
    #[error(
        "the image is for a {image}, and the device is a {device}; write one for it, with `cargo fw --board`, \
         or name the right device with --port"
    )]
    OtherBoard {
        /// Name of the image's board.
        image: String,
        /// Name of the device's board.
        device: String,
    },
    /// The chip whose loader runs is not the chip of the image's board.
    #[error(
        "the image is for a {board}, and the boot loader is of another chip ({layout}); name the file for that \
         board"
    )]
    OtherChip {
        /// Name of the image's board.
        board: String,
        /// The loader's description of its flash.
        layout: String,
    },
    /// Several chips are in their loaders, which do not say to which board each belongs.
    #[error(
        "several boot loaders are on USB (0483:df11); unplug all boards but one and repeat the command"
    )]
    SeveralLoaders,
    /// Neither a device nor a loader answers.
    #[error(
        "no device answers, and no boot loader is on USB; plug the board in; one that an update has left \
         without firmware starts its boot loader with BOOT0 high (docs/hardware.md, section `When an update \
         breaks off`)"
    )]
    NoDevice(#[source] Box<BridgeError>),
    /// The device has reset itself, and no loader has appeared.
    #[error(
        "the device has started its boot loader, and none is on USB (0483:df11) after {} s; connect the board's \
         USB socket `USER` besides its ST-LINK and repeat the command; to get back without an update, reset \
         the board", LOADER_TIMEOUT.as_secs()
    )]
    NoLoader,
    /// The loader cannot be opened.
    #[error(
        "the boot loader on USB (0483:df11) does not open; install the udev rule (corticode-bridge ports \
         --udev-rule) and plug the board in again, or end the program that uses it, and repeat the command"
    )]
    LoaderNotOpen(#[source] io::Error),
    /// The loader is gone, or does not follow the protocol.
    #[error(
        "the boot loader was lost while {doing}; check the cable and repeat the command; a board that has lost \
         its power starts its boot loader with BOOT0 high (docs/hardware.md, section `When an update breaks \
         off`)"
    )]
    Lost {
        /// What was going on, such as `erasing`.
        doing: &'static str,
        /// The operating system's error.
        source: io::Error,
    },
    /// The loader reports an error.
    #[error(
        "the boot loader reports {} while {doing}; repeat the command; if the error stays, use an ST-LINK, with \
         `cargo flash`", status_words(*.status)
    )]
    Refused {
        /// What was going on, such as `erasing`.
        doing: &'static str,
        /// Field bStatus of the loader's answer.
        status: u8,
    },
    /// The flash does not hold what was written.
    #[error(
        "the flash at {address:#010X} differs from the image after writing, so the board starts nothing; repeat \
         the command; if the error stays, the chip is defective"
    )]
    Differs {
        /// Address of the first byte that differs.
        address: u32,
    },
    /// The image is written, and the device does not answer.
    #[error(
        "the image is written and compared, and the device has not answered within {} s; reset the board, with \
         BOOT0 low, then try corticode-bridge selftest", RESTART_TIMEOUT.as_secs()
    )]
    NotBack(#[source] Box<BridgeError>),
    /// After the update, the device reports another firmware or model than the image's.
    #[error(
        "the image is written and compared, and the device reports {found} in place of {wanted}; is it the same \
         board? name its port with --port auto:SERIAL"
    )]
    OtherVersion {
        /// Firmware and model of the image.
        wanted: String,
        /// Firmware and model that the device reports.
        found: String,
    },
}

impl UpdateError {
    /// Returns the exit status with which a program ends because of this error.
    pub fn exit_code(&self) -> u8 {
        match self {
            UpdateError::Differs { .. } | UpdateError::OtherVersion { .. } => 1,
            UpdateError::File(..)
            | UpdateError::Image(..)
            | UpdateError::UnknownBoard(_)
            | UpdateError::OutsideFlash { .. }
            | UpdateError::OtherBoard { .. }
            | UpdateError::OtherChip { .. }
            | UpdateError::SeveralLoaders => 2,
            UpdateError::NoDevice(_)
            | UpdateError::NoLoader
            | UpdateError::LoaderNotOpen(_)
            | UpdateError::Lost { .. }
            | UpdateError::NotBack(_) => 3,
            UpdateError::Refused { .. } => 4,
        }
    }
}

/// Returns the text for a loader's status (DFU 1.1, section 6.1.2).
fn status_words(status: u8) -> String {
    let words = match status {
        0x03 => "that it cannot write",
        0x04 | 0x05 => "that it cannot erase",
        0x06 | 0x07 => "that it cannot program the flash",
        0x01 | 0x08 => "an address out of range",
        0x0B => "that the flash is protected",
        _ => "an error",
    };
    format!("{words} (status {status})")
}

/// Writes an image to the device at the port, and returns the device's identity after the update.
/// If no device answers and one loader is on USB, writes the image through this loader.
///
/// # Errors
///
/// [`UpdateError`], or an error of the device or its port. The latter occurs only before the
/// device's reset, when nothing has changed yet.
pub(crate) fn update<M: Machine>(
    machine: &mut M,
    image: &Image,
    bar: &ProgressBar,
) -> Result<DeviceSummary, BridgeError> {
    let flash = check_image(image)?;
    // Ignore an error: without USB there are no loaders. If one is needed, the update fails later.
    let present = machine.loaders().unwrap_or_default();
    let device = match machine.identify() {
        Ok(device) => Some(device),
        Err(error) if !is_silent(&error) => return Err(error),
        Err(_) if !present.is_empty() => None,
        Err(error) => return Err(UpdateError::NoDevice(Box::new(error)).into()),
    };
    let wanted = version(&image.firmware, &image.model);
    let id = if let Some(device) = device {
        if device.board != image.board {
            return Err(BridgeError::from(UpdateError::OtherBoard {
                image: image.board.clone(),
                device: device.board,
            }));
        }
        let is = version(&device.firmware, &device.model);
        let same = if is == wanted { ", the same" } else { "" };
        machine.note(&format!("{}: from {is} to {wanted}{same}", device.board));
        machine.start_loader()?;
        retry(machine, LOADER_TIMEOUT, |machine| new_loader(machine, &present))?
    } else {
        let [id] = present[..] else {
            return Err(UpdateError::SeveralLoaders.into());
        };
        machine.note(&format!("a board in its boot loader: to {wanted}"));
        id
    };
    // udev grants this user the permission to open the loader some time after it has appeared.
    let loader = retry(machine, LOADER_TIMEOUT, |machine| machine.open(id));
    let mut loader = loader.map_err(UpdateError::LoaderNotOpen)?;
    if FlashLayout::parse(loader.layout()).as_ref() != Some(&flash) {
        let layout = loader.layout().to_owned();
        let board = image.board.clone();
        return Err(UpdateError::OtherChip { board, layout }.into());
    }
    program(&mut loader, &flash, image, bar)?;
    drop(loader);
    bar.finish_and_clear();
    let device = retry(machine, RESTART_TIMEOUT, Machine::identify);
    let device = device.map_err(|error| UpdateError::NotBack(Box::new(error)))?;
    let found = version(&device.firmware, &device.model);
    if found != wanted {
        return Err(UpdateError::OtherVersion { wanted, found }.into());
    }
    Ok(device)
}

/// Returns the layout of the board's flash, if the program knows the board and the image fits.
fn check_image(image: &Image) -> Result<FlashLayout, UpdateError> {
    let known = BOARDS.iter().find(|(board, _)| *board == image.board);
    let flash = known.and_then(|(_, flash)| FlashLayout::parse(flash));
    let flash = flash.ok_or_else(|| UpdateError::UnknownBoard(image.board.clone()))?;
    let start = u64::from(image.address);
    let taken = start..start + image.content.len() as u64;
    let range = flash.range();
    let fits = image.address == range.start && taken.end <= range.end.into() && !taken.is_empty();
    if !fits {
        let (image, flash) = (taken, range);
        return Err(UpdateError::OutsideFlash { image, flash });
    }
    Ok(flash)
}

/// Returns whether an error means that no device is at the port, or that the device is silent.
/// False for a port that another program uses.
fn is_silent(error: &BridgeError) -> bool {
    match error {
        BridgeError::Unreachable { source, .. } => {
            matches!(source.kind(), io::ErrorKind::NotFound | io::ErrorKind::ConnectionRefused)
        }
        BridgeError::Query(QueryError::NoAnswer { .. }) => true,
        _ => false,
    }
}

fn version(firmware: &str, model: &str) -> String {
    format!("{firmware} (model {model})")
}

/// Repeats `attempt` until it succeeds, or for at most `limit`.
fn retry<M: Machine, T, E>(
    machine: &mut M,
    limit: Duration,
    mut attempt: impl FnMut(&mut M) -> Result<T, E>,
) -> Result<T, E> {
    let deadline = machine.now() + limit;
    loop {
        match attempt(machine) {
            Err(_) if machine.now() < deadline => machine.sleep(RETRY),
            result => return result,
        }
    }
}

/// Returns the loader that was not `present` before the device's reset. Its serial number cannot
/// identify it, because the serial number of a loader differs from that of its device, and is the
/// same in all chips of some kinds.
fn new_loader<M: Machine>(
    machine: &mut M,
    present: &[M::LoaderId],
) -> Result<M::LoaderId, UpdateError> {
    let mut new = machine.loaders().unwrap_or_default();
    new.retain(|id| !present.contains(id));
    match new[..] {
        [] => Err(UpdateError::NoLoader),
        [id] => Ok(id),
        _ => Err(UpdateError::SeveralLoaders),
    }
}
