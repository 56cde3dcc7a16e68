//! Errors from reading and playing recordings.

use std::{io, path::PathBuf};

use thiserror::Error;

use crate::signal::UnusableRange;

/// Why a recording cannot be read or played.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages say what each variant and its fields mean")]
pub enum RecordingError {
    #[error("cannot open {}; check the path and the permissions", path.display())]
    Open { path: PathBuf, source: io::Error },
    /// Reading failed, or the file ended before all requested bytes were read.
    #[error(
        "cannot read {bytes} bytes at byte {at}; the file may have shrunk or its disk may fail"
    )]
    Read { at: u64, bytes: u64, source: io::Error },
    #[error("{} is a folder; name one recording in it", path.display())]
    Folder { path: PathBuf },
    #[error("the file is empty; copy or download the recording again")]
    Empty,
    /// The file has a format that is not supported; `how` names commands that export it.
    #[error(
        "this is {what}, which is not supported; export the recording to EDF, BDF or GDF: {how}"
    )]
    OtherFormat { what: &'static str, how: &'static str },
    #[error(
        "the file was damaged by a transfer in text mode, which inserted a carriage return (0x0D) before \
         every line feed (0x0A); transfer the recording again in binary mode"
    )]
    TextMode,
    /// The first eight bytes match no supported format; `found` holds them with escapes.
    #[error(
        "not a recording: it starts with \"{found}\"; supported are EDF, EDF+, BDF, BDF+, GDF 1 and GDF 2"
    )]
    UnknownFormat { found: String },
    #[error(
        "the header needs {needed} bytes but the file has only {found}: the file is truncated or its header is wrong"
    )]
    HeaderTruncated { needed: u64, found: u64 },
    /// A header field holds no usable number; `place` is the file or the signal that it belongs to.
    #[error("header field \"{field}\" of {place} holds \"{found}\", which is not usable: {reason}")]
    HeaderField { field: &'static str, place: String, found: String, reason: &'static str },
    /// A signal's digital range is empty or not finite, or its physical range is not finite.
    #[error(
        "signal {label} cannot be scaled: {range}; repair its header, or give it another label, so that the \
         electrode counts as missing"
    )]
    Range { label: String, range: UnusableRange },
    #[error(
        "signal {label} has GDF sample type {number}, which is not supported; convert it to an integer or float type"
    )]
    SampleType { label: String, number: u32 },
    /// The file does not contain even one whole record.
    #[error(
        "no data: a record takes {record_bytes} bytes and the file holds {data_bytes} after its header"
    )]
    NoData { record_bytes: u64, data_bytes: u64 },
    #[error(
        "an ADC of {rate_hz} Hz with {lsb_uv} uV per count cannot be simulated; give 1..=100000 Hz and a positive scale"
    )]
    AdcSpec { rate_hz: u32, lsb_uv: f64 },
    #[error(
        "signal {label} at {rate} Hz cannot be resampled to {rate_hz} Hz: the rate is more than 1,000 times as \
         high, or a fraction of too many digits; resample the recording first, such as with \
         raw.resample({rate_hz}) in MNE-Python"
    )]
    Rate { label: String, rate: String, rate_hz: u32 },
    /// A signal that an electrode of the montage needs has no samples.
    #[error(
        "signal {label} has no samples; remove it from the file or give it another label, so that the \
         electrode counts as missing"
    )]
    NoSamples { label: String },
    /// The montage map refers to a signal that the recording does not have, so the map was created
    /// for another recording.
    #[error(
        "the montage map names signal {signal} but the recording has {signals}; make the map from this recording's labels"
    )]
    MapMismatch { signal: usize, signals: usize },
    #[error(
        "the montage has {electrodes} electrodes but the ADC only {channels} channels; use a smaller montage"
    )]
    TooManyElectrodes { electrodes: usize, channels: usize },
}

impl RecordingError {
    /// Returns whether the error is about a field of the header, which may mean that the file is
    /// damaged.
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
