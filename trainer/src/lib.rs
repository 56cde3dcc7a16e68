//! Trains models, evaluates them, imports networks, and shows, compares and checks models.
//!
//! The recordings pass through the signal path of the device: a virtual ADC, the fixed-point
//! filters and the resampler of `pipeline`. So the network is trained on the signals that the
//! encoder on the device receives.
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
//! [`report`] draws the learning curves, the evaluation and the cross-validation. docs/training.md
//! and docs/importing.md show how to use the program.
//!
//! # The network
//! `--montage`, `--mode`, `--numbers`, `--hop`, `--steps` and `--padding` choose its shape; the
//! defaults are the paper's dimensions. Mode `pca` has linear maps only, which need no epochs. The
//! default mode is `shortcut`: the paper's encoder and decoder, plus a linear map from window to
//! code and back. The linear map starts as PCA, and the convolutions contribute exactly 0 at the
//! start. Epoch 0 is a candidate, so on the validation windows the float codes are never worse than
//! PCA's.
//!
//! # Example
//! ```
//! use trainer::schedule::OneCycle;
//!
//! let schedule = OneCycle { peak: 1e-3, updates: 101 };
//! // The rate starts at 1/25 of the peak and reaches it after 15 % of the updates.
//! assert!((schedule.rate(0) - 4e-5).abs() < 1e-12);
//! assert!((schedule.rate(15) - 1e-3).abs() < 1e-12);
//! ```
#![forbid(unsafe_code)]
#![expect(
    clippy::cast_precision_loss,
    reason = "counts of values are far below 2^53, those that become f32 below 2^24"
)]

pub mod adam;
mod band_power;
pub mod calibrate;
pub mod card;
pub mod check;
pub mod checkpoint;
pub mod comparison;
pub mod crossval;
pub mod dataset;
pub mod difference;
pub mod electrode_error;
pub mod error;
pub mod evaluate;
mod front_end;
pub mod golden;
pub mod import;
mod in_parallel;
mod layers;
pub mod learning_curve;
pub mod montage_check;
pub mod network;
mod output;
mod overlap;
pub mod packed;
pub mod parameters;
pub mod pca;
pub mod progress;
pub mod report;
pub mod schedule;
pub mod selection;
pub mod session;
pub mod show;
pub mod track;
pub mod training;
pub mod truncation;

#[cfg(test)]
mod testing;
