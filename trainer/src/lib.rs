//! Trains models, evaluates them, imports networks, and shows, compares and checks models.
//!
//! The recordings pass through the signal path of the device: a virtual ADC, the fixed-point
//! filters and the resampler of `pipeline`. The network is therefore trained on the signals that
//! the encoder receives on a device.
//!
//! ```text
//! EDF, BDF, GDF --Track: virtual ADC, filters--> Dataset --> PCA --> Parameters --> Training: Adam
//!                                                   |                                  |
//!                                                   v                                  v
//!                              Evaluation <-- calibrated_artifact <------------ best Parameters
//!                                                   |
//!                                                   v
//!                                model.toml, *.safetensors --> show, difference, check
//!                                                   ^
//!                   state_dict, specification --import
//! ```
//!
//! `report` draws the learning curves, the evaluation and the cross-validation. docs/training.md
//! and docs/importing.md show how to use the program.
//!
//! # The network
//! `--montage`, `--mode`, `--numbers`, `--hop`, `--steps` and `--padding` choose its shape; the
//! defaults are the paper's dimensions. Mode `pca` has linear maps only, which need no epochs. The
//! default mode is `shortcut`: the paper's encoder and decoder, plus a linear map from window to
//! code and back. The linear map starts as PCA, and the convolutions contribute exactly 0 at the
//! start. The initial parameters are a candidate for the best parameters, so on the validation
//! windows the float codes are never worse than PCA's.
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr)]
#![expect(
    clippy::cast_precision_loss,
    reason = "counts of values are far below 2^53, those that become f32 below 2^24"
)]

pub mod adam;
mod calibrate;
mod card;
mod check;
mod checkpoint;
mod classify;
pub mod command_line;
pub mod comparison;
mod crossval;
mod dataset;
mod difference;
mod electrode_error;
pub mod error;
mod evaluate;
mod golden;
mod import;
mod layers;
pub mod montage_check;
pub mod network;
mod overlap;
mod packed;
pub mod parameters;
mod pca;
mod people;
mod person_error;
pub mod progress;
mod report;
pub mod selection;
mod session;
mod show;
mod subject;
mod substitution;
mod training;

#[cfg(test)]
mod testing;
