use crate::scalp_grid::EMPTY;
use crate::shapes::{COLUMNS, ROWS};
use crate::training_card::TrainingCard;
use serde::{Deserialize, Serialize};

/// The paper's scalp grid (arXiv 2008.13485, figure of the electrode grid), front to back.
const PAPER_GRID: [&str; ROWS] = [
    "_ _ F3 F1 Fz F2 F4 _ _",
    "_ FFC5 FFC3 FFC1 _ FFC2 FFC4 FFC6 _",
    "_ FC5 FC3 FC1 FCz FC2 FC4 FC6 _",
    "FTT7 FCC5 FCC3 FCC1 _ FCC2 FCC4 FCC6 FTT8",
    "_ C5 C3 C1 Cz C2 C4 C6 _",
    "TTP7 CCP5 CCP3 CCP1 _ CCP2 CCP4 CCP6 TTP8",
    "_ CP5 CP3 CP1 CPz CP2 CP4 CP6 _",
    "_ CPP5 CPP3 CPP1 _ CPP2 CPP4 CPP6 _",
    "_ _ P3 P1 Pz P2 P4 _ _",
    "_ _ _ PPO1 _ PPO2 _ _ _",
];

/// What training decided besides the weights: the contents of `model.toml`.
///
/// A field that is missing or misspelt is an error; nothing has a default.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Description {
    /// Version of this format: 1.
    pub format: u32,
    /// Which parts the network has.
    pub mode: Mode,
    /// Steps and rate of the encoder's windows.
    pub window: Window,
    /// Shape of the convolutions; says nothing in mode `pca`, which has none.
    pub network: NetworkShape,
    /// How codes become integers.
    pub code: CodeQuantisation,
    /// Where on the scalp grid each electrode lies.
    pub grid: Grid,
    /// Which ADC channel each electrode is wired to.
    pub montage: Montage,
    /// The converter that the model was trained for.
    pub adc: Adc,
    /// The filters in front of the network.
    pub filters: Filters,
    /// The scale of the network's input.
    pub input: Input,
    /// How and on what the model was trained, and how well it does.
    pub training: TrainingCard,
}

/// Which parts the network has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// The paper's network, unpooled with pool indices: the code alone does not decode.
    Paper,
    /// The paper's network, unpooled by nearest neighbour: decodes from the code alone.
    PaperCodeOnly,
    /// As `PaperCodeOnly`, plus linear maps from window to code and back.
    Shortcut,
    /// The linear maps alone.
    Pca,
}

impl Mode {
    /// Whether the network has convolutions (every mode but `pca`).
    pub fn has_convolutions(self) -> bool {
        self != Self::Pca
    }

    /// Whether the network has the linear maps (`shortcut` and `pca`).
    pub fn has_shortcut(self) -> bool {
        matches!(self, Self::Shortcut | Self::Pca)
    }
}

/// Steps and rate of the encoder's windows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Window {
    /// Time steps of a window: 16.
    pub steps: usize,
    /// Time steps from one window to the next: 8 or 16.
    pub hop: usize,
    /// Rate of the steps, Hz: 128.
    pub rate_hz: u32,
}

/// Shape of the convolutions, where the paper leaves a choice.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NetworkShape {
    /// What both convolutions read beyond their input's edges.
    pub padding: Padding,
    /// Steps, rows and columns of which the max-pool keeps the largest; what does not fill a pool is
    /// dropped.
    pub pool: [usize; 3],
}

/// What both convolutions read beyond their input's edges.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Padding {
    /// Nothing: each of them takes two steps, rows and columns off, as in the paper.
    None,
    /// One row and one column of zeros on each side.
    Space,
    /// The same, and a step of zeros before and behind the window.
    All,
}

impl Padding {
    /// Whether rows and columns are padded.
    pub const fn pads_space(self) -> bool {
        matches!(self, Self::Space | Self::All)
    }

    /// Whether the steps of a window are padded.
    pub const fn pads_time(self) -> bool {
        matches!(self, Self::All)
    }

