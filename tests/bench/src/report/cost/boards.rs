//! Measures flash and RAM of the boards' images when built with a model.

use std::env;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, ensure};
use emulator::{EmulatorError, Image, OtherModel};
use serde::Deserialize;
use serde_json::{Map, Value as Json};

/// Boards whose images are built: name of the image file, and package.
const BOARDS: [(&str, &str); 2] = [("f446", "board-f446"), ("h743", "board-h743")];

/// The fields that the report uses of the JSON object printed by the program `budget`.
#[derive(Debug, Deserialize)]
struct Budget {
    boards: Vec<Board>,
    faults: Vec<String>,
}

#[derive(Debug, Deserialize)]
struct Board {
    board: String,
    regions: Vec<Region>,
}

/// Use of one of a board's memory regions, bytes.
#[derive(Debug, Deserialize)]
struct Region {
    #[serde(rename = "region")]
    name: String,
    used: Option<u64>,
    length: u64,
}

/// Builds the images of the boards, as they are flashed, with their default port. Returns the flash
/// and RAM that each takes and leaves free, bytes.
///
/// # Errors
/// An image does not link because the model does not fit, or the program `budget` does not run.
pub(super) fn measure(model: OtherModel<'_>) -> anyhow::Result<Map<String, Json>> {
    let folder = model.target.join("bench/boards");
    fs::create_dir_all(&folder).map_err(EmulatorError::file(&folder))?;
    for (name, package) in BOARDS {
        let image = Image::build_with_model(model, package, package, &[]).with_context(|| {
            format!(
                "the image of {package} cannot be made\n  next: read the linker's message above; if a region \
                 overflows, fewer numbers per code or mode `pca` make the model smaller"
            )
        })?;
        let copy = folder.join(name).with_extension("elf");
        fs::copy(image.path(), &copy).map_err(EmulatorError::file(&copy))?;
    }
    figures(&budget(&folder)?)
}

/// Runs the program `budget` on the images in `folder` and returns its output.
fn budget(folder: &Path) -> anyhow::Result<Budget> {
    let mut cargo = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo
        .args(["run", "--quiet", "--package=budget", "--"])
        .arg(folder)
        .args(["--json", "--default-images"])
        .current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
        .stderr(Stdio::inherit());
    let output = cargo.output().context("cargo does not start")?;
    serde_json::from_slice(&output.stdout).with_context(|| {
        format!(
            "the program `budget` failed: {}\n  next: run it by hand: `{cargo:?}`",
            output.status
        )
    })
}

/// Returns the figures of flash and RAM, with the board's name in the name of each figure.
fn figures(budget: &Budget) -> anyhow::Result<Map<String, Json>> {
    let mut figures = Map::new();
    for (name, _) in BOARDS {
        let is_named = |board: &&Board| board.board.contains(&name.to_uppercase());
        let board = budget.boards.iter().find(is_named);
        let regions = board.map(|board| &board.regions[..]).unwrap_or_default();
        for region in ["FLASH", "RAM"] {
            let used = regions.iter().find(|each| each.name == region);
            let used = used.and_then(|each| Some((each.used?, each.length)));
            let (used, length) = used.with_context(|| format!("`budget` prints no {region}"))?;
            let region = region.to_lowercase();
            figures.insert(format!("{name}_{region}_bytes"), used.into());
            let left = length.saturating_sub(used);
            figures.insert(format!("{name}_{region}_left"), left.into());
        }
    }
    ensure!(
        budget.faults.is_empty(),
        "the images exceed their limits: {}\n  next: fewer numbers per code make the model smaller",
        budget.faults.join("; ")
    );
    Ok(figures)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PRINTED: &str = r#"{"boards": [
        {"board": "NUCLEO-H743ZI2", "regions": [
            {"region": "FLASH", "length": 900, "used": 300, "left": 600, "limit": 400},
            {"region": "ITCM", "length": 9, "used": null, "left": null, "limit": null},
            {"region": "RAM", "length": 90, "used": 30, "left": 60, "limit": 40}]},
        {"board": "NUCLEO-F446RE", "regions": [
            {"region": "FLASH", "length": 500, "used": 200, "left": 300, "limit": 400},
            {"region": "RAM", "length": 50, "used": 20, "left": 30, "limit": 40}]}],
        "faults": []}"#;

    #[test]
    fn each_board_has_its_flash_and_ram_and_a_fault_is_an_error() {
        let mut budget: Budget = serde_json::from_str(PRINTED).expect("JSON");
        let measured = figures(&budget).expect("figures");
        for (name, bytes) in [
            ("f446_flash_bytes", 200),
            ("f446_ram_left", 30),
            ("h743_flash_left", 600),
            ("h743_ram_bytes", 30),
        ] {
            assert_eq!(measured[name], bytes, "{name}");
        }
        budget.faults.push("NUCLEO-F446RE: 600 bytes of FLASH".to_owned());
        let why = figures(&budget).expect_err("a fault").to_string();
        assert!(why.contains("600 bytes of FLASH"), "{why}");
        budget.boards.clear();
        assert!(figures(&budget).is_err());
    }
}
