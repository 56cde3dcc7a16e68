//! The benchmark `substitution`: counts the instructions that it takes to find and replace bad
//! electrodes, and compares the resulting steps with the PC's.

use any_model::any_artifact;
use anyhow::Context;
use artifact::{Mode, Padding};
use emulator::{Image, MACHINES};
use model::HOP;
use model_gen::pack;
use pipeline::{ExclusionPolicy, Sample, Step, Substitution};
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::figures::Report;
use super::images;
use super::inputs;
use crate::substituted::{OwnedTable, SAMPLES_PER_STEP, STEP_BYTES, to_bytes};
use crate::tally::Tally;

/// Number of steps of each input: 8 s, in which sixteen windows are judged.
const STEPS: usize = 1_024;

/// What the image `substitution` prints, as TOML.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Printed {
    state_bytes: usize,
    features_bytes: usize,
    inputs: Vec<Counted>,
}

/// Instruction counts of one input.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Counted {
    steps: Tally,
    samples: Tally,
    features: Tally,
}

/// Figures of one input on one machine.
#[derive(Debug, Serialize)]
struct Row {
    input: &'static str,
    insn_per_step: u64,
    insn_fewest_step: u32,
    insn_worst_step: u32,
    insn_worst_sample: u32,
    /// Mean number of instructions of the feature extraction in a hop. The next field holds the
    /// fewest and the most instructions in a step.
    insn_features_hop: u64,
    insn_features_step: [u32; 2],
    /// Number of electrodes that are excluded in the last step.
    excluded: u32,
}

/// Figures of all inputs on one machine.
#[derive(Debug, Serialize)]
struct Counts {
    core: &'static str,
    steps_equal: bool,
    rows: Vec<Row>,
}

/// Runs the image on each machine, with a table of random weights, and compares the resulting steps
/// with this PC's.
///
/// # Errors
/// QEMU or the target is missing, the image does not build or run, or an input cannot be made.
pub(crate) fn measure() -> anyhow::Result<Report> {
    let (bytes, table) = any_table()?;
    let inputs = inputs::steps(STEPS)?;
    let mut excluded = Vec::new();
    let mut expected = Vec::new();
    for steps in &inputs.data {
        let filled = fill(steps, &table);
        expected.extend(filled.iter().flat_map(|step| to_bytes(step, step.excluded)));
        excluded.extend(filled.last().map(|step| step.excluded.count_ones()));
    }
    let steps = inputs.data.iter().flatten();
    let steps = steps.flat_map(|step| to_bytes(step, step.saturated));
    let input = images::with_steps(STEPS, bytes.into_iter().chain(steps));
    let image = Image::build("bench", "substitution", &[])?;
    let mut machines = Vec::new();
    let [mut state_bytes, mut features_bytes] = [0; 2];
    for machine in MACHINES {
        let length = STEP_BYTES * STEPS * inputs.data.len();
        let (printed, output) =
            images::run::<Printed>(&image, machine, "bench/substitution", &input, length)?;
        state_bytes = printed.state_bytes;
        features_bytes = printed.features_bytes;
        let rows = inputs.names.iter().zip(&printed.inputs).zip(&excluded);
        machines.push(Counts {
            core: machine.core,
            steps_equal: output == expected,
            rows: rows
                .map(|((input, counted), excluded)| Row::new(input, counted, *excluded))
                .collect(),
        });
    }
    report(&machines, [state_bytes, features_bytes], &inputs.skipped)
}

/// Returns a table with random weights, as bytes of the input file and as a table on this PC.
fn any_table() -> anyhow::Result<(Vec<u8>, OwnedTable)> {
    let artifact = any_artifact(1, Mode::Pca, Padding::None, [2; 3], HOP)?;
    let table = artifact.substitution.context("a random model with a table")?;
    let bytes: Vec<u8> = (pack::substitution(&table).iter().map(|pair| pair.0.to_le_bytes()))
        .chain(table.innovation.iter().map(|energy| energy.to_le_bytes()))
        .flatten()
        .collect();
    let of_file = bytes.first_chunk().context("a table of this montage")?;
    let table = OwnedTable::from_bytes(of_file);
    Ok((bytes, table))
}

/// Replaces bad electrodes in the steps on this PC, as the image does.
fn fill(steps: &[Step], table: &OwnedTable) -> Vec<Step> {
    let mut substitution = Substitution::NEW;
    let filled = steps.iter().map(|step| {
        let mut step = Step { settling: false, ..*step };
        let mut sample = Sample::default();
        sample.counts[..step.electrodes.len()].copy_from_slice(&step.electrodes);
        (0..SAMPLES_PER_STEP).for_each(|_| substitution.observe_sample(&sample));
        substitution.fill_step(&mut step, ExclusionPolicy::AUTOMATIC, &table.borrow());
        step
    });
    filled.collect()
}

impl Row {
    fn new(input: &'static str, counted: &Counted, excluded: u32) -> Self {
        Self {
            input,
            insn_per_step: counted.steps.total / STEPS as u64,
            insn_fewest_step: counted.steps.fewest,
            insn_worst_step: counted.steps.most,
            insn_worst_sample: counted.samples.most,
            insn_features_hop: counted.features.total * HOP as u64 / STEPS as u64,
            insn_features_step: [counted.features.fewest, counted.features.most],
            excluded,
        }
    }
}

fn report(
    machines: &[Counts],
    [state_bytes, features_bytes]: [usize; 2],
    skipped: &[String],
) -> anyhow::Result<Report> {
    let rows = || machines.iter().flat_map(|machine| &machine.rows);
    let figures = json!({
        "insn_per_step": rows().map(|row| row.insn_per_step).max(),
        "insn_worst_step": rows().map(|row| row.insn_worst_step).max(),
        "insn_worst_sample": rows().map(|row| row.insn_worst_sample).max(),
        "insn_features_hop": rows().map(|row| row.insn_features_hop).max(),
        "features_constant": rows().all(|row| {
            row.insn_features_hop == rows().next().map_or(0, |first| first.insn_features_hop)
        }),
        "features_bytes": features_bytes,
        "steps_equal": machines.iter().all(|machine| machine.steps_equal),
        "state_bytes": state_bytes,
        "machines": machines,
        "skipped": skipped,
    });
    let next =
        "compare with `git log` of signal/pipeline/src/substitution, int8-nn and the toolchain";
    Report::new("substitution", figures, next)
}
