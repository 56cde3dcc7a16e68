//! Cost of a model on microcontrollers: instructions of its encoder on emulated microcontrollers,
//! flash and RAM of the boards' images. The encoder's codes are compared with those of model-gen's
//! batch reference.

mod boards;
mod reference;

use std::env;
use std::path::{Path, PathBuf};

use anyhow::Context;
use artifact::Artifact;
use emulator::{Image, MACHINES, OtherModel};
use serde_json::{Map, Value as Json, json};

use self::reference::Reference;
use super::images::{self, Range};

/// Returns the cost of the model in `folder` as an object of flat figures. Encodes at least
/// `windows` windows on each emulated machine. With `boards`, it includes flash and RAM of the
/// boards' images, whose builds take most of the time.
///
/// # Errors
/// The folder has no model that can be built, QEMU or the target is missing, or an image does not
/// run.
pub(crate) fn measure(
    name: &str,
    folder: &Path,
    windows: usize,
    boards: bool,
) -> anyhow::Result<Map<String, Json>> {
    let folder = folder.canonicalize().with_context(|| {
        let folder = folder.display();
        format!("there is no folder {folder}\n  next: name the folder that `trainer train` wrote")
    })?;
    let artifact = Artifact::read(&folder)?;
    let reference = Reference::new(&artifact, windows)?;
    let target = builds()?;
    let model = OtherModel { artifact: &folder, target: &target };
    let mut figures = described(name, &artifact);
    figures.insert("windows".into(), reference.windows.into());
    let (mut different, mut constant, mut state) = (0, true, 0);
    for machine in MACHINES {
        let image = Image::build_with_model(model, "bench", "encoder", machine.features)?;
        let (printed, different_here) = reference.expected.run(&image, machine, "bench/cost")?;
        let steps = Range::of_columns(&printed.inputs, reference.hop)?;
        different += different_here;
        constant &= steps.iter().all(|step| step.constant);
        state = state.max(printed.ram_bytes);
        let sum = steps.iter().map(|step| step.most).sum::<u32>();
        let hop = u32::try_from(steps.len()).unwrap_or(u32::MAX);
        let key = machine.core.replace("Cortex-", "").to_lowercase();
        for (figure, instructions) in [
            ("insn_per_code", sum),
            ("insn_mean_step", sum / hop.max(1)),
            ("insn_worst_step", steps.iter().map(|step| step.most).max().unwrap_or(0)),
            ("insn_filters_per_code", printed.acquisition_per_code),
        ] {
            figures.insert(format!("{key}_{figure}"), instructions.into());
        }
    }
    figures.insert("state_bytes".into(), state.into());
    figures.insert("path_flash_bytes".into(), path(model)?.into());
    if boards {
        figures.extend(boards::measure(model)?);
    }
    figures.insert("constant_count".into(), constant.into());
    figures.insert("different_codes".into(), different.into());
    Ok(figures)
}

/// Returns the folder, within cargo's target folder, in which images with other models are built.
///
/// # Errors
/// This program is not where cargo builds programs.
pub(crate) fn builds() -> anyhow::Result<PathBuf> {
    let program = env::current_exe().context("this program has no path")?;
    // Skip `deps`, where cargo puts test programs: `target/debug/deps/bench-*`.
    let mut folders = program.ancestors().skip(1);
    let profile = folders.find(|folder| !folder.ends_with("deps"));
    let target = profile.and_then(Path::parent).context(
        "this program is not in cargo's target folder\n  next: start it by `cargo xtask bench`",
    )?;
    Ok(target.join("variants"))
}

/// Returns the sizes that the model's description states, as figures of the report.
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

/// Builds the images `size` and `tasks`, and checks that no path through acquisition and encoder
/// panics or allocates. Returns the flash that acquisition and encoder take, in bytes.
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
