//! A file of codes: the frames of a device, as `host-sim encode` and `host-sim run` write them.

use std::io::{self, Read};
use std::ops::RangeInclusive;

use artifact::ModelId;
use link::{Capabilities, CodeFormat, Decoder, Flags, FrameError, Substitutes, ToHost};
use thiserror::Error;

use crate::exclusions::Exclusions;

/// First bytes of a recording made by corticode-bridge. Such a recording is not a file of codes: it
/// holds the frames that host and board sent, each with its time.
const BRIDGE_RECORDING: &[u8] = b"CORTIREC";
/// Number of bytes read at a time.
const PIECE: usize = 1 << 16;

/// Why a file of codes cannot be decoded.
#[derive(Debug, Error)]
pub enum CodeFileError {
    /// The operating system cannot read the file.
    #[error("it cannot be read; check the path and the permissions")]
    Io(#[from] io::Error),
    /// The path names a folder, a device or a pipe, which cannot be read twice.
    #[error("it is no file, and a file of codes is read twice; write the codes to a file first")]
    NoFile,
    /// The notch filter removed this mains frequency, Hz, but this program's filters cannot remove
    /// it.
    #[error(
        "its notch filter removed {0} Hz, which this program cannot; decode it without --original"
    )]
    Mains(u8),
    /// The file is a recording of the bridge.
    #[error("it is a recording of corticode-bridge; `corticode-bridge convert` decodes it")]
    BridgeRecording,
    /// The file holds no intact frame.
    #[error(
        "it holds no intact frame; name a file that `host-sim encode` or `host-sim run` has written"
    )]
    NoFrames,
    /// The file contains no code. The field is the number of steps in a window.
    #[error(
        "it holds no code; the shortest recording that yields a code is one window long ({0} steps)"
    )]
    NoCodes(usize),
    /// The file contains only codes of another kind than the wanted one. Holds the wanted kind.
    #[error("it holds no {}, and {} in their place: decode these with --stream {}", .0.names().0, .0.other().names().0, .0.other().names().1)]
    OtherKind(CodeKind),
    /// The first code comes before the `Hello` and `Capabilities` of the device.
    #[error(
        "the device does not introduce itself before the first code; the start of the file is \
         missing, so copy the whole file again"
    )]
    NoIntroduction,
    /// The codes were made with another model than the model that is to decode them.
    #[error(
        "its codes are those of model {file}, and {model} is to decode them; name the folder of model \
         {file} with --model"
    )]
    OtherModel {
        /// Model with which the codes were made.
        file: ModelId,
        /// Model that is to decode the codes.
        model: ModelId,
    },
    /// The number of scales or of zero points differs from the number of values in a code, or a
    /// scale is not a positive finite number.
    #[error(
        "it announces {scales} scales and {zero_points} zero points, and the codes of the model have \
         {numbers} numbers; it was made by a defective device"
    )]
    Scales {
        /// Number of scales that the file announces.
        scales: usize,
        /// Number of zero points that the file announces.
        zero_points: usize,
        /// Number of values in a code of the model.
        numbers: usize,
    },
    /// The format of the codes is newer than this program.
    #[error(
        "its codes have a format that is newer than this program ({0}); decode it with the release that wrote it"
    )]
    Format(CodeFormat),
    /// The file holds packed blocks, and the model has no packed code.
    #[error(
        "it holds packed blocks, and model {0} has no packed code; name the folder of the model that made \
         them with --model, or decode codes of the same file with --stream codes"
    )]
    NotPacked(ModelId),
    /// A window's index is not larger than the previous window's. Holds the previous index.
    #[error(
        "a second run starts after window {0}: a file holds one run, so keep runs in files of their \
         own"
    )]
    SecondRun(u32),
    /// More windows are missing between two codes than an hour contains.
    #[error(
        "{missing} windows are missing before window {before}, more than an hour; the file was joined \
         from several ones, is damaged, or was received from the middle of a run"
    )]
    Gap {
        /// Index of the first window after the gap.
        before: u32,
        /// Number of missing windows in the gap.
        missing: u32,
    },
    /// The frames have another version of the wire format.
    #[error(
        "its frames have wire version {0}, and this program reads {version}; decode it with the \
         release that wrote it",
        version = link::VERSION
    )]
    Version(u8),
}

/// Kind of the codes in a file: codes of the network, or packed blocks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CodeKind {
    /// Codes of the network.
    Codes,
    /// Packed blocks.
    Packed,
}

impl CodeKind {
    /// Returns two names of the kind: its name in messages, and the value of `--stream` that
    /// selects it.
    pub(crate) const fn names(self) -> (&'static str, &'static str) {
        match self {
            Self::Codes => ("codes", "codes"),
            Self::Packed => ("packed blocks", "packed"),
        }
    }

