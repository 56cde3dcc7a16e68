//! Errors from reading and playing recordings.

use std::{io, path::PathBuf};

use thiserror::Error;

/// Why a recording cannot be read or played.
#[derive(Debug, Error)]
pub enum RecordingError {
    /// The file does not exist or cannot be opened for reading.
    #[error("cannot open {}; check the path and the permissions", path.display())]
    Open {
        /// Path of the file as passed by the caller.
        path: PathBuf,
        /// Error from the operating system.
        source: io::Error,
    },
    /// Reading failed, or the file ended before all requested bytes were read.
    #[error(
        "cannot read {bytes} bytes at byte {at}; the file may have shrunk or its disk may fail"
    )]
    Read {
        /// Byte offset of the read.
        at: u64,
        /// Number of bytes requested.
        bytes: u64,
        /// Error from the operating system.
        source: io::Error,
    },
    /// The path is that of a folder.
    #[error("{} is a folder; name one recording in it", path.display())]
    Folder {
        /// Path as passed by the caller.
        path: PathBuf,
    },
    /// The file has no bytes.
    #[error("the file is empty; copy or download the recording again")]
    Empty,
    /// The file belongs to a recording in another format, which can be exported.
    #[error(
        "this is {what}, which is not supported; export the recording to EDF, BDF or GDF: {how}"
    )]
    OtherFormat {
        /// Name of the format.
        what: &'static str,
        /// Commands that export it.
        how: &'static str,
    },
    /// A transfer in text mode has inserted a carriage return before every line feed of the file.
    #[error(
        "the file was damaged by a transfer in text mode, which inserted a carriage return (0x0D) before \
         every line feed (0x0A); transfer the recording again in binary mode"
    )]
    TextMode,
    /// The first eight bytes match no supported format.
    #[error(
        "not a recording: it starts with \"{found}\"; supported are EDF, EDF+, BDF, BDF+, GDF 1 and GDF 2"
    )]
    UnknownFormat {
        /// The first eight bytes, escaped.
        found: String,
    },
    /// The file ends before the end of its header.
    #[error(
        "the header needs {needed} bytes but the file has only {found}: the file is truncated or its header is wrong"
    )]
    HeaderTruncated {
        /// Length of the header, bytes.
        needed: u64,
        /// Length of the file, bytes.
        found: u64,
    },
    /// A header field does not hold a usable number.
    #[error("header field \"{field}\" of {place} holds \"{found}\", which is not usable: {reason}")]
    HeaderField {
        /// Name of the field in the specification.
        field: &'static str,
        /// Owner of the field: `the file`, or the number and label of a signal.
        place: String,
        /// Content of the field as text.
        found: String,
        /// Requirement that the content violates.
        reason: &'static str,
    },
    /// The digital range of a signal is empty, or its digital or physical range is not finite.
    #[error(
        "signal {label} cannot be scaled: digital {digital_min}..{digital_max}, physical \
         {physical_min}..{physical_max}; repair its header"
    )]
    Range {
        /// Label of the signal as in the file.
        label: String,
        /// Digital minimum according to the header.
        digital_min: f64,
        /// Digital maximum according to the header.
        digital_max: f64,
        /// Physical minimum according to the header, in the unit of the signal.
        physical_min: f64,
        /// Physical maximum according to the header, in the unit of the signal.
        physical_max: f64,
    },
    /// A signal has a GDF sample type that is not supported.
    #[error(
        "signal {label} has GDF sample type {number}, which is not supported; convert it to an integer or float type"
    )]
    SampleType {
        /// Label of the signal as in the file.
        label: String,
        /// Type number as defined by GDF.
        number: u32,
    },
    /// The file does not contain a single whole record.
    #[error(
        "no data: a record takes {record_bytes} bytes and the file holds {data_bytes} after its header"
    )]
    NoData {
        /// Length of one record with all its signals, bytes.
        record_bytes: u64,
        /// Bytes after the header.
        data_bytes: u64,
    },
    /// The rate or the scale of the virtual ADC is out of range.
    #[error(
        "an ADC of {rate_hz} Hz with {lsb_uv} uV per count cannot be simulated; give 1..=100000 Hz and a positive scale"
    )]
    AdcSpec {
        /// Requested rate, Hz.
        rate_hz: u32,
        /// Requested scale, uV per count.
        lsb_uv: f64,
    },
    /// A signal cannot be resampled to the rate of the ADC.
    #[error("signal {label} at {rate} Hz cannot be resampled to {rate_hz} Hz: {reason}")]
    Rate {
        /// Label of the signal as in the file.
        label: String,
        /// Rate of the signal, Hz, as text.
        rate: String,
        /// Rate of the ADC, Hz.
        rate_hz: u32,
        /// Why the pair of rates cannot be converted.
        reason: &'static str,
    },
    /// A signal that an electrode needs has no samples.
    #[error(
        "signal {label} has no samples; remove it from the file or give it another label, so that the \
         electrode counts as missing"
    )]
    NoSamples {
        /// Label of the signal as in the file.
        label: String,
    },
    /// The montage map names a signal that the recording does not have: the map was created for
    /// another recording.
    #[error(
        "the montage map names signal {signal} but the recording has {signals}; make the map from this recording's labels"
    )]
    MapMismatch {
        /// Index of the missing signal, as in the map.
        signal: usize,
        /// Number of signals in the recording.
        signals: usize,
    },
    /// The montage has more electrodes than the ADC has channels.
    #[error(
        "the montage has {electrodes} electrodes but the ADC only {channels} channels; use a smaller montage"
    )]
    TooManyElectrodes {
        /// Number of electrodes in the montage.
        electrodes: usize,
        /// Number of channels of the ADC.
        channels: usize,
    },
    /// The resampler's buffers have inconsistent sizes. This is a defect of this crate, not of the
    /// file.
    #[error("the resampler's buffers do not fit; please report it with the recording's header")]
    ResamplerBuffer,
    /// The resampler refused a block. This is a defect of this crate, not of the file.
    #[error("the resampler failed; please report it with the recording's header")]
    Resampler(#[from] rubato::ResampleError),
    /// The resampler refused the pair of rates. This is a defect of this crate, not of the file.
    #[error("the resampler cannot be built; please report it with the recording's header")]
    ResamplerConstruction(#[from] rubato::ResamplerConstructionError),
}

impl RecordingError {
    /// Returns whether a field of the header is the reason, so that a damaged file is a possible
    /// cause.
    pub(crate) fn is_about_the_header(&self) -> bool {
        matches!(
            self,
            Self::HeaderTruncated { .. }
                | Self::HeaderField { .. }
                | Self::Range { .. }
                | Self::SampleType { .. }
        )
    }
}
