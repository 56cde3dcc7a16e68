//! The benchmarks `model` and `montages`: cost of the model in a folder, and of a model with random
//! weights for each file in `files/montages/`. Neither instructions nor memory of an encoder depend
//! on the weights' values.

use std::path::{Path, PathBuf};

use any_model::any_artifact_for;
use anyhow::{Context, ensure};
use artifact::{Artifact, Mode, MontageFile};
use serde_json::{Map, Value as Json, json};

use super::cost;
use super::figures::Report;

/// Returns the report on the model in `folder`: encodes at least `windows` windows with it on each
/// emulated machine, and builds the boards' images with it.
///
/// # Errors
/// The folder has no model, the model does not fit a board, or QEMU or the target is missing.
pub(crate) fn measure_folder(folder: &Path, windows: usize) -> anyhow::Result<Report> {
    let name = folder.file_name().unwrap_or_default().to_string_lossy();
    let figures = cost::measure(&name, folder, windows, true)?;
    let next =
        "`cargo test --package pipeline --test streaming_equals_batch` with CORTICODE_ARTIFACT";
    Report::new("model", Json::Object(figures), next)
}

/// Name of the montage for which a model with convolutions is measured too: the largest montage
/// whose model has other convolutions than the checked-in model.
const CONVOLUTIONS: &str = "ten-twenty-32";

/// Seed of the random weights of every model.
const SEED: u32 = 1;

/// Returns the report on the models of all montages, or of the montage `only`. Encodes at least
/// `windows` windows with each model on each emulated machine. With `boards`, it includes flash and
/// RAM of the boards' images.
///
/// # Errors
/// No montage has the name, a montage file cannot be read, QEMU or the target is missing, or an
/// image does not build or run.
pub(crate) fn measure_montages(
    only: Option<&str>,
    windows: usize,
    boards: bool,
) -> anyhow::Result<Report> {
    let mut rows = Vec::new();
    for montage in selected(any_model::montages()?, only)? {
        for mode in modes(&montage) {
            let electrodes = montage.montage().electrodes.len();
            let artifact = any_artifact_for(SEED, &montage, mode, numbers(electrodes))?;
            let name = match mode {
                Mode::Pca => montage.name.clone(),
                _ => format!("{}, convolutions", montage.name),
            };
            eprintln!("{name}");
            let folder = write(&artifact, &name)?;
            rows.push(cost::measure(&name, &folder, windows, boards)?);
        }
    }
    report(&rows)
}

/// Returns the montage `only`, or all montages if `only` is `None`.
fn selected(
    mut montages: Vec<MontageFile>,
    only: Option<&str>,
) -> anyhow::Result<Vec<MontageFile>> {
    let names: Vec<String> = montages.iter().map(|each| each.name.clone()).collect();
    montages.retain(|montage| only.is_none_or(|only| montage.name == only));
    ensure!(
        !montages.is_empty(),
        "no file in files/montages/ has the name {}\n  next: one of {}",
        only.unwrap_or("of a montage"),
        names.join(", ")
    );
    Ok(montages)
}

/// Returns the modes of the models that are measured for a montage.
fn modes(montage: &MontageFile) -> Vec<Mode> {
    let mut modes = vec![Mode::Pca];
    if montage.name == CONVOLUTIONS {
        modes.push(Mode::Shortcut);
    }
    modes
}

/// Returns the number of values in a code: two for each electrode, rounded up to a multiple of 8.
/// For 61 electrodes this is the paper's 128.
fn numbers(electrodes: usize) -> usize {
    (2 * electrodes).next_multiple_of(8)
}

/// Writes a model to a folder of its own and returns the folder. Leaves a folder that already holds
/// this model unchanged, so that cargo does not build the images again.
fn write(artifact: &Artifact, name: &str) -> anyhow::Result<PathBuf> {
    let folder = cost::builds()?.join("models").join(name.replace(", ", "-"));
    let is_written = Artifact::read(&folder).is_ok_and(|written| written.id == artifact.id);
    if !is_written {
        let failed = || format!("{} cannot be written", folder.display());
        artifact.write(&folder).with_context(failed)?;
    }
    Ok(folder)
}

/// Builds the report; each row is the cost of one model.
fn report(rows: &[Map<String, Json>]) -> anyhow::Result<Report> {
    let all = |name: &str, sound: Json| rows.iter().all(|row| row.get(name) == Some(&sound));
    let figures = json!({
        "different_codes": rows.iter().filter_map(|row| row["different_codes"].as_u64()).sum::<u64>(),
        "constant_count": all("constant_count", true.into()),
        "montages": rows,
    });
    let next = "`cargo xtask bench montages --montage NAME` for the one that differs; then \
                `cargo test --package acceptance montages::`";
    Report::new("montages", figures, next)
}

#[cfg(test)]
mod tests {
    use emulator::installed;

    use super::*;

    /// Name of the montage whose images the tests build and run: the smallest one.
    const SMALL: &str = "cyton-8";

    fn row(different: u32, constant: bool) -> Map<String, Json> {
        let row = json!({"name": "a", "different_codes": different, "constant_count": constant});
        row.as_object().cloned().expect("an object")
    }

    #[test]
    fn one_different_code_of_one_montage_is_a_fault() {
        let report = |second| report(&[row(0, true), second]).expect("a report");
        assert_eq!(report(row(0, true)).faults(), [""; 0]);
        report(row(1, true)).assert_only_fault("different_codes is 1; the limit is at most 0");
        report(row(0, false)).assert_only_fault("constant_count is false;");
    }

    #[test]
    fn only_the_montage_that_is_asked_for_is_measured() {
        let montages = || any_model::montages().expect("files/montages/");
        assert!(montages().len() >= 5);
        let one = selected(montages(), Some(SMALL)).expect("a montage");
        assert_eq!(one.len(), 1);
        let unknown = selected(montages(), Some("none")).expect_err("no montage");
        assert!(unknown.to_string().contains(SMALL), "{unknown}");
        assert!(montages().iter().any(|montage| modes(montage).len() > 1));
    }

    #[test]
    fn both_microcontrollers_compute_the_reference_s_codes_for_eight_electrodes() {
        if !installed::available("codes of another montage on emulated microcontrollers") {
            return;
        }
        let report = measure_montages(Some(SMALL), 50, false).expect("a report");
        assert_eq!(report.faults(), [""; 0]);
        let row = &report.object["montages"][0];
        assert_eq!(row["electrodes"], 8);
        assert!(row["windows"].as_u64().is_some_and(|windows| windows >= 50));
        let [m4f, m7] = ["m4f", "m7"].map(|core| row[format!("{core}_insn_per_code")].as_u64());
        assert!(m4f > Some(1_000) && m7 > Some(1_000), "{row}");
    }
}
