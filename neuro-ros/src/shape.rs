//! What consumers rely on in every frame, and that it never changes.

use thiserror::Error;

use crate::{NeuroDataInfo, NeuroFrame};

/// A frame breaks what the recorder, the filters and the visualizer rely on.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum ContractError {
    /// `labels` and `nchannels` differ: the recorder makes one GDF channel per label.
    #[error(
        "{block}: {labels} labels for {nchannels} channels; give every channel exactly one label"
    )]
    Labels {
        /// `eeg`, `exg` or `tri`.
        block: &'static str,
        /// How many labels.
        labels: usize,
        /// How many channels.
        nchannels: u16,
    },
    /// `minmax` is not two finite values in order.
    #[error("{block}: minmax is {minmax:?}; it must be the smallest and the largest value")]
    MinMax {
        /// `eeg`, `exg` or `tri`.
        block: &'static str,
        /// What was there.
        minmax: Vec<f64>,
    },
    /// `stride` is not `nchannels * 4`.
    #[error("{block}: stride is {stride} for {nchannels} channels; it must be nchannels * 4 bytes")]
    Stride {
        /// `eeg`, `exg` or `tri`.
        block: &'static str,
        /// What was there.
        stride: u16,
        /// How many channels.
        nchannels: u16,
    },
    /// The data do not fill the shape; the recorder copies them unchecked.
    #[error("{block}: {length} values for {nsamples} samples of {nchannels} channels")]
    Length {
        /// `eeg`, `exg` or `tri`.
        block: &'static str,
        /// How many values.
        length: usize,
        /// Announced samples.
        nsamples: u16,
        /// Announced channels.
        nchannels: u16,
    },
    /// `isint` does not say what the block holds.
    #[error("{block}: isint is {isint}; it is 1 for tri and 0 for eeg and exg")]
    IsInt {
        /// `eeg`, `exg` or `tri`.
        block: &'static str,
        /// What was there.
        isint: u8,
    },
    /// `sr` is not a whole number of frames per second.
    #[error(
        "sr {sr} is not a multiple of nsamples {nsamples}; consumers compute the frame rate as \
         sr / nsamples in integers"
    )]
    Rate {
        /// Samples per second.
        sr: u16,
        /// Samples per frame.
        nsamples: u16,
    },
    /// A later frame has another shape than the first.
    #[error(
        "the shape changed from {expected} to {found}; recorders allocate once, so start a new \
         session (restart this node and the recorder)"
    )]
    Changed {
        /// Shape that was announced.
        expected: Box<Shape>,
        /// Shape that came.
        found: Box<Shape>,
    },
}

/// The numbers of a frame that consumers allocate by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Samples per second.
    pub sr: u16,
    /// Samples per frame, the same in every block.
    pub nsamples: u16,
    /// Channels of `eeg`, `exg` and `tri`.
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
    /// The shape of a frame that keeps the contract.
    ///
    /// # Errors
    ///
    /// [`ContractError`] naming the block and the rule that it breaks.
    pub fn of(frame: &NeuroFrame) -> Result<Shape, ContractError> {
        let nsamples = frame.eeg.info.nsamples;
        block("eeg", &frame.eeg.info, frame.eeg.data.len(), nsamples, 0)?;
        block("exg", &frame.exg.info, frame.exg.data.len(), nsamples, 0)?;
        block("tri", &frame.tri.info, frame.tri.data.len(), nsamples, 1)?;
        if nsamples == 0 || frame.sr == 0 || !frame.sr.is_multiple_of(nsamples) {
            return Err(ContractError::Rate {
                sr: frame.sr,
                nsamples,
            });
        }
        let nchannels = [
            frame.eeg.info.nchannels,
            frame.exg.info.nchannels,
            frame.tri.info.nchannels,
        ];
        Ok(Shape {
            sr: frame.sr,
            nsamples,
            nchannels,
        })
    }

    /// Refuse a frame of another shape.
    ///
    /// # Errors
    ///
    /// [`ContractError`] if the frame breaks the contract by itself or differs from this shape.
    pub fn admit(&self, frame: &NeuroFrame) -> Result<(), ContractError> {
        let found = Shape::of(frame)?;
        if found == *self {
            Ok(())
        } else {
            Err(ContractError::Changed {
                expected: Box::new(*self),
                found: Box::new(found),
            })
        }
    }
}

fn block(
    block: &'static str,
    info: &NeuroDataInfo,
    length: usize,
    nsamples: u16,
    isint: u8,
) -> Result<(), ContractError> {
    let nchannels = info.nchannels;
    if info.labels.len() != usize::from(nchannels) {
        return Err(ContractError::Labels {
            block,
            labels: info.labels.len(),
            nchannels,
        });
    }
    match info.minmax.as_slice() {
        [least, greatest] if least <= greatest && least.is_finite() && greatest.is_finite() => {}
        _ => {
            return Err(ContractError::MinMax {
                block,
                minmax: info.minmax.clone(),
            });
        }
    }
    if u32::from(info.stride) != u32::from(nchannels) * 4 {
        return Err(ContractError::Stride {
            block,
            stride: info.stride,
            nchannels,
        });
    }
    if info.isint != isint {
        return Err(ContractError::IsInt {
            block,
            isint: info.isint,
        });
    }
    // A block without channels may say any number of samples; one with channels has the eeg's.
    let expected = usize::from(nsamples) * usize::from(nchannels);
    if length != expected || (nchannels > 0 && info.nsamples != nsamples) {
        let nsamples = info.nsamples;
        return Err(ContractError::Length {
            block,
            length,
            nsamples,
            nchannels,
        });
    }
    Ok(())
}
