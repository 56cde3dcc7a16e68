//! The description of a model: the contents of its file `model.toml`.

use crate::geometry::Dimensions;
use serde::{Deserialize, Serialize};
use std::fmt::{self, Display, Formatter};

/// Label of a grid cell without an electrode.
pub const EMPTY: &str = "_";

/// Everything that training decided except the weights: the contents of `model.toml`. A missing or
/// misspelt field is an error.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Description {
    /// Version of the file format, always 1.
    pub format: u32,
    /// Layers of the network: convolutions, a linear shortcut, both, or no network.
    pub mode: Mode,
    /// Length, hop and rate of the encoder's windows.
    pub window: Window,
    /// Padding and pool of the convolutions; unused in modes without convolutions.
    pub network: NetworkShape,
    /// Length and integer format of the codes.
    pub code: CodeQuantisation,
    /// Position of each electrode on the scalp grid.
    pub grid: Grid,
    /// ADC channel of each electrode.
    pub montage: Montage,
    /// ADC that the model was trained for.
    pub adc: Adc,
    /// Filters between the ADC and the network.
    pub filters: Filters,
    /// Scale of the network's input values.
    pub input: Input,
    /// Training data, training settings and test errors.
    pub training: TrainingCard,
}

impl Description {
    /// Returns the dimensions of the model.
    pub const fn dimensions(&self) -> Dimensions {
        Dimensions {
            steps: self.window.steps,
            rows: self.grid.rows,
            columns: self.grid.columns,
            electrodes: self.montage.electrodes.len(),
            numbers: self.code.numbers,
        }
    }
}

/// Layers of the network: convolutions, a linear shortcut, both, or no network.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// The network of arXiv 2008.13485 ("the paper"). Its decoder unpools with pool indices, which
    /// the code does not carry, so the code alone cannot be decoded.
    Paper,
    /// The paper's network with nearest-neighbour unpooling, which needs nothing but the code.
    PaperCodeOnly,
    /// [`Self::PaperCodeOnly`] plus linear maps from window to code and back.
    Shortcut,
    /// The linear maps of [`Self::Shortcut`] only, without convolutions.
    Pca,
    /// No network: the device sends the packed code only.
    Packed,
}

impl Display for Mode {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Paper => "paper",
            Self::PaperCodeOnly => "paper-code-only",
            Self::Shortcut => "shortcut",
            Self::Pca => "pca",
            Self::Packed => "packed",
        })
    }
}

impl Mode {
    /// Returns whether the model has a network (every mode except `packed`).
    pub fn has_network(self) -> bool {
        self != Self::Packed
    }

    /// Returns whether the network has convolutions (every mode except `pca` and `packed`).
    pub fn has_convolutions(self) -> bool {
        !matches!(self, Self::Pca | Self::Packed)
    }

    /// Returns whether the network has the linear maps (`shortcut` and `pca`).
    pub fn has_shortcut(self) -> bool {
        matches!(self, Self::Shortcut | Self::Pca)
    }
}

/// Length, hop and rate of the encoder's windows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Window {
    /// Number of time steps in a window, 16 or 32.
    pub steps: usize,
    /// Number of time steps from the start of one window to the start of the next, 4, 8 or 16.
    pub hop: usize,
    /// Rate of the time steps in Hz, always 128.
    pub rate_hz: u32,
}

/// Padding of the convolutions and size of the max-pool.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NetworkShape {
    /// Zero padding of the encoder's two convolutions.
    pub padding: Padding,
    /// Size of a max-pool in steps, rows, columns. Positions that do not fill a pool are dropped.
    pub pool: [usize; 3],
}

/// Axes on which the encoder's two convolutions pad their input with zeros.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Padding {
    /// No padding, as in the paper: each convolution shortens each axis by 2.
    None,
    /// One row and one column of zeros on each side.
    Space,
    /// One row and one column of zeros on each side, and one step of zeros before and after the
    /// window.
    All,
}

impl Display for Padding {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::None => "none",
            Self::Space => "space",
            Self::All => "all",
        })
    }
}

impl Padding {
    /// Returns whether a convolution adds zeros around the rows and columns of its input.
    pub const fn pads_space(self) -> bool {
        matches!(self, Self::Space | Self::All)
    }

    /// Returns whether a convolution adds zeros before the first and after the last step, too.
    pub const fn pads_time(self) -> bool {
        matches!(self, Self::All)
    }

