//! The benchmark `packed`: measures instructions, memory, bits and error of the packed code.

use std::env;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use artifact::Description;
use artifact::reconstruction::PackedDecoder;
use emulator::{Image, MACHINES, Machine};
use model::HOP;
use pipeline::{PackedEncoder, Step};
use serde::{Deserialize, Serialize};
use serde_json::{Value as Json, json};
use trainer::comparison::{self, CodeComparison};
use trainer::progress::ProgressObserver;
use trainer::selection::TestFiles;

use super::checked_in;
use super::figures::Report;
use super::images;
use super::inputs::{self, Inputs};
use crate::tally::Tally;

/// Instruction counts and memory that the image `packed` prints, as TOML.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Printed {
    ram_bytes: u32,
    inputs: Vec<Counted>,
}

/// Instruction tallies of one input: one for each time step of a hop, and one over whole hops.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Counted {
    places: [Tally; HOP],
    hops: Tally,
}

/// Figures of one input on one machine: instructions, block lengths and block kinds.
#[derive(Debug, Serialize)]
struct Row {
    input: &'static str,
    insn_per_hop: u64,
    insn_worst_hop: u32,
    insn_after_last_sample: u32,
    bits_per_hop: f64,
    longest_bytes: usize,
    blank: usize,
    misfit: usize,
}

/// Figures of all inputs on one machine.
#[derive(Debug, Serialize)]
struct Counts {
    core: &'static str,
    bytes_equal: bool,
    rows: Vec<Row>,
}

/// Packed blocks that this PC computes from one input.
#[derive(Debug, Default)]
struct Coded {
    /// Length (one byte) and bytes of each block, as the image writes them.
    output: Vec<u8>,
    lengths: Vec<usize>,
    blank: usize,
    misfit: usize,
    /// Whether decoder and encoder had equal states after every block.
    decoder_equal: bool,
}

/// Runs the packed encoder on each machine, and returns the report with all figures.
///
/// # Errors
/// QEMU or the target is missing, an image does not build or run, or an input cannot be made.
pub(crate) fn measure(hops: usize) -> anyhow::Result<Report> {
    let inputs = inputs::steps(hops * HOP)?;
    let coded = inputs.data.iter().map(|steps| coded(steps)).collect::<anyhow::Result<Vec<_>>>()?;
    let expected: Vec<u8> = coded.iter().flat_map(|coded| coded.output.clone()).collect();
    let mut machines = Vec::new();
    let (mut flash_bytes, mut ram_bytes) = (0, 0);
    for machine in MACHINES {
        let features = [machine.features, &["--features=packed"]].concat();
        let bare = Image::build("bench", "size", &features)?;
        flash_bytes = images::loaded(bare.path())?.len().max(flash_bytes);
        let image = Image::build("bench", "packed", machine.features)?;
        let (printed, output) = run(&image, machine, &inputs, expected.len())?;
        ram_bytes = printed.ram_bytes.max(ram_bytes);
        let counts = printed.inputs.iter().zip(&inputs.names).zip(&coded);
        machines.push(Counts {
            core: machine.core,
            bytes_equal: output == expected,
            rows: counts.map(|((counted, name), coded)| row(name, counted, coded)).collect(),
        });
    }
    report(&inputs, &machines, &coded, flash_bytes, ram_bytes)
}

fn run(
    image: &Image,
    machine: Machine,
    inputs: &Inputs<Step>,
    length: usize,
) -> anyhow::Result<(Printed, Vec<u8>)> {
    let steps = inputs.data.first().map_or(0, Vec::len);
    let electrodes = inputs.data.iter().flatten().flat_map(|step| step.electrodes);
    let input = images::with_steps(steps, electrodes.flat_map(i32::to_le_bytes));
    images::run(image, machine, "bench/packed", &input, length)
}