    pub(crate) const fn other(self) -> Self {
        match self {
            Self::Codes => Self::Packed,
            Self::Packed => Self::Codes,
        }
    }
}

/// What the device that made a file announces about its codes.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Announcement {
    pub(crate) scale: Vec<f32>,
    pub(crate) zero_point: Vec<i8>,
    /// Smallest and largest level that the format of the codes can hold.
    pub(crate) levels: RangeInclusive<i32>,
    /// Largest input voltage, microvolts.
    pub(crate) full_scale_uv: f32,
    /// Which electrodes the recording lacks, and whether they are interpolated or 0.
    pub(crate) substitutes: Substitutes,
    /// Group delay of the filters, microseconds.
    pub(crate) group_delay_us: u32,
    /// Mains frequency that the notch filter removed, Hz.
    pub(crate) mains_hz: u8,
}

impl Announcement {
    fn new(capabilities: &Capabilities, substitutes: Substitutes) -> Result<Self, CodeFileError> {
        let format = capabilities.code_format;
        let [least, greatest] = format.range().ok_or(CodeFileError::Format(format))?;
        Ok(Self {
            levels: least..=greatest,
            scale: capabilities.code_scale.to_vec(),
            zero_point: capabilities.code_zero_point.to_vec(),
            // Full scale is 2^23 counts (24 bits with sign); 1000 nV is 1 uV.
            #[expect(
                clippy::cast_possible_truncation,
                reason = "as the bridge computes it: 187500, exact in f32"
            )]
            full_scale_uv: (f64::from(capabilities.lsb_nv) * 8_388_608.0 / 1000.0) as f32,
            substitutes,
            group_delay_us: capabilities.group_delay_us,
            mains_hz: capabilities.mains_hz,
        })
    }

    /// Checks that every value of a code has a scale and a zero point.
    pub(crate) fn check(&self, numbers: usize) -> Result<(), CodeFileError> {
        let lengths = [self.scale.len(), self.zero_point.len()];
        let usable = self.scale.iter().all(|scale| scale.is_finite() && *scale > 0.0);
        if lengths == [numbers; 2] && usable {
            return Ok(());
        }
        Err(CodeFileError::Scales { scales: lengths[0], zero_points: lengths[1], numbers })
    }
}

/// One code of a file: a code of the network or a packed block.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct FileCode {
    /// Index of the window or of the packed block, counted from the `Start` of the streams.
    pub(crate) window: u32,
    pub(crate) flags: Flags,
    pub(crate) content: Content,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Content {
    /// Values of a code of the network, in levels of its format.
    Levels(Vec<i32>),
    /// A packed block; [`FileCode::window`] is its index.
    Block {
        /// The block as the device made it.
        bytes: Vec<u8>,
        /// Rate of the block: index of the quantiser's step size, 0 (finest) to 15 (coarsest).
        rate: u8,
    },
}

impl Content {
    pub(crate) const fn kind(&self) -> CodeKind {
        match self {
            Self::Levels(_) => CodeKind::Codes,
            Self::Block { .. } => CodeKind::Packed,
        }
    }
}

/// Reads the codes of a file one by one.
pub(crate) struct CodeFile<R> {
    source: R,
    model: ModelId,
    buffer: Vec<u8>,
    /// The part of the buffer that is not decoded yet.
    unread: std::ops::Range<usize>,
    decoder: Decoder,
    substitutes: Substitutes,
    exclusions: Exclusions,
    /// Model of the device, from its `Hello`; `None` before the `Hello`.
    device_model: Option<ModelId>,
    announcement: Option<Announcement>,
    /// Kind of the codes that are returned; if `None`, the first code of the file determines it.
    kind: Option<CodeKind>,
    /// Number of codes skipped so far because they are not of the wanted kind.
    left_out: u64,
    at_start: bool,
    last: Option<u32>,
    /// Largest number of windows that may be missing between two codes.
    longest_gap: u32,
}

impl<R: Read> CodeFile<R> {
    /// Creates a reader that returns the codes of `kind`; if `None`, of the kind that comes first.
    /// The reader refuses codes of another model than `model`, and gaps of more than
    /// `windows_per_hour` windows.
    pub(crate) fn new(
        source: R,
        model: ModelId,
        kind: Option<CodeKind>,
        windows_per_hour: u32,
    ) -> Self {
        Self {
            source,
            model,
            buffer: vec![0; PIECE],
            unread: 0..0,
            decoder: Decoder::new(),
            substitutes: Substitutes::NONE,
            exclusions: Exclusions::default(),
            device_model: None,
            announcement: None,
            kind,
            left_out: 0,
            at_start: true,
            last: None,
            longest_gap: windows_per_hour,
        }
    }

    /// Returns what the device has announced about its codes up to the code that was returned last.
    pub(crate) fn announcement(&self) -> Option<&Announcement> {
        self.announcement.as_ref()
    }

