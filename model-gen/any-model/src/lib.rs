//! Random models of every mode, padding, pool, size and montage, calibrated like a trained model,
//! and inputs that are more extreme than any EEG.
//!
//! Tests and benchmarks need models of other shapes than the checked-in one. Random weights
//! suffice: whether the device computes the same codes as the reference, and at what cost, does not
//! depend on training.
//!
//! ```text
//! signal/model/artifact/model.toml ── change ──> Description ──┐
//! montages/*.toml ───────────────────────────^          ├─> Artifact
//! seed ──> dense random weights ──> ranges of the codes ┘
//! ```
//!
//! ```
//! use any_model::{MONTAGES, any_artifact_for};
//! use artifact::{Mode, MontageFile};
//! use std::path::Path;
//!
//! let cyton = MontageFile::read(&Path::new(MONTAGES).join("cyton-8.toml"))?;
//! let model = any_artifact_for(1, &cyton, Mode::Pca, 16)?;
//! assert_eq!(model.description.dimensions().electrodes, 8);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

mod classifier;
mod packed;
mod stress;
mod substitution;

use std::{
    fs,
    path::{Path, PathBuf},
};

use artifact::{
    Artifact, ArtifactError, Decimation, Description, FloatEncoder, Geometry, Grid, Mode,
    MontageFile, MontageFileError, NetworkShape, Padding, ScalpGrid, Tensors, TracedCode,
};
use model_gen::IntegerModel;

pub use classifier::any_classifier;
pub use packed::{any_packed, any_packed_of};
pub use stress::Stress;
use substitution::any_substitution;

/// Folder of the built-in model; the random models start from its description.
const BUILT_IN: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../signal/model/artifact");
/// Folder of the checked-in montage files, which state the electrode of each channel.
pub const MONTAGES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../files/montages");

/// A window on the scalp grid, indexed by step, row and column, in units of the input's standard
/// deviation.
pub type Window = Vec<f32>;

/// Number of random windows over which the value ranges of each network are measured.
const CALIBRATION: usize = 16;

/// Largest input magnitude that a model without a network states for its training data, uV.
const LARGEST_UV: f32 = 500.0;

/// Code length of the network that [`any_packed_alone`] first creates and then removes.
const NUMBERS: usize = 16;

/// Returns every tested combination of mode, padding and pool (steps, rows, columns). Mode `paper`
/// has only one pool, because its encoder equals the encoder of `paper-code-only`.
pub fn every_variant() -> Vec<(Mode, Padding, [usize; 3])> {
    let mut variants = vec![(Mode::Pca, Padding::None, [2, 2, 2])];
    for padding in [Padding::None, Padding::Space, Padding::All] {
        variants.push((Mode::Paper, padding, [2, 2, 2]));
        for pool in [[2, 2, 2], [1, 2, 2], [2, 3, 3], [4, 2, 2], [2, 1, 1], [2, 2, 1]] {
            // With padding in time, pools of four steps are not permitted: overlapping windows
            // would share too few pools.
            if !(padding.pads_time() && pool[0] == 4) {
                variants.push((Mode::PaperCodeOnly, padding, pool));
                variants.push((Mode::Shortcut, padding, pool));
            }
        }
    }
    variants
}

/// Returns a network in which every weight matters: dense random tensors, and batch norms with
/// negative, zero and positive factors and different offsets. The rest of the description is from
/// the built-in model. The value ranges are measured on [`windows`] of another seed, so that most
/// code values of other windows are neither clipped nor zero. With an odd seed the model has a
/// random table of substitutions.
///
/// # Errors
/// When the built-in model cannot be read, or a model cannot have this shape.
pub fn any_artifact(
    seed: u32,
    mode: Mode,
    padding: Padding,
    pool: [usize; 3],
    hop: usize,
) -> Result<Artifact, ArtifactError> {
    any_artifact_with(seed, |description| {
        description.mode = mode;
        description.network = NetworkShape { padding, pool };
        description.window.hop = hop;
    })
}

/// Returns a network as [`any_artifact`] does, for the built-in model's description after `change`.
///
/// # Errors
/// When the built-in model cannot be read, or no model can have the changed description.
pub fn any_artifact_with(
    seed: u32,
    change: impl FnOnce(&mut Description),
) -> Result<Artifact, ArtifactError> {
    let mut artifact = Artifact::read(Path::new(BUILT_IN))?;
    change(&mut artifact.description);
    let mut noise = Noise(seed);
    let geometry = Geometry::new(&artifact.description);
    artifact.weights = dense_weights(&mut noise, artifact.description.mode, &geometry);
    let windows = windows(!seed, &artifact, CALIBRATION);
    let encoder = FloatEncoder::new(&artifact)?;
    let traced: Vec<TracedCode> = windows.iter().map(|w| encoder.encode_traced(w)).collect();
    let calibration = calibration(&artifact, &windows, &traced);
    let artifact = Artifact::new(artifact.description, artifact.weights, calibration)?;
    with_any_substitution(seed, artifact)
}

