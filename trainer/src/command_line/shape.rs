//! What can be chosen of a model.

use artifact::{CodeFormat, Mode, MontageFile, Padding};
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};
use trainer::card::Shape;
use trainer::error::TrainerError;

/// The default montage.
const PAPER: &str = include_str!("../../../files/montages/paper-61.toml");

/// Layers of the network.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum ModeArg {
    /// Linear maps only, fitted without epochs.
    Pca,
    /// The paper's network plus linear maps, which start as PCA.
    Shortcut,
    /// The paper's network with index unpooling: its codes cannot be decoded, so only `crossval` takes it.
    Paper,
    /// The paper's network with nearest-neighbour unpooling.
    PaperCodeOnly,
}

/// Zero padding of both convolutions.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum PaddingArg {
    /// No padding; needs a grid of at least 6 x 8 cells.
    None,
    /// One row and column on each side.
    Space,
    /// One row, column and step on each side.
    All,
}

/// Integer format of the codes.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum FormatArg {
    /// 8 bits for each number.
    Int8,
    /// 8 bits for each number, and a power of two for each window.
    Int8Exponent,
    /// 16 bits for each number.
    Int16,
}

/// Montage, and what can be chosen of a model.
#[derive(Args, Debug)]
pub(crate) struct ShapeArgs {
    /// Montage file: grid, order of the ADC's channels, ADC [default: files/montages/paper-61.toml].
    #[arg(long)]
    montage: Option<PathBuf>,
    /// Sampling rate of the ADC, Hz [default: that of the montage].
    #[arg(long, value_name = "HZ")]
    rate: Option<u32>,
    /// Layers of the network; pca takes no epochs.
    #[arg(long, value_enum, default_value = "shortcut")]
    mode: ModeArg,
    /// Length of a code: 8 to 256, a multiple of 4, at most steps times electrodes.
    #[arg(long, default_value_t = 128)]
    numbers: usize,
    /// Time steps from the start of one window to the next: 4, 8 or 16.
    #[arg(long, default_value_t = 8)]
    hop: usize,
    /// Time steps of a window: 16 or 32.
    #[arg(long, default_value_t = 16)]
    steps: usize,
    /// Zero padding of the convolutions.
    #[arg(long, value_enum, default_value = "none")]
    padding: PaddingArg,
    /// Integer format of the codes.
    #[arg(long, value_enum, default_value = "int8")]
    code_format: FormatArg,
}

impl ShapeArgs {
    /// Reads the montage file, or returns the paper's montage.
    pub(crate) fn montage(&self) -> Result<MontageFile, TrainerError> {
        let mut montage = match &self.montage {
            Some(path) => MontageFile::read(path)?,
            None => MontageFile::parse(Path::new("files/montages/paper-61.toml"), PAPER)?,
        };
        montage.adc.rate_hz = self.rate.unwrap_or(montage.adc.rate_hz);
        Ok(montage)
    }
}

impl From<&ShapeArgs> for Shape {
    fn from(args: &ShapeArgs) -> Self {
        Self {
            mode: match args.mode {
                ModeArg::Pca => Mode::Pca,
                ModeArg::Shortcut => Mode::Shortcut,
                ModeArg::Paper => Mode::Paper,
                ModeArg::PaperCodeOnly => Mode::PaperCodeOnly,
            },
            numbers: args.numbers,
            steps: args.steps,
            hop: args.hop,
            padding: match args.padding {
                PaddingArg::None => Padding::None,
                PaddingArg::Space => Padding::Space,
                PaddingArg::All => Padding::All,
            },
            format: match args.code_format {
                FormatArg::Int8 => CodeFormat::Int8,
                FormatArg::Int8Exponent => CodeFormat::Int8Exponent,
                FormatArg::Int16 => CodeFormat::Int16,
            },
        }
    }
}
