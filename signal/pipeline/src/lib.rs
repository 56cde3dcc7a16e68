//! EEG from sample to code: filters, resampler, scalp grid, quantisation, encoder.
//!
//! ```text
//! Sample ---Acquisition---> Step ---Substitution-+-Encoder---------> Code
//! ADC rate  filters,        128 Hz  bad          |  streaming, int8  one per hop
//! counts    resampler,      Q27.5,  electrodes   |                   integers
//!           scalp grid      int8    filled       +-PackedEncoder---> PackedCode
//!                                                |  int8, int16      one per hop, few bytes
//!                                                +-FeatureExtractor> Features
//!                                                   int8, band-pass  one per hop, band powers
//! ```
//!
//! [`Pipeline`] combines [`Acquisition`], [`Substitution`] and [`Encoder`]; firmware runs
//! [`Acquisition`] at a different priority from the other two. [`SignalQuality`] reports the state
//! of each electrode once a second, for human readers; it is not part of the path to the code.
//!
//! The crate is pure and synchronous. The path to the code uses integers only, so the same samples
//! yield the same codes on every machine. It does not allocate, wait or log, and it counts every
//! value that it clips. It does not branch on the signal, with two exceptions. The time of the
//! packed code's range coder depends on the block, within a bound that `docs/figures.md` states. If
//! the model has a table of substitutions, [`Substitution`] replaces bad electrodes before the
//! encoders; it branches when it excludes an electrode and when it judges half a second of signal.
//!
//! ```
//! use pipeline::{Mains, Pipeline, Sample};
//!
//! let mut pipeline = Pipeline::new(Mains::Hz50);
//! let codes = (0..1_024).filter_map(|_| pipeline.encode_sample(&Sample::default())).count();
//! // The first window ends after 16 steps of 4 samples each, every further one 8 steps later.
//! assert_eq!(codes, 1 + (1_024 / 4 - 16) / 8);
//! ```
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

mod acquisition;
mod code;
mod encoder;
mod features;
mod front_end;
mod packed_encoder;
mod quality;
mod quarters;
mod sample;
mod substitution;

pub use acquisition::{Acquisition, Pipeline};
pub use code::{Code, CodeValues};
pub use encoder::{Encoder, EncoderMemory};
pub use features::{FeatureExtractor, FeatureFilters, Features, LARGEST_ROW, MAX_FEATURES};
pub use front_end::{Electrodes, FrontEnd, Mains};
pub use model::{CELLS, CHANNELS, ELECTRODES};
pub use packed::Rate;
pub use packed_encoder::{MAX_PACKED_BYTES, PackedCode, PackedEncoder, PackedMemory};
pub use quality::{ElectrodeQuality, FLAT_BELOW_UV, Quality, SignalQuality};
pub use sample::{Plane, Sample, Step, quantise};
pub use substitution::{ExclusionPolicy, Substitution};
