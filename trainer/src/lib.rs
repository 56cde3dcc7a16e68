//! Trains the convolutional autoencoder and writes the artifact.
//!
//! The recordings pass the device's own path: a virtual ADC, the fixed-point filters and the
//! decimation of `pipeline`; so the network learns from what the device will show it.
//!
//! # Training on your own recordings
//! 1. Put EDF, BDF or GDF files of one subject and one cap into a folder. Keep some whole runs for
//!    testing: overlapping windows of one run on both sides would flatter every figure.
//! 2. `cargo run --release --package trainer -- train --data FOLDER --train R03..R10
//!    --test R11,R12 --mains 50 --dataset "..." --citation "..." --out model/artifact`.
//!    A name picks the files whose stem ends with it; `R03..R10` means R03, R04, ... R10. Electrodes
//!    that the cap lacks are interpolated, and the training card lists them.
//! 3. The table at the end shows the network beside PCA with as many components, both in float and
//!    with int8 codes. `cargo run --release --package trainer -- evaluate --artifact model/artifact
//!    --data FOLDER` prints it again.
//! 4. Build: `model/build.rs` turns the new artifact into integers and refuses one that it cannot
//!    prove; `UPDATE_MANIFEST=1 cargo test --package model` writes the new `manifest.txt`.
//!
//! An interrupted training goes on with `--resume`. The same seed, files and machine give the same
//! bytes.
//!
//! # The network
//! Mode `shortcut`: the paper's encoder and decoder beside a linear map from window to code and
//! back. The linear map starts as PCA, the convolutions contribute exactly nothing at first, and
//! epoch 0 is a candidate: on the validation blocks the float codes are never worse than PCA's.
#![forbid(unsafe_code)]

pub mod adam;
pub mod calibrate;
pub mod card;
pub mod checkpoint;
pub mod dataset;
pub mod error;
pub mod evaluate;
pub mod golden;
mod in_parallel;
pub mod network;
pub mod parameters;
pub mod pca;
mod pool;
mod resampler;
pub mod schedule;
pub mod selection;
pub mod session;
pub mod track;
pub mod training;

#[cfg(test)]
mod testing;
