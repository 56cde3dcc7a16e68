//! Why a recording cannot be read.

use std::{io, path::PathBuf};

use thiserror::Error;

/// Why a recording cannot be read or played.
#[derive(Debug, Error)]
pub enum RecordingError {
    /// The file cannot be opened.
    #[error("cannot open {}; check the path and the permissions", path.display())]
    Open {
        /// The path as given.
        path: PathBuf,
        /// What the operating system said.
        source: io::Error,
    },
    /// The file cannot be read at some place.
    #[error(
        "cannot read {bytes} bytes at byte {at}; the file may have shrunk or its disk may fail"
    )]
    Read {
        /// Byte offset.
        at: u64,
        /// How many bytes were wanted.
        bytes: u64,
        /// What the operating system said.
        source: io::Error,
    },
    /// The first bytes belong to no known format.
    #[error(
        "not a recording: it begins with \"{found}\"; EDF, EDF+, BDF, BDF+, GDF 1 and GDF 2 are read"
    )]
    UnknownFormat {
        /// The first eight bytes, escaped.
        found: String,
    },
    /// The file ends within its header.
    #[error(
        "the header takes {needed} bytes but the file has only {found}: it is cut off or its header is wrong"
    )]
    HeaderCut {
        /// Bytes that the header takes.
        needed: u64,
        /// Bytes of the file.
        found: u64,
    },
    /// A header field is not the number it should be.
    #[error("header field \"{field}\" of {place} holds \"{found}\", which is not usable: {reason}")]
    HeaderField {
        /// Name of the field.
        field: &'static str,
        /// `the file` or the signal.
        place: String,
        /// What it holds.
        found: String,
        /// What it should hold.
        reason: &'static str,
    },
    /// A signal's digital range is empty or its ranges are not finite.
    #[error(
        "signal {label} cannot be scaled: digital {digital_min}..{digital_max}, physical \
         {physical_min}..{physical_max}; repair its header"
    )]
    Range {
        /// Label of the signal.
        label: String,
        /// Steps.
        digital_min: f64,
        /// Steps.
        digital_max: f64,
        /// The signal's unit.
        physical_min: f64,
        /// The signal's unit.
        physical_max: f64,
    },
    /// A GDF sample type that is not read.
    #[error(
        "signal {label} has GDF sample type {number}, which is not read; convert it to an integer or float type"
    )]
    SampleType {
        /// Label of the signal.
        label: String,
        /// GDF's number of the type.
        number: u32,
    },
    /// There is not one whole record.
    #[error(
        "no data: a record takes {record_bytes} bytes and the file holds {data_bytes} behind its header"
    )]
    NoData {
        /// Bytes of one record.
        record_bytes: u64,
        /// Bytes behind the header.
        data_bytes: u64,
    },
    /// The virtual ADC's own rate or scale is not usable.
    #[error(
        "an ADC of {rate_hz} Hz with {lsb_uv} uV per count cannot be simulated; give 1..=100000 Hz and a positive scale"
    )]
    AdcSpec {
        /// Asked rate, Hz.
        rate_hz: u32,
        /// Asked scale, uV per count.
        lsb_uv: f64,
    },
    /// A signal's rate cannot be turned into the ADC's.
    #[error("signal {label} at {rate} Hz cannot be resampled to {rate_hz} Hz: {reason}")]
    Rate {
        /// Label of the signal.
        label: String,
        /// The signal's rate, Hz; `no` when it has no samples.
        rate: String,
        /// The ADC's rate, Hz.
        rate_hz: u32,
        /// What is wrong with it.
        reason: &'static str,
    },
    /// The montage map was made for another recording.
    #[error(
        "the montage map names signal {signal} but the recording has {signals}; make the map from this recording's labels"
    )]
    ForeignMap {
        /// Index in the map.
        signal: usize,
        /// Signals of the recording.
        signals: usize,
    },
    /// The montage has more electrodes than the ADC has channels.
    #[error(
        "the montage has {electrodes} electrodes but the ADC only {channels} channels; use a smaller montage"
    )]
    TooManyElectrodes {
        /// Electrodes of the montage.
        electrodes: usize,
        /// Channels of the ADC.
        channels: usize,
    },
    /// The resampler's buffers do not fit each other; a defect of this crate, not of the file.
    #[error("the resampler's buffers do not fit; please report it with the recording's header")]
    ResamplerBuffer,
    /// The resampler refused a block; a defect of this crate, not of the file.
    #[error("the resampler failed; please report it with the recording's header")]
    Resampler(#[from] rubato::ResampleError),
    /// The resampler refused the pair of rates; a defect of this crate, not of the file.
    #[error("the resampler cannot be built; please report it with the recording's header")]
    ResamplerConstruction(#[from] rubato::ResamplerConstructionError),
}
