//! Result of a self-test, by chip and channel, and its first fault.

use core::fmt;

use crate::decoder::CHANNELS;
use crate::error::Error;
use crate::limits::SelfTestFault;
use crate::ready::RateError;
use crate::register::Register;

/// Result of a self-test: registers, frames, channels and sample rate.
#[derive(Clone, Debug, PartialEq)]
pub struct SelfTestReport<const CHIPS: usize> {
    /// Registers and frames per chip; chip 0 is the one wired to MISO.
    pub chips: [ChipReport; CHIPS],
    /// Gain, offset and noise per chip and channel.
    pub channels: [[ChannelReport; CHANNELS]; CHIPS],
    /// Sample rate, measured at chip 0's DRDY.
    pub ready: ReadyReport,
    /// Error that stopped the test; the stages after it were not run.
    pub stopped: Option<Error>,
    /// Error while restoring the previous settings.
    pub not_restored: Option<Error>,
}

/// Result of the register check of a chip, and its number of bad frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChipReport {
    /// ID that the chip returned; the right one is [`ID`](crate::register::ID).
    pub id: u8,
    /// Number of registers that differ from the values written, 0 to 24; the largest number in any
    /// stage of the test.
    pub differing: u8,
    /// The chip's error: a wrong ID, or else the first register that differs from the value
    /// written.
    pub fault: Option<Error>,
    /// Number of frames in which the chip's data were damaged or repeated; these frames are left
    /// out of the measurements.
    pub bad_frames: u32,
}

/// Measured gain, offset and noise of a channel, referred to its input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChannelReport {
    /// Ratio of the measured to the expected amplitude of the square wave, minus 1; -1 without a
    /// square wave.
    pub gain_error: f32,
    /// Mean of the square wave's two levels, in microvolts.
    pub offset_uv: f32,
    /// Noise around the two levels of the square wave, in microvolts rms.
    pub noise_uv: f32,
    /// Noise with shorted input, in microvolts rms.
    pub shorted_noise_uv: f32,
    /// First limit of the self-test that the channel violates.
    pub fault: Option<SelfTestFault>,
}

/// Sample rate measured from DRDY's edges during the self-test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReadyReport {
    /// Configured rate, in millihertz.
    pub expected: u32,
    /// Measured rate, in millihertz; 0 if it was not measured.
    pub measured: u32,
    /// Number of edges that came too early.
    pub early: u32,
    /// Number of expected edges that did not come.
    pub missed: u32,
    /// Error of the sample rate, if it is not the configured one.
    pub fault: Option<RateError>,
}

/// First reason for a failed self-test.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Finding {
    /// Error of a chip's ID or registers, of the bus, or of DRDY.
    Chain(Error),
    /// The sample rate is not the configured one.
    Rate(RateError),
    /// A chip's data were damaged or repeated in some frames.
    Frames {
        /// Index of the chip; chip 0 is wired to MISO.
        chip: u8,
        /// Number of the chip's damaged or repeated frames.
        bad: u32,
    },
    /// A channel violates a limit of the self-test.
    Channel {
        /// Index of the chip; chip 0 is wired to MISO.
        chip: u8,
        /// Index of the channel on the chip, from 0.
        channel: u8,
        /// Limit that the channel violates, with the measured value.
        fault: SelfTestFault,
    },
    /// The chain could not be restored to its previous settings.
    NotRestored(Error),
}

impl<const CHIPS: usize> SelfTestReport<CHIPS> {
    /// Report of a test that has not run.
    pub const EMPTY: Self = Self {
        chips: [ChipReport { id: 0, differing: 0, fault: None, bad_frames: 0 }; CHIPS],
        channels: [[ChannelReport {
            gain_error: 0.0,
            offset_uv: 0.0,
            noise_uv: 0.0,
            shorted_noise_uv: 0.0,
            fault: None,
        }; CHANNELS]; CHIPS],
        ready: ReadyReport { expected: 0, measured: 0, early: 0, missed: 0, fault: None },
        stopped: None,
        not_restored: None,
    };

    /// Checks that the test was passed.
    ///
    /// # Errors
    /// The first finding in this order: registers, the error that stopped the test, rate, frames,
    /// channels, restored settings. A broken chip also corrupts the frames of other chips, so a
    /// finding late in this order may be its consequence.
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
    /// Returns the chip that the finding concerns; `None` for the bus and for shared pins.
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
            Self::Channel { chip, channel, fault } => {
                write!(formatter, "channel {} of ADS1299 {chip}: {fault}", channel + 1)
            }
            Self::NotRestored(error) => {
                write!(formatter, "after the test the chain was not set up again: {error}")
            }
        }
    }
}

impl core::error::Error for Finding {}
