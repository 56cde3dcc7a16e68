//! Driver for a chain of one to eight ADS1299, the EEG analogue front end, with a frame decoder, a
//! self-test, and a simulated chain (feature `simulation`).
//!
//! The chips share the clock, SCLK, MOSI, START and RESET; each chip has its own chip select.
//! [`Wiring`] says how their data outputs reach MISO: as a daisy chain, in which one burst with all
//! chips selected reads a whole sample, or directly, with a burst for each chip. Registers are read
//! chip by chip; in a daisy chain, a resistor from each DOUT except chip 0's to MISO makes this
//! possible (`docs/decisions/0011-daisy-chain-with-read-back.md`).
//!
//! ```text
//! Chain (SPI, pins) ── Sampler::read ──▶ bytes ── Decoder ──▶ [[i32; 8]; CHIPS] counts, and FrameStatus:
//!                                                             which chips are bad
//! Sampler: owns a Chain and a Decoder, keeps the last good counts, counts errors, runs the self-test
//! RetryingSampler: a Sampler that brings the chain up again while no chip delivers samples
//! ```
//!
//! The result of [`Decoder`] depends only on its state and the frame. [`ReadyMeter`] checks the
//! intervals of DRDY; [`SquareWaveTest`] and [`ShortedTest`] test channels with the chips' internal
//! signals. [`ImpedanceMeter`] measures the impedance of electrodes from the samples of a chain
//! with [`Settings::excited`].
//!
//! ```
//! use ads1299::{Decoder, frame_bytes};
//!
//! // Two chips without a don't-care bit between them: status 1100.., then eight counts of 24 bits.
//! let mut frame = [0; frame_bytes(2)];
//! for chip in 0..2 {
//!     frame[27 * chip] = 0xC0;
//!     frame[27 * chip + 3..27 * chip + 6].copy_from_slice(&[0xFF, 0xFF, 0xFE]);
//! }
//! let mut counts = [[0; 8]; 2];
//! let status = Decoder::<2>::new().decode(&frame, &mut counts);
//! assert!(status.is_sound());
//! assert_eq!([counts[0][0], counts[1][0]], [-2, -2]);
//! ```
//!
//! Section, table and figure numbers refer to the data sheet, Texas Instruments SBAS499C.
//! Registers, commands and their times, power-up, bit order and the noise at gains 1 and 2 were
//! compared with copies of pages of its revisions A and C. The section numbers 9.4.x and 9.5.x were
//! not compared, nor were values whose comments say so. **This driver is untried on a real chip; it
//! runs on the simulated chain.**
#![no_std]
#![forbid(unsafe_code)]

#[cfg(any(test, feature = "simulation"))]
extern crate std;

mod bring_up;
mod bus;
mod chain;
mod channel_tests;
mod clock;
mod decoder;
mod error;
#[cfg(any(test, feature = "impedance"))]
mod excitation;
mod image;
mod impedance;
mod limits;
mod reading;
mod ready;
mod register;
mod retrying_sampler;
mod sampler;
mod self_test;
mod self_test_report;
mod settings;
#[cfg(any(test, feature = "simulation"))]
pub mod simulation;
#[cfg(test)]
mod tests;

pub use bus::{Bus, Drdy, DrdyEdge, Speed, TooFast};
pub use chain::Chain;
pub use channel_tests::{ChannelResult, ShortedTest, SquareWaveTest};
pub use clock::Clock;
pub use decoder::{Alignment, CHANNELS, CHIP_BYTES, Decoder, FrameStatus, MAX_CHIPS, frame_bytes};
pub use error::{Error, Pin};
pub use image::{Image, ReadBack};
pub use impedance::ImpedanceMeter;
pub use limits::{SelfTestFault, typical_noise_uv};
pub use reading::{Reading, StatusWord};
pub use ready::{Edge, RateError, ReadyMeter};
pub use register::{ID, Register};
pub use retrying_sampler::RetryingSampler;
pub use sampler::{SILENCE, Sampler, SamplerCounters};
pub use self_test::SelfTest;
pub use self_test_report::{ChannelReport, ChipReport, Finding, ReadyReport, SelfTestReport};
pub use settings::{Control, Gain, Input, Rate, Settings, Wiring};
