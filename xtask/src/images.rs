//! Images for the boards, built as `cargo flash` builds them.

use std::fs;
use std::path::{Path, PathBuf};

use clap::ValueEnum;

use crate::command::{AFTER_A_BUILD, BOARD_TARGET, Failure, cargo, run, target_folder};
use crate::install;

/// A board with an STM32 microcontroller, for which there are images.
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

    /// Names of the board's two images, each with its arguments for cargo; the default image is last.
    pub(crate) const fn images(self) -> [[&'static str; 2]; 2] {
        match self {
            Self::H743 => [
                ["h743-uart", "--package=board-h743 --features=uart"],
                ["h743", "--package=board-h743"],
            ],
            Self::F446 => [
                ["f446-usb", "--package=board-f446 --no-default-features"],
                ["f446", "--package=board-f446"],
            ],
        }
    }
}

/// Folder with the images; each file is named after its image.
pub(crate) fn folder() -> PathBuf {
    target_folder().join("virtual-board").join("images")
}

/// Builds both images of a board: the one with the other port, then the default one. Cargo writes both to one
/// path, so each is copied to a file of its own. The default image also stays where `cargo flash` looks for
/// it.
///
/// # Errors
/// The target is missing, or an image does not build or cannot be copied.
pub(crate) fn build(board: Board) -> Result<(), Failure> {
    install::board_target()?;
    let package = format!("board-{}", board.key());
    let built = target_folder()
        .join(BOARD_TARGET)
        .join("firmware")
        .join(package);
    for [name, selection] in board.images() {
        let words = format!("build --profile=firmware --target={BOARD_TARGET} {selection}");
        run(&mut cargo(&words), AFTER_A_BUILD)?;
        let copy = folder().join(name);
        let copied = copy_if_changed(&built, &copy.with_extension("elf"))
            .and_then(|()| copy_if_changed(&built.with_extension("d"), &copy.with_extension("d")));
        let next = "is the disk full? is CARGO_TARGET_DIR writable?";
        copied
            .map_err(|error| Failure::check(format!("copying {}", built.display()), error, next))?;
    }
    Ok(())
}

/// Copies a file unless the copy already has the same content; an unchanged image then keeps its modification
/// time.
fn copy_if_changed(from: &Path, to: &Path) -> std::io::Result<()> {
    let content = fs::read(from)?;
    if fs::read(to).is_ok_and(|copy| copy == content) {
        return Ok(());
    }
    fs::create_dir_all(to.parent().unwrap_or(to))?;
    fs::write(to, content)
}
