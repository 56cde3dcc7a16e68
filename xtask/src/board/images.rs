//! The images, built as `cargo flash` builds them, each with a name of its own.

use std::fs;
use std::path::{Path, PathBuf};

use super::Board;
use crate::benchmark::emulator;
use crate::command::{cargo_with, run};
use crate::failure::Failure;
use crate::verify::{self, BOARD_TARGET};

/// The folder of the emulated boards, below the root.
pub(super) const PROGRAM: &str = "tests/virtual-board";

/// An image: the board, whether it is the one with the other port than the board's default, the word for it
/// and what cargo is told.
type Recipe = (Board, bool, &'static str, &'static [&'static str]);

/// The default image of a board comes last: it stays where `cargo flash` looks for it.
const RECIPES: [Recipe; 4] = [
    (Board::H743, true, "h743-uart", &["--features=uart"]),
    (Board::H743, false, "h743", &[]),
    (Board::F446, true, "f446-usb", &["--no-default-features"]),
    (Board::F446, false, "f446", &[]),
];

/// The images of some boards.
#[derive(Debug)]
pub(super) struct Images {
    folder: PathBuf,
    built: Vec<Recipe>,
}

impl Images {
    /// Builds them and copies each aside: cargo puts the images of a board's two ports at one place.
    ///
    /// # Errors
    /// The target is missing, an image does not build, or cannot be copied.
    pub(super) fn build(boards: &[Board]) -> Result<Self, Failure> {
        verify::board_target()?;
        let target = emulator::target_folder()?;
        let folder = target.join("virtual-board").join("images");
        let failed = |path: &Path, error: &std::io::Error| Failure::Check {
            what: format!("writing {}", path.display()),
            why: error.to_string(),
            next: "make room, or set CARGO_TARGET_DIR to a folder that can be written".to_owned(),
        };
        fs::create_dir_all(&folder).map_err(|error| failed(&folder, &error))?;
        let built = RECIPES
            .into_iter()
            .filter(|(board, ..)| boards.contains(board));
        let built: Vec<Recipe> = built.collect();
        for (board, _, word, features) in &built {
            let package = format!("board-{}", board.key());
            let triple = format!("--target={BOARD_TARGET}");
            let mut build = cargo_with(&[
                "build",
                "--profile=firmware",
                &triple,
                "--package",
                &package,
            ]);
            run(build.args(*features), "read the compiler's message above")?;
            let image = target.join(BOARD_TARGET).join("firmware").join(&package);
            for extension in ["elf", "d"] {
                let from = if extension == "d" {
                    image.with_extension("d")
                } else {
                    image.clone()
                };
                let to = folder.join(format!("{word}.{extension}"));
                fs::copy(&from, &to).map_err(|error| failed(&to, &error))?;
            }
        }
        Ok(Self { folder, built })
    }

    /// Where they are.
    pub(super) fn folder(&self) -> &Path {
        &self.folder
    }

    /// A board's image, with its default port or the other one.
    pub(super) fn of(&self, board: Board, other_port: bool) -> PathBuf {
        let wanted = |recipe: &&Recipe| recipe.0 == board && recipe.1 == other_port;
        let word = self
            .built
            .iter()
            .find(wanted)
            .map_or(board.key(), |recipe| recipe.2);
        self.folder.join(format!("{word}.elf"))
    }

    /// The environment by which the tests find them.
    pub(super) fn variables(&self) -> impl Iterator<Item = (String, PathBuf)> {
        self.built.iter().map(|(_, _, word, _)| {
            let variable = word.to_uppercase().replace('-', "_");
            (
                format!("CORTICODE_IMAGE_{variable}"),
                self.folder.join(format!("{word}.elf")),
            )
        })
    }
}

/// Builds the bridge, the one that users run, and returns where it is.
///
/// # Errors
/// It does not build.
pub(super) fn bridge() -> Result<PathBuf, Failure> {
    let mut build = cargo_with(&["build", "--package", "bridge"]);
    run(&mut build, "read the compiler's message above")?;
    Ok(emulator::target_folder()?
        .join("debug")
        .join("corticode-bridge"))
}