    /// Returns the numbers of steps, rows and columns of zeros at each end, each 0 or 1.
    pub const fn pads(self) -> [usize; 3] {
        let space = self.pads_space() as usize;
        [self.pads_time() as usize, space, space]
    }
}

/// Length and integer format of the codes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CodeQuantisation {
    /// Number of values in a code, 8 to 256; 0 in mode `packed`, whose model has no network.
    pub numbers: usize,
    /// Width of the integers, and whether they share an exponent.
    pub format: CodeFormat,
}

/// Integer format of a code of n numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CodeFormat {
    /// n 8-bit numbers, each with its own scale and zero point. A code takes n bytes.
    Int8,
    /// 8-bit numbers times a common power of two, chosen for each window, so that large signals are
    /// not clipped and small ones have a finer resolution. A code takes 1 + n bytes.
    Int8Exponent,
    /// n 16-bit numbers, each with its own scale; zero points are 0. A code takes 2n bytes.
    Int16,
}

impl CodeFormat {
    /// Returns the size in bits of a code of `numbers` numbers.
    pub fn bits(self, numbers: usize) -> usize {
        8 * match self {
            Self::Int8 => numbers,
            Self::Int8Exponent => numbers + 1,
            Self::Int16 => 2 * numbers,
        }
    }
}

/// Position of each electrode on the scalp grid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Grid {
    /// Number of rows, 1 to 12; the first is at the front of the head.
    pub rows: usize,
    /// Number of columns, 1 to 12; the first is on the left of the head.
    pub columns: usize,
    /// Cells by row: the label of an electrode, or `_` for a cell that is always 0.
    pub cells: Vec<Vec<String>>,
}

impl Grid {
    /// Creates a grid from its rows of cells, which must all have the same length.
    pub fn new(cells: Vec<Vec<String>>) -> Self {
        Self { rows: cells.len(), columns: cells.first().map_or(0, Vec::len), cells }
    }

    /// Returns the labels of all electrodes on the grid, row-major.
    pub fn electrodes(&self) -> Vec<String> {
        let cells = self.cells.iter().flatten();
        cells.filter(|label| *label != EMPTY).cloned().collect()
    }
}

/// ADC channel of each electrode.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Montage {
    /// Labels of the electrodes; the index is the ADC channel.
    pub electrodes: Vec<String>,
}

/// ADC that the model was trained for: a chain of ADS1299 (datasheet SBAS499, section 9.5.1).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Adc {
    /// Sampling rate of each channel, Hz: 250, 256, 500, 512, 1000 or 1024.
    pub rate_hz: u32,
    /// Reference voltage, V; always 4.5, the internal reference of an ADS1299.
    pub vref_v: f64,
    /// Gain of the ADC's input amplifier: 1, 2, 4, 6, 8, 12 or 24.
    pub gain: u32,
    /// Number of channels, 8 for each of 1 to 8 chips; not less than the number of electrodes.
    pub channels: usize,
    /// Connection of the chips' data outputs to the microcontroller.
    #[serde(default, skip_serializing_if = "is_default")]
    pub wiring: AdcWiring,
    /// Source of the chips' clock.
    #[serde(default, skip_serializing_if = "is_default")]
    pub clock: AdcClock,
    /// Means by which the chips are reset, started and stopped.
    #[serde(default, skip_serializing_if = "is_default")]
    pub control: AdcControl,
}

/// Connection of the ADS1299s' data outputs to the microcontroller; docs/hardware.md has drawings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AdcWiring {
    /// A daisy chain, with resistors for read-back.
    #[default]
    Daisy,
    /// All data outputs on one MISO line.
    Cascaded,
}

/// Source of the ADS1299s' clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AdcClock {
    /// An oscillator at pin CLK, at the frequency that the sampling rate needs.
    #[default]
    External,
    /// The oscillator inside a chip, 2.048 MHz +/- 2.5 %.
    Internal,
}

/// How the ADS1299s are reset, started and stopped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AdcControl {
    /// With the pins START and RESET.
    #[default]
    Pins,
    /// With SPI opcodes.
    Commands,
}

/// Returns whether a setting has its default value. Files omit such settings, so that models
/// written before the setting existed keep their id.
fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

impl Adc {
    /// Returns the voltage of one ADC count in microvolts: 2 * reference / gain / 2^24.
    pub fn lsb_uv(&self) -> f64 {
        2.0 * self.vref_v / f64::from(self.gain) / f64::from(1 << 24) * 1e6
    }
}

