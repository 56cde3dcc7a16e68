//! Builds the images for the boards as `cargo flash` does.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use clap::ValueEnum;

use crate::command::{
    AFTER_A_BUILD, BOARD_TARGET, Failure, OrFail, cargo, root, run, target_folder,
};
use crate::install;

/// Environment variable that names the folder of a model other than a board's default model.
pub(crate) const ARTIFACT: &str = "CORTICODE_ARTIFACT";

/// Board for which images are built.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Board {
    /// NUCLEO-H743ZI2.
    H743,
    /// NUCLEO-F446RE.
    F446,
    /// ironbci, with one converter.
    Ironbci,
}

impl Board {
    /// Name of the board on the command line and in the names of images, packages and tests.
    pub(crate) const fn key(self) -> &'static str {
        ["h743", "f446", "ironbci"][self as usize]
    }

    /// Name of the board as it is sold.
    pub(crate) const fn name(self) -> &'static str {
        ["NUCLEO-H743ZI2", "NUCLEO-F446RE", "ironbci"][self as usize]
    }

    /// Name of the board's microcontroller for probe-rs.
    pub(crate) const fn chip(self) -> &'static str {
        ["STM32H743ZITx", "STM32F446RETx", "STM32F407VETx"][self as usize]
    }

    /// Folder of the board's default model; `None` for the built-in one.
    pub(crate) fn model(self) -> Option<PathBuf> {
        (self == Self::Ironbci).then(|| root().join("signal/model/ironbci"))
    }

    /// Whether a host can reach the boot loader in the microcontroller's ROM.
    pub(crate) const fn has_loader(self) -> bool {
        !matches!(self, Self::Ironbci)
    }
}

/// A board with its converters, on which images are tested.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Rig {
    /// NUCLEO-H743ZI2 with eight converters.
    H743,
    /// NUCLEO-F446RE with eight converters.
    F446,
    /// ironbci.
    Ironbci,
    /// NUCLEO-H743ZI2 with one converter at 250 Hz.
    #[value(name = "kit-250")]
    Kit250,
    /// NUCLEO-H743ZI2 with one converter at 500 Hz.
    #[value(name = "kit-500")]
    Kit500,
    /// NUCLEO-H743ZI2 with two converters in a daisy chain.
    #[value(name = "cyton-16")]
    Cyton16,
    /// NUCLEO-H743ZI2 with four cascaded converters.
    #[value(name = "ten-twenty-32")]
    TenTwenty32,
}

impl Rig {
    pub(crate) const ALL: [Self; 7] = [
        Self::H743,
        Self::F446,
        Self::Ironbci,
        Self::Kit250,
        Self::Kit500,
        Self::Cyton16,
        Self::TenTwenty32,
    ];