/// Encodes the time steps of one input on this PC and decodes each block.
fn coded(steps: &[Step]) -> anyhow::Result<Coded> {
    let artifact = checked_in::artifact()?;
    let model = artifact.packed.as_ref();
    let model = model.context("the built-in model has no packed model")?;
    let (mut encoder, mut decoder) = (PackedEncoder::new(), PackedDecoder::new(model));
    let rate = PackedEncoder::DEFAULT_RATE;
    let mut coded = Coded { decoder_equal: true, ..Coded::default() };
    for step in steps {
        let Some(code) = encoder.encode_step(step) else {
            continue;
        };
        let bytes = code.bytes();
        let length = u8::try_from(bytes.len()).context("a block of at most 118 bytes")?;
        coded.output.push(length);
        coded.output.extend(bytes);
        coded.lengths.push(bytes.len());
        coded.blank += usize::from(code.is_blank);
        coded.misfit += usize::from(code.is_misfit);
        let is_read = decoder.decode(bytes, rate).is_ok();
        coded.decoder_equal &= is_read && decoder.state() == encoder.state();
    }
    ensure!(!coded.lengths.is_empty(), "an input has no block");
    Ok(coded)
}

fn row(input: &'static str, counted: &Counted, coded: &Coded) -> Row {
    let hops = coded.lengths.len();
    #[expect(clippy::cast_precision_loss, reason = "far fewer than 2^53")]
    let bits_per_hop = 8.0 * coded.lengths.iter().sum::<usize>() as f64 / hops as f64;
    let last = counted.places.last().map_or(u32::MAX, |tally| tally.most);
    Row {
        input,
        insn_per_hop: counted.hops.total / hops as u64,
        insn_worst_hop: counted.hops.most,
        insn_after_last_sample: last,
        bits_per_hop,
        longest_bytes: coded.lengths.iter().copied().max().unwrap_or(0),
        blank: coded.blank,
        misfit: coded.misfit,
    }
}

/// Builds the report; `machines` are in the order of [`MACHINES`]. The limits apply to the last
/// input (real EEG if available, otherwise synthetic EEG) on the Cortex-M4F.
fn report(
    inputs: &Inputs<Step>,
    machines: &[Counts],
    coded: &[Coded],
    flash_bytes: usize,
    ram_bytes: u32,
) -> anyhow::Result<Report> {
    let rows = &machines.first().context("a machine")?.rows;
    let eeg = rows.last().context("an input")?;
    let worst = rows.iter().map(|row| row.insn_worst_hop).max();
    let recorded = recorded_errors()?;
    #[expect(clippy::cast_precision_loss, reason = "below 2^53")]
    let worst_over_mean = f64::from(eeg.insn_worst_hop) / eeg.insn_per_hop as f64;
    let figures = json!({
        "bits_per_hop": recorded["bits_per_hop"],
        "mse": recorded["mse"],
        "mse_smoothed": recorded["mse_smoothed"],
        "pca_int8_bits": recorded["pca_int8_bits"],
        "pca_int8_mse": recorded["pca_int8_mse"],
        "int8_mse_over_float": recorded["int8_mse_over_float"],
        "float_mse_over_pca": recorded["float_mse_over_pca"],
        "prd_change_from_card": recorded["prd_change_from_card"],
        "insn_per_hop": eeg.insn_per_hop,
        "insn_worst_hop": eeg.insn_worst_hop,
        "insn_worst_hop_any_input": worst,
        "worst_over_mean": worst_over_mean,
        "insn_after_last_sample": eeg.insn_after_last_sample,
        "flash_bytes": flash_bytes,
        "ram_bytes": ram_bytes,
        "bytes_equal": machines.iter().all(|counts| counts.bytes_equal),
        "decoder_equal": coded.iter().all(|coded| coded.decoder_equal),
        "hops": coded.iter().map(|coded| coded.lengths.len()).sum::<usize>(),
        "rates": recorded["rates"],
        "machines": machines,
        "skipped": inputs.skipped,
    });
    let next = "see `machines`; compare with `git log` of packed, int8-nn, pipeline, model and the toolchain";
    Report::new("packed", figures, next)
}

