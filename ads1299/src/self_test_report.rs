//! Report of a self-test.

use core::fmt;

use crate::error::Error;
use crate::frame::CHANNELS;
use crate::limits::SelfTestFault;
use crate::ready::RateError;
use crate::register::Register;

/// Report of a self-test.
#[derive(Clone, Debug, PartialEq)]
pub struct SelfTestReport<const CHIPS: usize> {
    /// Registers and frames per chip; chip 0 is the one at MISO.
    pub chips: [ChipReport; CHIPS],
    /// Measurements per chip and channel.
    pub channels: [[ChannelReport; CHANNELS]; CHIPS],
    /// Rate of chip 0's DRDY.
    pub ready: ReadyReport,
    /// Error that stopped the test; later stages were not measured.
    pub stopped: Option<Error>,
    /// Error while restoring the previous settings.
    pub not_restored: Option<Error>,
}

/// Registers and frames of a chip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChipReport {
    /// ID that was read; expected is [`ID`](crate::register::ID) is right.
    pub id: u8,
    /// Number of registers that differ from the value written: the most of all stages, 0 to 24.
    pub differing: u8,
    /// Wrong ID, or first register that differs.
    pub fault: Option<Error>,
    /// Frames that were damaged or repeated; they are left out of the measurements.
    pub bad_frames: u32,
}

/// Measurements of a channel, referred to its input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChannelReport {
    /// Measured over expected amplitude of the square wave, less 1; -1 without a square wave.
    pub gain_error: f32,
    /// Mean of the square wave's levels, in microvolts.
    pub offset_uv: f32,
    /// Noise around the levels of the square wave, in microvolts rms.
    pub noise_uv: f32,
    /// Noise with shorted input, in microvolts rms.
    pub shorted_noise_uv: f32,
    /// First limit that is exceeded.
    pub fault: Option<SelfTestFault>,
}

/// Rate of DRDY.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReadyReport {
    /// Configured rate, in millihertz.
    pub expected: u32,
    /// Measured rate, in millihertz; 0 if it was not measured.
    pub measured: u32,
    /// Number of early edges.
    pub early: u32,
    /// Number of missing edges.
    pub missed: u32,
    /// Error of the rate.
    pub fault: Option<RateError>,
}

/// First reason for a failed self-test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Finding {
    /// ID or register of a chip, the bus, or DRDY.
    Chain(Error),
    /// Sample rate.
    Rate(RateError),
    /// Frames of a chip.
    Frames {
        /// Index of the chip.
        chip: u8,
        /// Number of damaged or repeated frames.
        bad: u32,
    },
    /// Measurement of a channel.
    Channel {
        /// Index of the chip.
        chip: u8,
        /// Index on the chip, from 0.
        channel: u8,
        /// Limit that is exceeded.
        fault: SelfTestFault,
    },
    /// The chain is not again what it was before.
    NotRestored(Error),
}

impl<const CHIPS: usize> SelfTestReport<CHIPS> {
    /// Report without measurements.
    pub const EMPTY: Self = Self {
        chips: [ChipReport {
            id: 0,
            differing: 0,
            fault: None,
            bad_frames: 0,
        }; CHIPS],
        channels: [[ChannelReport {
            gain_error: 0.0,
            offset_uv: 0.0,
            noise_uv: 0.0,
            shorted_noise_uv: 0.0,
            fault: None,
        }; CHANNELS]; CHIPS],
        ready: ReadyReport {
            expected: 0,
            measured: 0,
            early: 0,
            missed: 0,
            fault: None,
        },
        stopped: None,
        not_restored: None,
    };

    /// Returns whether the test was passed.
    ///
    /// # Errors
    /// The most fundamental finding: registers, then the rate, frames, channels. A broken chip also damages
    /// frames and channels of other chips, so later kinds may be consequences.
    #[expect(clippy::cast_possible_truncation, reason = "at most 8 of each")]
    pub fn check(&self) -> Result<(), Finding> {
        let none = |finding: Option<Finding>| finding.map_or(Ok(()), Err);
        let mut registers = self.chips.iter().filter_map(|chip| chip.fault);
        none(registers.next().map(Finding::Chain))?;
        none(self.stopped.map(Finding::Chain))?;
        none(self.ready.fault.map(Finding::Rate))?;
        for (chip, report) in (0..).zip(&self.chips) {
            let bad = report.bad_frames;
            none((bad > 0).then_some(Finding::Frames { chip, bad }))?;
        }
        let mut channels = self.channels.as_flattened().iter().enumerate();
        let first = channels.find_map(|(place, report)| {
            Some(Finding::Channel {
                chip: (place / CHANNELS) as u8,
                channel: (place % CHANNELS) as u8,
                fault: report.fault?,
            })
        });
        none(first)?;
        none(self.not_restored.map(Finding::NotRestored))
    }

    /// Returns whether [`Self::check`] finds nothing.
    pub fn is_passed(&self) -> bool {
        self.check().is_ok()
    }
}

impl ChipReport {
    /// Returns the first register that differs from the value written.
    pub const fn first_differing(&self) -> Option<Register> {
        match self.fault {
            Some(Error::NotKept { register, .. }) => Some(register),
            _ => None,
        }
    }
}

impl Finding {
    /// Returns the chip concerned; `None` for the bus or a shared pin.
    pub const fn chip(&self) -> Option<u8> {
        match self {
            Self::Chain(error) | Self::NotRestored(error) => error.chip(),
            Self::Rate(error) => Some(error.chip()),
            Self::Frames { chip, .. } | Self::Channel { chip, .. } => Some(*chip),
        }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Chain(error) => error.fmt(formatter),
            Self::Rate(error) => error.fmt(formatter),
            Self::Frames { chip, bad } => write!(
                formatter,
                "{bad} frames of ADS1299 {chip} were damaged or repeated themselves; check its \
                 supplies, CLK, DOUT and DAISY_IN, and try a slower SCLK"
            ),
            Self::Channel {
                chip,
                channel,
                fault,
            } => write!(
                formatter,
                "channel {} of ADS1299 {chip}: {fault}",
                channel + 1
            ),
            Self::NotRestored(error) => {
                write!(
                    formatter,
                    "after the test the chain was not set up again: {error}"
                )
            }
        }
    }
}

impl core::error::Error for Finding {}