/// Returns `model` with its network replaced by a random linear code, like a code fitted to a
/// person. Packed model, table of substitutions and input scale stay.
///
/// # Errors
/// When the built-in model cannot be read, or `model` has no network.
pub fn any_linear_for(seed: u32, model: &Artifact) -> Result<Artifact, ArtifactError> {
    let mut linear = any_artifact_with(seed, |description| {
        *description = model.description.clone();
        description.mode = Mode::Pca;
    })?;
    let input = vec![model.largest_input_uv()?];
    linear.calibration.insert("input.max_abs", &[1], input);
    linear.with_packed(model.packed.clone())?.with_substitution(model.substitution.clone())
}

/// Returns the model with a random table of substitutions if the seed is odd.
fn with_any_substitution(seed: u32, artifact: Artifact) -> Result<Artifact, ArtifactError> {
    let table = (seed % 2 == 1).then(|| any_substitution(seed, &artifact.description));
    artifact.with_substitution(table)
}

/// Size of a model: scalp grid, electrodes, window, hop and code.
#[derive(Clone, Copy, Debug)]
pub struct Size {
    /// Numbers of rows and columns of the scalp grid.
    pub grid: [usize; 2],
    /// Number of electrodes, evenly distributed over the cells of the grid.
    pub electrodes: usize,
    /// Number of time steps in a window.
    pub steps: usize,
    /// Number of time steps from the start of one window to the start of the next.
    pub hop: usize,
    /// Number of values in a code.
    pub numbers: usize,
}

impl Size {
    /// Returns the size of the autoencoder in the paper, with the given hop.
    pub const fn paper(hop: usize) -> Self {
        Self { grid: [10, 9], electrodes: 61, steps: 16, hop, numbers: 128 }
    }

    /// Writes this size into a description and names the electrodes E1, E2 and so on.
    pub fn apply(&self, description: &mut Description) {
        let [rows, columns] = self.grid;
        let cells = rows * columns;
        let is_electrode = |cell: usize| {
            // Spread the electrodes evenly: cell k has an electrode if an integer is above
            // `k * electrodes / cells` and not above `(k + 1) * electrodes / cells`.
            (cell + 1) * self.electrodes / cells > cell * self.electrodes / cells
        };
        let label = |cell: usize| {
            if is_electrode(cell) {
                format!("E{}", cell * self.electrodes / cells + 1)
            } else {
                "_".to_owned()
            }
        };
        let row = |row: usize| (0..columns).map(|column| label(row * columns + column)).collect();
        description.grid = Grid::new((0..rows).map(row).collect());
        description.montage.electrodes = description.grid.electrodes();
        (description.window.steps, description.window.hop) = (self.steps, self.hop);
        description.code.numbers = self.numbers;
        description.adc.channels = self.electrodes.next_multiple_of(8);
        let card = &mut description.training;
        (card.real_electrodes, card.interpolated_electrodes) = (self.electrodes, 0);
        card.interpolated.clear();
    }
}

/// Returns the montage files of the folder [`MONTAGES`], sorted by file name.
///
/// # Errors
/// When the folder or a file cannot be read, or a file is not a montage.
pub fn montages() -> Result<Vec<MontageFile>, MontageFileError> {
    let folder = Path::new(MONTAGES);
    let files = fs::read_dir(folder).and_then(|files| {
        let paths = files.map(|file| file.map(|file| file.path()));
        paths.collect::<Result<Vec<PathBuf>, _>>()
    });
    let mut paths =
        files.map_err(|source| MontageFileError::File { path: folder.to_owned(), source })?;
    paths.sort();
    paths.iter().map(|path| MontageFile::read(path)).collect()
}

/// Returns a random network for a montage, with codes of `numbers` values; see [`any_artifact`].
///
/// # Errors
/// When the built-in model cannot be read, or no model of this mode has this montage and code.
pub fn any_artifact_for(
    seed: u32,
    montage: &MontageFile,
    mode: Mode,
    numbers: usize,
) -> Result<Artifact, ArtifactError> {
    any_artifact_with(seed, |description| {
        description.mode = mode;
        description.code.numbers = numbers;
        apply_montage(montage, description);
    })
}

/// Returns a model of mode `packed` for the electrodes of a montage. The packed model is random, as
/// from [`any_packed`].
///
/// # Errors
/// When the built-in model cannot be read, or no model has this montage.
pub fn any_packed_alone(seed: u32, montage: &MontageFile) -> Result<Artifact, ArtifactError> {
    let with_network = any_artifact_for(seed, montage, Mode::Pca, NUMBERS)?;
    let mut description = with_network.description;
    description.mode = Mode::Packed;
    description.code.numbers = 0;
    let packed = any_packed(seed, &description);
    with_any_substitution(seed, Artifact::without_network(description, LARGEST_UV, packed)?)
}

/// Writes the grid, the electrodes and the ADC of a montage into a description, and selects the
/// decimation that `trainer` selects for the ADC's rate.
pub fn apply_montage(montage: &MontageFile, description: &mut Description) {
    description.grid = montage.grid();
    description.montage = montage.montage();
    description.adc = montage.adc();
    let steps_hz = description.window.rate_hz;
    description.filters.decimation = if description.adc.rate_hz.is_multiple_of(steps_hz) {
        Decimation::Literal
    } else {
        Decimation::Fir
    };
    let card = &mut description.training;
    (card.real_electrodes, card.interpolated_electrodes) =
        (description.montage.electrodes.len(), 0);
    card.interpolated.clear();
}