    /// Name of the rig on the command line, and of its default image.
    pub(crate) const fn key(self) -> &'static str {
        ["h743", "f446", "ironbci", "kit-250", "kit-500", "cyton-16", "ten-twenty-32"]
            [self as usize]
    }

    pub(crate) const fn board(self) -> Board {
        match self {
            Self::F446 => Board::F446,
            Self::Ironbci => Board::Ironbci,
            _ => Board::H743,
        }
    }

    /// Names of the images, each with the cargo arguments that select it: first the image for the
    /// port that is not the default, last the default image.
    pub(crate) const fn images(self) -> &'static [[&'static str; 2]] {
        match self {
            Self::H743 => &[
                ["h743-uart", "--package=board-h743 --features=uart"],
                ["h743", "--package=board-h743"],
            ],
            Self::F446 => &[
                ["f446-usb", "--package=board-f446 --no-default-features --features=network"],
                [
                    "f446-packed",
                    "--package=board-f446 --no-default-features --features=uart,packed",
                ],
                ["f446", "--package=board-f446"],
            ],
            Self::Ironbci => &[["ironbci", "--package=board-ironbci"]],
            Self::Kit250 => &[["kit-250", "--package=board-h743"]],
            Self::Kit500 => &[["kit-500", "--package=board-h743"]],
            Self::Cyton16 => &[["cyton-16", "--package=board-h743"]],
            Self::TenTwenty32 => &[["ten-twenty-32", "--package=board-h743"]],
        }
    }

    /// Folder of the model that the rig's images contain; `None` for the built-in one.
    pub(crate) fn model(self) -> Option<PathBuf> {
        match self {
            Self::H743 | Self::F446 | Self::Ironbci => self.board().model(),
            Self::Kit250 | Self::Kit500 => Some(root().join("signal/model").join(self.key())),
            Self::Cyton16 | Self::TenTwenty32 => {
                Some(target_folder().join("virtual-board/models").join(self.key()))
            }
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

/// Builds the images of a rig, the default image last. Cargo writes all images of a board to the
/// same path, so each is copied to a file of its own, with the list of its sources (`.d`).
pub(crate) fn build(rig: Rig) -> Result<(), Failure> {
    let model = rig.model();
    if let (Some(model), Rig::Cyton16 | Rig::TenTwenty32) = (&model, rig) {
        write_random_model(rig, model)?;
    }
    build_to(&folder(), rig, rig.images(), model.as_deref())
}

/// Builds `images` of a rig with the model in the folder `model`, or the built-in one, and copies
/// them to `folder`.
fn build_to(
    folder: &Path,
    rig: Rig,
    images: &[[&str; 2]],
    model: Option<&Path>,
) -> Result<(), Failure> {
    install::board_target()?;
    let built = target_folder().join(BOARD_TARGET).join("firmware");
    let built = built.join(format!("board-{}", rig.board().key()));
    for [name, selection] in images {
        let words = format!("build --profile=firmware --target={BOARD_TARGET} {selection}");
        run(&mut cargo_for(model, &words), AFTER_A_BUILD)?;
        let image = folder.join(name).with_extension("elf");
        let copied = fs::create_dir_all(folder)
            .and_then(|()| fs::copy(&built, &image))
            .and_then(|_| fs::read_to_string(built.with_extension("d")))
            .and_then(|list| fs::write(image.with_extension("d"), sources(&list)));
        copied.or_fail(
            format!("copying {}", built.display()),
            "is the disk full? is CARGO_TARGET_DIR writable?",
        )?;
    }
    Ok(())
}

/// Builds the image `name` of a rig with the user's model in the folder `model`. Returns the
/// image's folder, which is separate from the folder of the rig's own images.
pub(crate) fn build_with(rig: Rig, name: &str, model: &Path) -> Result<PathBuf, Failure> {
    let folder = folder().join("own-model");
    let wanted = rig.images().iter().filter(|[image, _]| *image == name);
    let wanted: Vec<_> = wanted.copied().collect();
    build_to(&folder, rig, &wanted, Some(model))?;
    Ok(folder)
}

/// Returns cargo's list of an image's sources. Leaves out generated files, because a build with
/// another model overwrites them.
fn sources(list: &str) -> String {
    let target = target_folder();
    let is_source = |path: &&str| !Path::new(path).starts_with(&target);
    let (image, sources) = list.split_once(": ").unwrap_or((list, ""));
    let sources = sources.split_ascii_whitespace().filter(is_source);
    format!("{image}: {}\n", sources.collect::<Vec<_>>().join(" "))
}

/// Returns a cargo command for images with the model in `model`, or with the built-in one.
///
/// With another model, the crates that depend on the model are compiled with a changed profile. So
/// their files get other names, and the files with the built-in model remain. Tests and `cargo
/// flash` both use this command, so that the image that is flashed is, byte for byte, the one that
/// virtual boards have run.
pub(crate) fn cargo_for(model: Option<&Path>, words: &str) -> Command {
    let mut cargo = cargo(words);
    match model {
        Some(folder) => {
            let dependents = ["model", "pipeline", "device", "firmware", "board-stm32"];
            let boards = ["board-h743", "board-ironbci"];
            for name in dependents.into_iter().chain(boards) {
                cargo.arg(format!("--config=profile.firmware.package.{name}.debug=1"));
            }
            cargo.env(ARTIFACT, folder)
        }
        None => cargo.env_remove(ARTIFACT),
    };
    cargo
}

/// Writes a model with random weights for the montage with the rig's name.
fn write_random_model(rig: Rig, folder: &Path) -> Result<(), Failure> {
    let montage = root().join("files/montages").join(rig.key());
    let mut write = cargo("run --quiet --package any-model --");
    write.env_remove(ARTIFACT);
    write.arg(montage.with_extension("toml")).arg(folder);
    run(&mut write, AFTER_A_BUILD)
}
