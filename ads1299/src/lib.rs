//! A chain of one to eight ADS1299, the EEG front end: driver, frame decoder, self-test.
//!
//! The chips share clock, SCLK, MOSI, START and RESET; each has a chip select of its own. DOUT of
//! chip k + 1 goes into DAISY_IN of chip k, and DOUT of chip 0 to MISO; so one burst with all chips
//! selected reads a whole sample. Registers are read chip by chip, which needs a way from every
//! DOUT to MISO; `docs/decisions/0011-daisy-chain-with-read-back.md` says which.
//!
//! The way of a sample: [`Chain::power_up`] gives [`Configured`], [`Configured::start`] gives
//! [`Streaming`]; whoever clocks the frame ([`Streaming::read`] or the firmware's own DMA) hands its
//! bytes to [`Decoder`], which is pure. [`Sampler`] does all of this for a device: it owns the chain,
//! keeps the last good counts, counts what was wrong, watches the rate, and runs the whole self-test
//! ([`Sampler::self_test`]). [`RetryingSampler`] brings a chain up again of which no chip delivers. [`ReadyMeter`] judges the times of DRDY's edges, [`SquareWaveTest`] and
//! [`ShortedTest`] judge samples of the chips' own signals.
//!
//! Sections and figures without more are those of the data sheet, Texas Instruments SBAS499C.
//! Registers, commands and their times, power-up, the order of bits and the noise at gains 1 and 2
//! were held against copies of pages of its revisions A and C; what is only remembered says "from
//! memory", and the numbers of sections 9.4 and 9.5 are. **No chip has met this driver: it is
//! simulated.**
#![no_std]
#![forbid(unsafe_code)]

#[cfg(any(test, feature = "simulation"))]
extern crate std;

mod alignment;
mod bring_up;
mod bus;
mod chain;
mod clock;
mod command;
mod configured;
mod decimal;
mod decoder;
mod drdy;
mod error;
mod gain;
mod image;
mod input;
mod lead_off;
mod limits;
mod rate;
mod rate_watch;
mod reading;
mod ready;
mod register;
mod retrying_sampler;
mod sampler;
mod self_test;
mod self_test_report;
mod settings;
mod shorted_test;
#[cfg(any(test, feature = "simulation"))]
pub mod simulation;
mod square_wave_test;
mod statistics;
mod status_word;
mod streaming;
mod test_signal;
#[cfg(test)]
mod tests;

pub use alignment::Alignment;
pub use bus::{Bus, Speed, TooFast};
pub use chain::Chain;
pub use clock::Clock;
pub use configured::Configured;
pub use decoder::{Counters, Decoder, FrameStatus};
pub use drdy::{Drdy, DrdyEdge};
pub use error::{Error, Pin};
pub use gain::Gain;
pub use image::{Image, ReadBack};
pub use input::Input;
pub use lead_off::{LeadOff, LeadOffCurrent, LeadOffFrequency, LeadOffThreshold};
pub use limits::{Limits, SelfTestFault, typical_noise_uv};
pub use rate::Rate;
pub use reading::Reading;
pub use ready::{Edge, RateError, ReadyMeter};
pub use register::{ID, Register};
pub use retrying_sampler::RetryingSampler;
pub use sampler::{SILENCE, Sampler, SamplerCounters};
pub use self_test::SelfTest;
pub use self_test_report::{ChannelReport, ChipReport, Finding, ReadyReport, SelfTestReport};
pub use settings::{Bias, Channel, ChipSettings, Settings};
pub use shorted_test::{ShortedResult, ShortedTest};
pub use square_wave_test::{SquareWaveResult, SquareWaveTest};
pub use status_word::{ChipFault, StatusWord};
pub use streaming::Streaming;
pub use test_signal::{TestAmplitude, TestFrequency, TestSignal};

/// Channels of a chip.
pub const CHANNELS: usize = 8;

/// Bytes of a chip in a frame: 24 status bits and eight counts of 24 bits (9.4.4).
pub const CHIP_BYTES: usize = 3 + 3 * CHANNELS;

/// Chips that a chain may have. The eighth's don't-care bits fill the frame's spare byte.
pub const MAX_CHIPS: usize = 8;

/// Bytes to clock for a frame of so many chips: 27 each, and one for the don't-care bits that the
/// chain may put between chips; 217 for eight.
pub const fn frame_bytes(chips: usize) -> usize {
    CHIP_BYTES * chips + 1
}