    /// Steps, rows and columns that are added on each side.
    pub const fn pads(self) -> [usize; 3] {
        let space = self.pads_space() as usize;
        [self.pads_time() as usize, space, space]
    }
}

/// How codes become integers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CodeQuantisation {
    /// Integers of a code.
    pub format: CodeFormat,
}

/// Integers of a code.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CodeFormat {
    /// 128 numbers of 8 bits, each dimension with a scale and a zero point of its own.
    Int8,
    /// 128 numbers of 8 bits and one power of two for all of them, chosen window by window: loud
    /// windows are not clipped, quiet ones are finer. 129 bytes.
    Int8Exponent,
    /// 128 numbers of 16 bits. 256 bytes.
    Int16,
}

/// Where on the scalp grid each electrode lies.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Grid {
    /// Rows, front to back: 10.
    pub rows: usize,
    /// Columns, left to right: 9.
    pub columns: usize,
    /// Rows of cells: an electrode's label, or `_` for a cell that is always 0.
    pub cells: Vec<Vec<String>>,
}

impl Grid {
    /// The paper's grid of 61 electrodes.
    pub fn paper() -> Self {
        let cells = PAPER_GRID
            .map(|row| row.split(' ').map(str::to_owned).collect())
            .to_vec();
        Self {
            rows: ROWS,
            columns: COLUMNS,
            cells,
        }
    }

    /// The labels of the cells that are not empty, row-major.
    pub fn electrodes(&self) -> Vec<String> {
        let cells = self.cells.iter().flatten();
        cells.filter(|label| *label != EMPTY).cloned().collect()
    }
}

/// Which ADC channel each electrode is wired to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Montage {
    /// Labels of the 61 electrodes; the index is the ADC channel.
    pub electrodes: Vec<String>,
}

/// The converter that the model was trained for (ADS1299: datasheet SBAS499, section 9.5.1).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Adc {
    /// Samples per second, Hz.
    pub rate_hz: u32,
    /// Reference, V.
    pub vref_v: f64,
    /// Gain of the programmable amplifier.
    pub gain: u32,
    /// Channels, at least one for each electrode.
    pub channels: usize,
}

impl Adc {
    /// Microvolts per count: 2 * reference / gain / 2^24.
    pub fn lsb_uv(&self) -> f64 {
        2.0 * self.vref_v / f64::from(self.gain) / f64::from(1 << 24) * 1e6
    }
}

/// The filters in front of the network: notch, band-pass, decimation to the window's rate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Filters {
    /// Mains frequencies to choose from at start, Hz.
    pub mains_hz: Vec<u32>,
    /// Quality of the notch at the mains frequency, and of those at its harmonics.
    pub notch_q: f64,
    /// Further notches, at 2, 3, .. times the mains frequency; 0: only the mains frequency itself.
    pub harmonics: u32,
    /// Edges of the Butterworth band-pass, Hz.
    pub band_hz: [f64; 2],
    /// Order of the band-pass, as `scipy.signal.butter` counts it.
    pub order: u32,
    /// How the filtered samples are thinned out.
    pub decimation: Decimation,
}

/// How the filtered samples are thinned out to the window's rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Decimation {
    /// Every n-th sample, as in the paper: what the filters leave above half of the window's rate
    /// folds back. The ADC's rate must be a multiple of the window's.
    Literal,
    /// A low-pass FIR first, from any rate of the ADC.
    Fir,
}

/// The scale of the network's input.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Input {
    /// Standard deviation of the training set behind the filters, uV: the float network's input is
    /// uV divided by this.
    pub sd_uv: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ads1299_at_gain_24_has_22_nanovolt_per_count() {
        let adc = Adc {
            rate_hz: 512,
            vref_v: 4.5,
            gain: 24,
            channels: 64,
        };
        assert!((adc.lsb_uv() - 0.022_351_741_790_771_484).abs() < 1e-18);
    }
}
