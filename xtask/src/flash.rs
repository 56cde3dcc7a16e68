//! `cargo fw` and `cargo flash`: build the image of a board, print for which model and converters
//! it is built, and write it to a file or to the board.

use std::env;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::command::{AFTER_A_BUILD, BOARD_TARGET, Failure, OrFail, output, print, replace, root};
use crate::images::{self, ARTIFACT, Board};
use crate::{dfu, install, programs};

/// Number of channels of an ADS1299.
const CHANNELS_PER_CHIP: u32 = 8;

/// The fields of `model.toml` that a board's wiring depends on.
#[derive(Debug, Deserialize)]
struct Model {
    montage: Montage,
    adc: Adc,
}

#[derive(Debug, Deserialize)]
struct Montage {
    electrodes: Vec<String>,
}

#[derive(Debug, Deserialize)]
struct Adc {
    rate_hz: u32,
    gain: u32,
    channels: u32,
    // Absent for their default values.
    wiring: Option<String>,
    clock: Option<String>,
    control: Option<String>,
}

/// Options of `cargo fw` and `cargo flash`.
#[derive(Debug, clap::Args)]
pub(crate) struct Options {
    /// Board for which the image is built
    #[arg(long, value_enum, default_value_t = Board::H743)]
    board: Board,
    /// Features of the board's crate, separated by commas, such as `uart`
    #[arg(long)]
    features: Option<String>,
    /// Build without the default features of the board's crate
    #[arg(long)]
    no_default_features: bool,
    /// Options of `probe-rs run`, after `--`
    #[arg(last = true)]
    runner: Vec<String>,
}

/// Prints the model and the converters that the image is for, and builds the image. With `flash`,
/// runs it on the board. Otherwise writes it as a file for `corticode-bridge update` and prints the
/// file's path; for a board that takes no update, prints the path of the ELF file.
pub(crate) fn image(options: &Options, flash: bool) -> Result<(), Failure> {
    install::board_target()?;
    let board = options.board;
    let named = env::var_os(ARTIFACT).map(PathBuf::from);
    let model = named.or_else(|| board.model());
    let built_in = || root().join("signal/model/artifact");
    let folder = model.clone().unwrap_or_else(built_in);
    let folder = folder.canonicalize().unwrap_or(folder);
    eprintln!("image for {}\n{}", board.name(), summary(&folder)?);
    let verb = if flash { "run" } else { "build" };
    if flash {
        programs::require_probe_rs()?;
    }
    let key = board.key();
    let words = format!("{verb} --package=board-{key} --profile=firmware --target={BOARD_TARGET}");
    let mut command = images::cargo_for(model.as_deref(), &words);
    if options.no_default_features {
        command.arg("--no-default-features");
    }
    if let Some(features) = &options.features {
        command.args(["--features", features]);
    }
    if flash {
        let runner = format!("probe-rs run --chip {}", board.chip());
        command.env("CARGO_TARGET_THUMBV7EM_NONE_EABIHF_RUNNER", runner);
        command.arg("--").args(&options.runner);
        return replace(&mut command);
    }
    command.arg("--message-format=json-render-diagnostics");
    let messages = output(&mut command, AFTER_A_BUILD)?;
    let file = if board.has_loader() { dfu::write(board, &messages)? } else { dfu::elf(&messages) };
    print(format_args!("{}\n", file.display()))
}

/// Returns what the model in `folder` expects of the converters, one item per line.
fn summary(folder: &Path) -> Result<String, Failure> {
    let path = folder.join("model.toml");
    let next = "set CORTICODE_ARTIFACT to the absolute path of a folder that `trainer` has written, or \
                unset it for the default model";
    let text =
        std::fs::read_to_string(&path).or_fail(format!("reading {}", path.display()), next)?;
    let model: Model =
        toml::from_str(&text).or_fail(format!("reading {}", path.display()), next)?;
    let packed = if folder.join("packed.toml").exists() { " (with the packed code)" } else { "" };
    Ok(format!(
        "  model       {}{packed}\n  electrodes  {}\n  converters  {} ADS1299 ({}) at {} Hz, gain {}\n  \
         clock       {}\n  START       {}",
        folder.display(),
        model.montage.electrodes.len(),
        model.adc.channels.div_ceil(CHANNELS_PER_CHIP),
        model.adc.wiring.as_deref().unwrap_or("daisy"),
        model.adc.rate_hz,
        model.adc.gain,
        match model.adc.clock.as_deref() {
            Some("internal") => "inside the ADS1299, CLKSEL high".to_owned(),
            _ => format!("{} MHz at CLK, CLKSEL low", clock_mhz(model.adc.rate_hz)),
        },
        match model.adc.control.as_deref() {
            Some("commands") => "opcodes; START wired to DGND, RESET to DVDD",
            _ => "pins START and RESET",
        },
    ))
}

/// Returns the frequency in MHz of the external clock with which an ADS1299 samples at `rate_hz`:
/// 2^21 Hz if the rate is a power of two, otherwise 2.048 MHz (data sheet section 9.6.1.2).
const fn clock_mhz(rate_hz: u32) -> f64 {
    if rate_hz.is_power_of_two() { 2.097_152 } else { 2.048 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_model_needs_eight_chips_and_a_clock_of_2_21_hz() {
        let summary = summary(&root().join("signal/model/artifact")).expect("the default model");
        let expected = "8 ADS1299 (daisy) at 512 Hz, gain 24\n  clock       2.097152 MHz at CLK";
        assert!(summary.contains(expected), "{summary}");
        assert!(summary.contains("electrodes  61"), "{summary}");
        assert!(clock_mhz(250) < 2.05 && clock_mhz(1024) > 2.05);
    }

    #[test]
    fn a_folder_without_a_model_is_named_with_the_remedy() {
        let failure = summary(Path::new("/nowhere")).expect_err("no model");
        assert_eq!(failure.status, 1);
        let message = failure.message;
        assert!(message.contains("/nowhere/model.toml"), "{message}");
        assert!(message.contains(ARTIFACT), "{message}");
    }
}