/// Filters between the ADC and the network: notches, band-pass, decimation to the step rate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Filters {
    /// Mains frequencies among which the device can choose at start, Hz.
    pub mains_hz: Vec<u32>,
    /// Quality factor of every notch: its centre frequency divided by its -3 dB width.
    pub notch_q: f64,
    /// Number of harmonics of the mains frequency that also have a notch: 1 for 2 x, 2 for 2 x and
    /// 3 x the mains frequency, and so on.
    pub harmonics: u32,
    /// Lower and upper -3 dB edge of the Butterworth band-pass, Hz.
    pub band_hz: [f64; 2],
    /// Order of the band-pass as `scipy.signal.butter` counts it: poles per edge.
    pub order: u32,
    /// Rate reduction from the ADC's rate to the rate of the steps.
    pub decimation: Decimation,
}

/// Rate reduction from the ADC's rate to the rate of the steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Decimation {
    /// Keeps every n-th sample, as in the paper, so signals above half of the step rate alias. The
    /// ADC's rate must be a multiple of the step rate.
    Literal,
    /// Applies a low-pass FIR before it drops samples; works with any ADC rate.
    Fir,
}

/// Scale of the network's input values.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Input {
    /// Standard deviation of the filtered training set, uV. The float network computes with
    /// microvolts divided by this value.
    pub sd_uv: f64,
}

/// Training data, training settings and test errors of a model: table `[training]` of `model.toml`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainingCard {
    /// Origin and licence of the training recordings.
    pub dataset: String,
    /// References to cite when the model is used.
    pub citation: String,
    /// Number of electrodes that were actually recorded.
    pub real_electrodes: usize,
    /// Number of electrodes of the montage that were interpolated from recorded ones.
    pub interpolated_electrodes: usize,
    /// Labels of the interpolated electrodes.
    pub interpolated: Vec<String>,
    /// Caveats about the test errors, as text.
    pub note: String,
    /// Names, without folder, of the recordings on which the model was trained.
    pub train_files: Vec<String>,
    /// Names of the recordings that were used for the test alone, not for training or validation.
    pub test_files: Vec<String>,
    /// Which parts of the recordings were not used for training, as text: the parts with which the
    /// best epoch was chosen, and the start of each file, where the filters settle.
    pub validation: String,
    /// Mains frequency of the recordings, Hz.
    pub mains_hz: u32,
    /// Seed of all random numbers in training.
    pub seed: u64,
    /// Number of epochs in the training run.
    pub epochs: u32,
    /// Epoch whose weights were kept; 0 for the weights before training (in mode `shortcut`, the
    /// weights of PCA).
    pub best_epoch: u32,
    /// Number of training windows in an epoch.
    pub windows: u64,
    /// Optimiser, learning-rate schedule and batch size, as text.
    pub optimiser: String,
    /// Mean squared error over all electrodes of the test files, in units of `input.sd_uv` squared;
    /// absent if not measured.
    pub mse: Option<Figures>,
    /// Percent root-mean-square difference on the test files, 100 sqrt(sum of squared errors / sum
    /// of squared signals); absent if not measured.
    pub prd_percent: Option<Figures>,
    /// People whose recordings trained the model, if there are several or one has bad electrodes.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub people: Vec<Person>,
    /// Error on each person's test files, if they are from several people.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub tested: Vec<TestedPerson>,
}

/// A person on whose recordings a model was trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Person {
    /// Name of the person: the text before the run's number in the file names, such as `S001`.
    pub subject: String,
    /// Standard deviation of all electrodes, uV. Training scales each person's recordings to the
    /// standard deviation of the median person.
    pub sd_uv: f64,
    /// Electrodes that are bad in at least one recording, where they are interpolated from
    /// neighbours.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub bad: Vec<String>,
}

/// Error of a model on one person's test files.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TestedPerson {
    /// Name of the person: the text before the run's number in the file names, such as `S001`.
    pub subject: String,
    /// Electrodes that are bad in at least one recording, where they are interpolated before
    /// coding.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub bad: Vec<String>,
    /// Percent root-mean-square difference on this person's files, as in
    /// [`TrainingCard::prd_percent`].
    pub prd_percent: Figures,
}

/// Reconstruction errors of the model and, for comparison, of PCA.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Figures {
    /// Error of the autoencoder with float encoder and float decoder.
    pub autoencoder_float: f64,
    /// Error of the autoencoder with integer encoder and float decoder.
    pub autoencoder_int8: f64,
    /// Error of PCA in float, with one component for each number of a code.
    pub pca_float: f64,
    /// Error of PCA with integer encoder and float decoder.
    pub pca_int8: f64,
}
