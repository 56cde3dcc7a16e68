//! Cost of a model on microcontrollers: instructions of its encoder on the emulated ones, flash and
//! RAM of the boards' images. Its codes are compared with those of model-gen's batch reference.

mod boards;
mod reference;

use std::env;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use artifact::Artifact;
use emulator::{Image, MACHINES, Machine, OtherModel};
use serde::Deserialize;
use serde_json::{Map, Value as Json, json};

use self::reference::Reference;
use super::images::{self, Range};
use crate::tally::Tally;

/// Parts of a cost that are measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Parts {
    /// Instructions and codes.
    Encoder,
    /// Instructions, codes, and the images of the boards, whose builds take most of the time.
    EncoderAndBoards,
}

/// Counts that the image of the encoder prints, as TOML, as far as they are used here.
#[derive(Debug, Deserialize)]
struct Printed {
    /// RAM that the state of acquisition and encoder occupies, bytes.
    ram_bytes: u32,
    /// Number of instructions of the acquisition for all time steps of one code.
    acquisition_per_code: u32,
    /// For each input, the tally of each time step of a hop.
    inputs: Vec<Vec<Tally>>,
}

/// Returns the cost of the model in `folder`, with `windows` windows encoded on each emulated
/// machine, as an object of figures without nested values.
///
/// # Errors
/// The folder has no model that can be built, QEMU or the target is missing, or an image does not
/// run.
pub(crate) fn measure(
    name: &str,
    folder: &Path,
    windows: usize,
    parts: Parts,
) -> anyhow::Result<Map<String, Json>> {
    let folder = folder.canonicalize().with_context(|| {
        let folder = folder.display();
        format!("there is no folder {folder}\n  next: name the folder that `trainer train` wrote")
    })?;
    let artifact = Artifact::read(&folder)?;
    let reference = Reference::new(&artifact, windows)?;
    let target = builds()?;
    let model = OtherModel {
        artifact: &folder,
        target: &target,
    };
    let mut figures = described(name, &artifact);
    figures.insert("windows".into(), reference.windows.into());
    let (mut different, mut constant, mut state) = (0, true, 0);
    for machine in MACHINES {
        let image = Image::build_with_model(model, "bench", "encoder", machine.features)?;
        let counted = count(&image, machine, &reference)?;
        different += counted.different_codes;
        constant &= counted.steps.iter().all(|step| step.constant);
        state = state.max(counted.printed.ram_bytes);
        let key = machine.core.replace("Cortex-", "").to_lowercase();
        for (figure, instructions) in counted.figures() {
            figures.insert(format!("{key}_{figure}"), instructions);
        }
    }
    figures.insert("state_bytes".into(), state.into());
    figures.insert("path_flash_bytes".into(), path(model)?.into());
    if parts == Parts::EncoderAndBoards {
        figures.extend(boards::measure(model)?);
    }
    figures.insert("constant_count".into(), constant.into());
    figures.insert("different_codes".into(), different.into());
    Ok(figures)
}

/// Returns the folder for builds with other models, in cargo's target folder.
///
/// # Errors
/// This program is not where cargo builds programs.
pub(crate) fn builds() -> anyhow::Result<PathBuf> {
    let program = env::current_exe().context("this program has no path")?;
    // A test is one level deeper: `target/debug/deps/bench-*`.
    let mut folders = program.ancestors().skip(1);
    let profile = folders.find(|folder| !folder.ends_with("deps"));
    let target = profile.and_then(Path::parent).context(
        "this program is not in cargo's target folder\n  next: start it by `cargo xtask bench`",
    )?;
    Ok(target.join("variants"))
}

/// Returns what the model's description states about its size.
fn described(name: &str, artifact: &Artifact) -> Map<String, Json> {
    let description = &artifact.description;
    let dimensions = description.dimensions();
    let object = json!({
        "name": name,
        "electrodes": dimensions.electrodes,
        "converters": description.adc.channels / artifact::CHIP_CHANNELS,
        "grid": format!("{} x {}", dimensions.rows, dimensions.columns),
        "mode": description.mode,
        "numbers": dimensions.numbers,
    });
    object.as_object().cloned().unwrap_or_default()
}

/// Builds the images that show that no path from sample to code panics or allocates; returns the
/// flash that this path takes, bytes.
///
/// # Errors
/// A path panics or allocates.
fn path(model: OtherModel<'_>) -> anyhow::Result<usize> {
    let features = MACHINES[0].features;
    let bare = Image::build_with_model(model, "bench", "size", features)?;
    let tasks = Image::build_with_model(model, "bench", "tasks", features)?;
    images::check_panics(&images::loaded(tasks.path())?)?;
    Ok(images::loaded(bare.path())?.len())
}

/// Result of one run of the image of the encoder.
#[derive(Debug)]
struct Counted {
    printed: Printed,
    /// Instructions of each time step of a hop.
    steps: Vec<Range>,
    /// Number of codes, and of digests of random networks, that are not those of the reference.
    different_codes: usize,
}

/// Runs the image of the encoder and compares its codes with the reference.
fn count(image: &Image, machine: Machine, reference: &Reference) -> anyhow::Result<Counted> {
    let (printed, different) = reference
        .expected
        .run::<Printed>(image, machine, "bench/cost")?;
    let hop = reference.hop;
    ensure!(
        !printed.inputs.is_empty() && printed.inputs.iter().all(|input| input.len() == hop),
        "the image counts other time steps than the {hop} of a hop\n  next: `cargo clean --package bench`"
    );
    let steps =
        (0..hop).map(|step| Range::new(printed.inputs.iter().map(move |input| input[step])));
    Ok(Counted {
        steps: steps.collect(),
        printed,
        different_codes: different.iter().sum(),
    })
}

impl Counted {
    /// Returns the figures of the machine: for each code, and for the time steps of a hop their
    /// mean and the longest.
    fn figures(&self) -> [(&'static str, Json); 4] {
        let most = || self.steps.iter().map(|step| step.most);
        let sum: u32 = most().sum();
        let hop = u32::try_from(self.steps.len()).unwrap_or(u32::MAX);
        [
            ("insn_per_code", sum.into()),
            ("insn_mean_step", (sum / hop.max(1)).into()),
            ("insn_worst_step", most().max().into()),
            (
                "insn_filters_per_code",
                self.printed.acquisition_per_code.into(),
            ),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_code_is_the_sum_of_its_time_steps_and_the_longest_is_named() {
        let tally = |most| Tally {
            fewest: most,
            most,
            total: u64::from(most),
        };
        let printed = Printed {
            ram_bytes: 1,
            acquisition_per_code: 7,
            inputs: Vec::new(),
        };
        let steps = [10, 10, 10, 18].map(|most| Range::new([tally(most), tally(most)].into_iter()));
        let counted = Counted {
            printed,
            steps: steps.into(),
            different_codes: 0,
        };
        let values = counted.figures().map(|(_, value)| value);
        assert_eq!(values, [json!(48), json!(12), json!(18), json!(7)]);
    }
}