/// Folder with the recordings, within the folder that `CORTICODE_DATA` names.
const FOLDER: &str = "eegmmidb_S001";
/// The person in the recordings.
const SUBJECT: &str = "S001";
/// File names of the recordings: 125 s each, mains at 60 Hz, not used in training.
const RECORDINGS: [&str; 2] = ["S001R11.edf", "S001R12.edf"];
const MAINS_HZ: u32 = 60;

/// Measures bits and errors on recordings, for the built-in packed model at its own rate and at
/// every rate, and for windows coded by the network and by PCA. Returns null if `CORTICODE_DATA` is
/// not set.
///
/// # Errors
/// The recordings or the model cannot be used.
fn recorded_errors() -> anyhow::Result<Json> {
    let Some(data) = env::var_os("CORTICODE_DATA").filter(|folder| !folder.is_empty()) else {
        eprintln!(
            "SKIPPED: error of the packed code: CORTICODE_DATA is not set; it names the folder that has {FOLDER}"
        );
        return Ok(Json::Null);
    };
    let files = TestFiles {
        data: Some(PathBuf::from(data).join(FOLDER)),
        test: RECORDINGS.map(str::to_owned).to_vec(),
        mains_hz: Some(MAINS_HZ),
        ..TestFiles::default()
    };
    let comparison = comparison::compare(Path::new(checked_in::ARTIFACT), &files, &mut Silent)?;
    let figures = comparison.packed;
    let codes = comparison.codes.context("the built-in model has no network")?;
    let pca = codes.pca.context("the built-in model has no PCA")?;
    let artifact = checked_in::artifact()?;
    let model = artifact.packed.as_ref();
    let model = model.context("the built-in model has no packed model")?;
    let rate = model.description.rate;
    let own = figures.iter().find(|figures| figures.rate == rate);
    let own = own.context("figures of the model's rate")?;
    let rates = figures.iter().map(|figures| {
        json!({
            "rate": figures.rate,
            "bits_per_hop": figures.bits,
            "longest_bytes": figures.longest,
            "mse": figures.mse,
            "mse_smoothed": figures.mse_smoothed,
        })
    });
    Ok(json!({
        "bits_per_hop": own.bits,
        "mse": own.mse,
        "mse_smoothed": own.mse_smoothed,
        "pca_int8_bits": codes.bits_per_window(),
        "pca_int8_mse": pca.integer.mse,
        "int8_mse_over_float": codes.network.integer.mse / codes.network.float.mse,
        "float_mse_over_pca": codes.network.float.mse / pca.float.mse,
        "prd_change_from_card": change_from_card(&artifact.description, &codes)?,
        "rates": rates.collect::<Vec<_>>(),
    }))
}

/// Returns the largest relative change of the PRDs of network and PCA, with float and integer
/// codes, from those that the model's training card states for [`SUBJECT`].
///
/// # Errors
/// The card does not have the person, or the model has no PCA.
fn change_from_card(description: &Description, codes: &CodeComparison) -> anyhow::Result<f64> {
    let mut tested = description.training.tested.iter();
    let person = tested.find(|person| person.subject == SUBJECT);
    let card =
        person.with_context(|| format!("the model's card does not have {SUBJECT}"))?.prd_percent;
    let pca = codes.pca.context("the built-in model has no PCA")?;
    let changes = [
        (codes.network.float, card.autoencoder_float),
        (codes.network.integer, card.autoencoder_int8),
        (pca.float, card.pca_float),
        (pca.integer, card.pca_int8),
    ];
    let changes = changes.map(|(error, stated)| (error.prd_percent / stated - 1.0).abs());
    Ok(changes.into_iter().fold(0.0, f64::max))
}

/// Observer that drops all messages about progress.
struct Silent;

impl ProgressObserver for Silent {
    fn message(&mut self, _text: &str) {}
}
