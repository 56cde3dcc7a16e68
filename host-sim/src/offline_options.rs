//! Options of the commands that work on files alone.

use std::num::NonZero;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use link::MAX_RATE;
use offline::{CodeKind, SignalFormat};

use crate::mains_hz::MainsHz;
use crate::missing_electrodes::MissingElectrodes;

#[derive(Debug, Args)]
pub(crate) struct EncodeOptions {
    /// EDF, BDF or GDF file, or a folder whose recordings are encoded.
    pub(crate) input: PathBuf,
    /// File of codes to write, or a folder for the recordings of a folder: NAME.edf becomes NAME.edf.codes.
    pub(crate) output: PathBuf,
    /// Mains frequency of the notch, Hz.
    #[arg(long, value_enum, default_value = "50")]
    pub(crate) mains: MainsHz,
    /// Treatment of montage electrodes that a recording lacks.
    #[arg(long, value_enum, default_value = "interpolate")]
    pub(crate) missing: MissingElectrodes,
    /// What to write: codes of the network, or packed blocks, which take a fifth of the bits.
    #[arg(long, value_enum, default_value = CodeStream::DEFAULT)]
    pub(crate) stream: CodeStream,
    /// Rate of the packed blocks, 0 to 15: one more is 3 dB coarser; the model's by default.
    #[arg(long, value_parser = clap::value_parser!(u8).range(0..=i64::from(MAX_RATE)))]
    pub(crate) packed_rate: Option<u8>,
    #[command(flatten)]
    pub(crate) batch: BatchOptions,
}

/// Kind of codes.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum CodeStream {
    /// Codes of the network.
    Codes,
    /// Packed blocks.
    Packed,
}

impl CodeStream {
    /// Name of what is written unless --stream states it: codes, if the built-in model has a network.
    const DEFAULT: &str = if model::HAS_NETWORK {
        "codes"
    } else {
        "packed"
    };
}

impl From<CodeStream> for CodeKind {
    fn from(stream: CodeStream) -> Self {
        match stream {
            CodeStream::Codes => Self::Codes,
            CodeStream::Packed => Self::Packed,
        }
    }
}

#[derive(Debug, Args)]
pub(crate) struct DecodeOptions {
    /// File of codes or of packed blocks, or a folder with files *.codes.
    pub(crate) input: PathBuf,
    /// File to write, or a folder for the codes of a folder; by default NAME.decoded.FORMAT beside
    /// NAME.codes.
    pub(crate) output: Option<PathBuf>,
    /// Format of the decoded signal.
    #[arg(long, value_enum)]
    pub(crate) to: FileFormat,
    /// What to decode of a file that holds codes and packed blocks; by default what comes first.
    #[arg(long, value_enum)]
    pub(crate) stream: Option<CodeStream>,
    /// Folder of the model that decodes; by default the model with which this program was built.
    #[arg(long, value_name = "FOLDER")]
    pub(crate) model: Option<PathBuf>,
    /// Recording of which the codes are, or a folder of recordings for those of a folder: NAME.edf for
    /// NAME.edf.codes. Its events are written to the output, and the decoded signal is compared with its own.
    #[arg(long, value_name = "FILE|FOLDER")]
    pub(crate) original: Option<PathBuf>,
    /// Write a report to this folder: index.html, electrodes.csv and pictures.
    #[arg(long, value_name = "FOLDER")]
    pub(crate) report: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) batch: BatchOptions,
}

#[derive(Debug, Args)]
pub(crate) struct BatchOptions {
    /// Replace outputs that exist; inputs are never replaced.
    #[arg(long)]
    pub(crate) force: bool,
    /// Number of files to process at a time; by default one for each core.
    #[arg(long, short, value_name = "NUMBER")]
    pub(crate) jobs: Option<NonZero<usize>>,
    /// Print no progress bar and no summary; warnings about the input are printed.
    #[arg(long, short)]
    pub(crate) quiet: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum FileFormat {
    /// EDF+: 16 bits, tenths of a microvolt, up to 3276.7 uV.
    Edf,
    /// BDF+: 24 bits over the ADC's full scale.
    Bdf,
    /// GDF 2.20: float32.
    Gdf,
    /// Arrays for numpy.load: float32.
    Npz,
    /// One line per step.
    Csv,
}

impl From<FileFormat> for SignalFormat {
    fn from(format: FileFormat) -> Self {
        match format {
            FileFormat::Edf => Self::Edf,
            FileFormat::Bdf => Self::Bdf,
            FileFormat::Gdf => Self::Gdf,
            FileFormat::Npz => Self::Npz,
            FileFormat::Csv => Self::Csv,
        }
    }
}
