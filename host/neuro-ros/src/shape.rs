//! The contract of frames: each block is consistent, and all frames of a session have one shape.

use thiserror::Error;

use crate::rosneuro_msgs::{NeuroDataInfo, NeuroFrame};

/// Why a frame violates the contract that ROS-Neuro's recorder, filters and visualizer rely on.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum ContractError {
    /// A block is not consistent. The fields are its name (`eeg`, `exg` or `tri`) and the rule that
    /// it violates.
    #[error("{0}: {1}")]
    Block(&'static str, BlockError),
    /// `sr` is not a multiple of `nsamples`, so the frame rate is not an integer.
    #[error(
        "sr {sr} is not a multiple of nsamples {nsamples}; consumers compute the frame rate as \
         sr / nsamples in integers"
    )]
    Rate {
        /// Sampling rate of every channel, Hz.
        sr: u16,
        /// Samples per channel in one frame.
        nsamples: u16,
    },
    /// The shape of a frame differs from the announced one.
    #[error(
        "the shape changed from {expected} to {found}; recorders allocate once, so start a new \
         session (restart this node and the recorder)"
    )]
    Changed {
        /// Shape of the announced frame.
        expected: Box<Shape>,
        /// Shape of the refused frame.
        found: Box<Shape>,
    },
}

/// Rule that a block of a frame violates.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum BlockError {
    /// The number of labels differs from `nchannels`. The recorder creates one GDF channel per
    /// label.
    #[error("{labels} labels for {nchannels} channels; give every channel exactly one label")]
    Labels {
        /// Number of labels in the block.
        labels: usize,
        /// Number of channels that the block announces.
        nchannels: u16,
    },
    /// `minmax` has these values, which are not two finite values in ascending order.
    #[error("minmax is {}; it must be the smallest and the largest value", list(.0))]
    MinMax(Vec<f64>),
    /// `stride`, in bytes, is not `nchannels * 4`. Holds `stride` and `nchannels`.
    #[error("stride is {0} for {1} channels; it must be nchannels * 4 bytes")]
    Stride(u16, u16),
    /// The number of values in the block is not `nsamples * nchannels`. The recorder copies the
    /// values without checking their number.
    #[error("{length} values for {nsamples} samples of {nchannels} channels")]
    Length {
        /// Number of values in the block.
        length: usize,
        /// Samples per channel that the block announces.
        nsamples: u16,
        /// Number of channels that the block announces.
        nchannels: u16,
    },
    /// `isint` has this value, which does not match the block's sample type.
    #[error("isint is {0}; it is 1 for tri and 0 for eeg and exg")]
    IsInt(u8),
}

fn list(values: &[f64]) -> String {
    let values: Vec<String> = values.iter().map(f64::to_string).collect();
    format!("({})", values.join(", "))
}

/// The dimensions of a frame, for which consumers allocate their buffers once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Sampling rate of every channel, Hz.
    pub sr: u16,
    /// Samples per channel in one frame, the same in every block.
    pub nsamples: u16,
    /// Numbers of channels of `eeg`, `exg` and `tri`.
    pub nchannels: [u16; 3],
}

impl std::fmt::Display for Shape {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [eeg, exg, tri] = self.nchannels;
        write!(
            formatter,
            "{} samples of {eeg} + {exg} + {tri} channels at {} Hz",
            self.nsamples, self.sr
        )
    }
}

impl Shape {
    /// Returns the shape of a frame that fulfils the contract.
    ///
    /// # Errors
    ///
    /// [`ContractError`]: the first rule that the frame violates.
    pub fn from_frame(frame: &NeuroFrame) -> Result<Shape, ContractError> {
        let nsamples = frame.eeg.info.nsamples;
        for (name, info, length, isint) in [
            ("eeg", &frame.eeg.info, frame.eeg.data.len(), 0),
            ("exg", &frame.exg.info, frame.exg.data.len(), 0),
            ("tri", &frame.tri.info, frame.tri.data.len(), 1),
        ] {
            check_block(info, length, nsamples, isint)
                .map_err(|error| ContractError::Block(name, error))?;
        }
        if nsamples == 0 || frame.sr == 0 || !frame.sr.is_multiple_of(nsamples) {
            return Err(ContractError::Rate { sr: frame.sr, nsamples });
        }
        let nchannels =
            [frame.eeg.info.nchannels, frame.exg.info.nchannels, frame.tri.info.nchannels];
        Ok(Shape { sr: frame.sr, nsamples, nchannels })
    }

    /// Checks that a frame fulfils the contract and has this shape.
    ///
    /// # Errors
    ///
    /// [`ContractError::Changed`] if the shape differs; any other variant if the frame itself
    /// violates the contract.
    pub fn admit(&self, frame: &NeuroFrame) -> Result<(), ContractError> {
        let found = Shape::from_frame(frame)?;
        if found == *self {
            Ok(())
        } else {
            Err(ContractError::Changed { expected: Box::new(*self), found: Box::new(found) })
        }
    }
}

/// Checks a block of `length` values in a frame of `nsamples` samples. `isint` is 1 if its values
/// are integers.
fn check_block(
    info: &NeuroDataInfo,
    length: usize,
    nsamples: u16,
    isint: u8,
) -> Result<(), BlockError> {
    let nchannels = info.nchannels;
    let labels = info.labels.len();
    if labels != usize::from(nchannels) {
        return Err(BlockError::Labels { labels, nchannels });
    }
    match info.minmax.as_slice() {
        [least, greatest] if least <= greatest && least.is_finite() && greatest.is_finite() => {}
        _ => return Err(BlockError::MinMax(info.minmax.clone())),
    }
    if u32::from(info.stride) != u32::from(nchannels) * 4 {
        return Err(BlockError::Stride(info.stride, nchannels));
    }
    if info.isint != isint {
        return Err(BlockError::IsInt(info.isint));
    }
    // A block without channels can announce any number of samples; all other blocks must have the
    // same number of samples per channel as `eeg`.
    let expected = usize::from(nsamples) * usize::from(nchannels);
    if length != expected || (nchannels > 0 && info.nsamples != nsamples) {
        return Err(BlockError::Length { length, nsamples: info.nsamples, nchannels });
    }
    Ok(())
}
