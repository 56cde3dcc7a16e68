//! EEG from sample to code: filters, resampler, scalp grid, quantisation, encoder.
//!
//! ```text
//! Sample ---Acquisition---> Step ---Encoder---> Code
//! 512 Hz    filters,        128 Hz  streaming   16 Hz
//! counts    resampler,      Q27.5,  int8        128 numbers
//!           scalp grid      int8
//! ```
//!
//! [`Pipeline`] is both halves in one; firmware runs them at different priorities. [`SignalQuality`]
//! looks on from beside the path and tells a person, once a second, which electrodes to look after.
//!
//! Pure and synchronous; the path has integers only: the same samples give the same codes on every
//! machine. It does not allocate, wait, log or branch on the signal; what it clips, it counts.
//!
//! ```
//! use pipeline::{Mains, Pipeline, Sample};
//!
//! let mut pipeline = Pipeline::new(Mains::Hz50);
//! let codes = (0..1_024).filter_map(|_| pipeline.push(&Sample::default())).count();
//! // The first window takes 16 steps of 4 samples, every further one 8 steps.
//! assert_eq!(codes, 1 + (1_024 / 4 - 16) / 8);
//! ```
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

mod acquisition;
mod code;
mod code_values;
mod encoder;
mod front_end;
mod mains;
mod plane;
mod quality;
mod sample;
mod step;
mod stream;
mod window;

pub use acquisition::Acquisition;
pub use code::Code;
pub use code_values::CodeValues;
pub use encoder::{Encoder, EncoderMemory};
pub use front_end::{Electrodes, FrontEnd};
pub use mains::Mains;
pub use model::{CELLS, CHANNELS, ELECTRODES};
pub use plane::{Plane, quantise};
pub use quality::{ElectrodeQuality, FLAT_BELOW_UV, Quality, SignalQuality};
pub use sample::Sample;
pub use step::Step;
pub use stream::Pipeline;