    /// Returns the exclusions that the device has reported so far.
    pub(crate) fn exclusions(&self) -> &Exclusions {
        &self.exclusions
    }

    /// Returns the number of damaged frames, whose content is lost.
    pub(crate) fn damaged(&self) -> u32 {
        let counters = self.decoder.counters();
        counters.resyncs.saturating_add(counters.malformed)
    }

    /// Returns the number of codes skipped so far because they are not of the wanted kind.
    pub(crate) fn left_out(&self) -> u64 {
        self.left_out
    }

    /// Returns the wanted kind of codes if all codes so far are of another kind; otherwise `None`.
    pub(crate) fn missing_kind(&self) -> Option<CodeKind> {
        self.kind.filter(|_| self.left_out > 0 && self.last.is_none())
    }

    /// Returns the next code, or `None` at the end of the file.
    ///
    /// # Errors
    /// [`CodeFileError`] if the rest of the file cannot be decoded.
    pub(crate) fn next_code(&mut self) -> Result<Option<FileCode>, CodeFileError> {
        loop {
            if self.unread.is_empty() && !self.refill()? {
                return match self.decoder.counters().frames {
                    0 => Err(CodeFileError::NoFrames),
                    _ => Ok(None),
                };
            }
            let mut bytes = &self.buffer[self.unread.clone()];
            let outcome = self.decoder.next::<ToHost>(&mut bytes);
            self.unread.start = self.unread.end - bytes.len();
            let frame = match outcome {
                Some(Ok(frame)) => frame,
                Some(Err(FrameError::Version(version))) => {
                    return Err(CodeFileError::Version(version));
                }
                // Skip damaged frames, which the decoder counts.
                Some(Err(_)) | None => continue,
            };
            match frame.message {
                // A device that lacks electrodes sends `Substitutes` between `Hello` and
                // `Capabilities`.
                ToHost::Hello(hello) => {
                    self.device_model = Some(ModelId(hello.model_id));
                    self.substitutes = Substitutes::NONE;
                }
                ToHost::Substitutes(substitutes) => self.substitutes = substitutes,
                ToHost::Capabilities(capabilities) => {
                    let announcement = Announcement::new(&capabilities, self.substitutes)?;
                    self.announcement = Some(announcement);
                }
                ToHost::Exclusion(report) => {
                    self.exclusions.add(report.first_step, report.excluded);
                }
                ToHost::Code(code) => {
                    let code_model = ModelId(code.model_id);
                    let code = FileCode {
                        window: code.window,
                        flags: code.flags,
                        content: Content::Levels(code.values.levels().collect()),
                    };
                    if self.is_wanted(&code) {
                        self.check(code_model, &code)?;
                        return Ok(Some(code));
                    }
                }
                ToHost::PackedCode(block) => {
                    let code = FileCode {
                        window: block.block,
                        flags: block.flags,
                        content: Content::Block { bytes: block.bytes.to_vec(), rate: block.rate },
                    };
                    if self.is_wanted(&code) {
                        let model = self.device_model.ok_or(CodeFileError::NoIntroduction)?;
                        self.check(model, &code)?;
                        return Ok(Some(code));
                    }
                }
                _ => {}
            }
        }
    }

    /// Returns whether a code is of the wanted kind; if not, counts it as skipped. The first code
    /// of the file determines the kind if none was chosen.
    fn is_wanted(&mut self, code: &FileCode) -> bool {
        let kind = code.content.kind();
        let is_wanted = *self.kind.get_or_insert(kind) == kind;
        self.left_out += u64::from(!is_wanted);
        is_wanted
    }

    fn check(&mut self, model: ModelId, code: &FileCode) -> Result<(), CodeFileError> {
        if model != self.model {
            return Err(CodeFileError::OtherModel { file: model, model: self.model });
        }
        let Some(announcement) = &self.announcement else {
            return Err(CodeFileError::NoIntroduction);
        };
        if let Content::Levels(levels) = &code.content {
            announcement.check(levels.len())?;
        }
        if let Some(after) = self.last.filter(|after| code.window <= *after) {
            return Err(CodeFileError::SecondRun(after));
        }
        let missing = code.window - self.last.map_or(0, |last| last + 1);
        if missing > self.longest_gap {
            return Err(CodeFileError::Gap { before: code.window, missing });
        }
        self.last = Some(code.window);
        Ok(())
    }

    /// Reads the next bytes. Returns false at the end of the file.
    fn refill(&mut self) -> Result<bool, CodeFileError> {
        let length = loop {
            match self.source.read(&mut self.buffer) {
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                length => break length?,
            }
        };
        self.unread = 0..length;
        if self.at_start && self.buffer[..length].starts_with(BRIDGE_RECORDING) {
            return Err(CodeFileError::BridgeRecording);
        }
        self.at_start = false;
        Ok(length > 0)
    }
}