/// Returns `count` random windows, which are smooth over time, for the model `artifact`.
pub fn windows(seed: u32, artifact: &Artifact, count: usize) -> Vec<Window> {
    let grid = ScalpGrid::new(&artifact.description);
    let dimensions = artifact.description.dimensions();
    // Use another seed than for the weights: windows of the same random numbers would match the
    // weights exactly, unlike any real EEG.
    let mut noise = Noise(seed ^ 0x9e37_79b9);
    let mut window = || {
        let mut last = vec![0.0_f32; dimensions.electrodes];
        let mut window = vec![0.0; dimensions.window_electrodes()];
        for step in window.chunks_exact_mut(dimensions.electrodes) {
            for (value, last) in step.iter_mut().zip(&mut last) {
                *last = 0.8 * *last + 0.9 * noise.next();
                *value = *last;
            }
        }
        grid.scatter(&window)
    };
    (0..count).map(|_| window()).collect()
}

/// Returns the window's cells as int8 inputs of the encoder: quantised with the model's input
/// scale, and clamped.
pub fn quantised(artifact: &Artifact, model: &IntegerModel, window: &Window) -> Vec<i8> {
    let sd_uv = artifact.description.input.sd_uv;
    let quantise = |x: &f32| {
        let level = f64::from(*x) * sd_uv / f64::from(model.input_scale_uv);
        #[expect(clippy::cast_possible_truncation, reason = "clamped to 8 bits")]
        let clamped = level.round().clamp(-128.0, 127.0) as i8;
        clamped
    };
    window.iter().map(quantise).collect()
}

fn dense_weights(noise: &mut Noise, mode: Mode, geometry: &Geometry) -> Tensors {
    let mut weights = Tensors::for_weights();
    for (name, shape) in artifact::weight_shapes(mode, geometry) {
        let length = shape.iter().product();
        let inputs: usize = shape[1..].iter().product();
        #[expect(clippy::cast_precision_loss, reason = "layers have a few thousand inputs")]
        let scale = match name {
            _ if name.ends_with("running_var") => 0.4,
            _ if name.contains("norm") => 1.0,
            _ if name.ends_with("bias") => 0.3,
            _ => 1.7 / (inputs as f32).sqrt(),
        };
        let mut values = noise.fill(length, scale);
        if name.ends_with("running_var") {
            for value in &mut values {
                *value += 0.7;
            }
        }
        if name.contains("norm") && name.ends_with(".weight") {
            // Give every norm a negative, a zero and a positive factor, whatever the seed.
            (values[0], values[1], values[2]) = (-0.7, 0.0, 0.7);
        }
        weights.insert(name, &shape, values);
    }
    weights
}

fn calibration(artifact: &Artifact, windows: &[Window], traced: &[TracedCode]) -> Tensors {
    let largest = |values: &mut dyn Iterator<Item = f32>| vec![values.fold(0.0, f32::max)];
    let mut calibration = Tensors::for_calibration();
    #[expect(clippy::cast_possible_truncation, reason = "calibration is f32")]
    let sd_uv = artifact.description.input.sd_uv as f32;
    let inputs = &mut windows.iter().flat_map(|w| w.iter().map(|x| x.abs() * sd_uv));
    calibration.insert("input.max_abs", &[1], largest(inputs));
    if artifact.description.mode.has_convolutions() {
        let first = largest(&mut traced.iter().map(|t| t.activation1_max));
        let second = largest(&mut traced.iter().map(|t| t.activation2_max));
        calibration.insert("activation1.max", &[1], first);
        calibration.insert("activation2.max", &[1], second);
    }
    let numbers = artifact.description.code.numbers;
    // Widen the range of each code dimension by half its width at both ends: the few windows here
    // reach only about half of the range that many windows reach.
    let (low, high): (Vec<f32>, Vec<f32>) = (0..numbers)
        .map(|j| {
            let of =
                |f: fn(f32, f32) -> f32, start| traced.iter().fold(start, |m, t| f(m, t.code[j]));
            let (low, high) = (of(f32::min, f32::INFINITY), of(f32::max, f32::NEG_INFINITY));
            let further = (high - low) / 2.0;
            (low - further, high + further)
        })
        .unzip();
    calibration.insert("code.min", &[numbers], low);
    calibration.insert("code.max", &[numbers], high);
    calibration
}

/// Linear congruential generator of pseudo-random numbers in [-1, 1) (Numerical Recipes).
pub(crate) struct Noise(pub(crate) u32);

impl Noise {
    pub(crate) fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f32::from(i16::try_from(self.0.cast_signed() >> 16).expect("16 bits")) / 32_768.0
    }

    pub(crate) fn fill(&mut self, length: usize, scale: f32) -> Vec<f32> {
        (0..length).map(|_| self.next() * scale).collect()
    }
}
