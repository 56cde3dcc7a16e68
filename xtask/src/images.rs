//! Builds the images for the boards as `cargo flash` does.

use std::fs;
use std::path::PathBuf;

use clap::ValueEnum;

use crate::command::{AFTER_A_BUILD, BOARD_TARGET, Failure, OrFail, cargo, run, target_folder};
use crate::install;

/// NUCLEO board for which images are built.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Board {
    /// NUCLEO-H743ZI2.
    H743,
    /// NUCLEO-F446RE.
    F446,
}

impl Board {
    pub(crate) const ALL: [Self; 2] = [Self::H743, Self::F446];

    /// Name of the board on the command line and in the names of images, packages and tests.
    pub(crate) const fn key(self) -> &'static str {
        ["h743", "f446"][self as usize]
    }

    /// Name of the board as ST sells it.
    pub(crate) const fn name(self) -> &'static str {
        ["NUCLEO-H743ZI2", "NUCLEO-F446RE"][self as usize]
    }

    /// Name of the board's microcontroller for probe-rs.
    pub(crate) const fn chip(self) -> &'static str {
        ["STM32H743ZITx", "STM32F446RETx"][self as usize]
    }

    /// Names of the board's images, each with the arguments for cargo that select it: the image
    /// with the other port first, the default image last.
    pub(crate) const fn images(self) -> &'static [[&'static str; 2]] {
        match self {
            Self::H743 => &[
                ["h743-uart", "--package=board-h743 --features=uart"],
                ["h743", "--package=board-h743"],
            ],
            Self::F446 => &[
                [
                    "f446-usb",
                    "--package=board-f446 --no-default-features --features=network",
                ],
                [
                    "f446-packed",
                    "--package=board-f446 --no-default-features --features=uart,packed",
                ],
                ["f446", "--package=board-f446"],
            ],
        }
    }
}

/// Returns the folder to which [`build`] copies the images.
pub(crate) fn folder() -> PathBuf {
    target_folder().join("virtual-board").join("images")
}

/// Returns the path of the image `name` in [`folder`].
pub(crate) fn file(name: &str) -> PathBuf {
    folder().join(name).with_extension("elf")
}

/// Builds the images of a board, the default one last. Cargo writes all of them to the same path,
/// so each is copied to a separate file, together with the list of its sources (`.d`). The default
/// image, built last, remains at cargo's path, where `cargo flash` looks for it.
pub(crate) fn build(board: Board) -> Result<(), Failure> {
    install::board_target()?;
    let built = target_folder().join(BOARD_TARGET).join("firmware");
    let built = built.join(format!("board-{}", board.key()));
    for [name, selection] in board.images() {
        let words = format!("build --profile=firmware --target={BOARD_TARGET} {selection}");
        run(&mut cargo(&words), AFTER_A_BUILD)?;
        let image = file(name);
        let copied = fs::create_dir_all(folder())
            .and_then(|()| fs::copy(&built, &image))
            .and_then(|_| fs::copy(built.with_extension("d"), image.with_extension("d")));
        copied.or_fail(
            format!("copying {}", built.display()),
            "is the disk full? is CARGO_TARGET_DIR writable?",
        )?;
    }
    Ok(())
}
