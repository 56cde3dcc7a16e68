//! What a self-test has found.

use core::fmt;

use crate::CHANNELS;
use crate::error::Error;
use crate::limits::SelfTestFault;
use crate::ready::RateError;
use crate::register::Register;

/// What a self-test has found, as plain numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct SelfTestReport<const CHIPS: usize> {
    /// Chip by chip; chip 0 is the one at MISO.
    pub chips: [ChipReport; CHIPS],
    /// Channel by channel.
    pub channels: [[ChannelReport; CHANNELS]; CHIPS],
    /// DRDY of chip 0.
    pub ready: ReadyReport,
    /// What ended the test before its end; what comes later in it was not measured.
    pub stopped: Option<Error>,
    /// Why the chain is not again what it was before.
    pub not_restored: Option<Error>,
}

/// The registers and the frames of a chip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChipReport {
    /// The ID that it answers; [`ID`](crate::register::ID) is right.
    pub id: u8,
    /// Registers that did not keep what was written, the most in any of the settings, 0 to 24.
    pub differing: u8,
    /// The ID or the first register that was wrong.
    pub fault: Option<Error>,
    /// Frames whose status was bad or that repeated themselves; they are not judged.
    pub bad_frames: u32,
}

/// A channel, at the input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChannelReport {
    /// Of the chip's square wave: measured amplitude by the set one, less 1; -1 if there is none.
    pub gain_error: f32,
    /// Middle of the square wave, uV.
    pub offset_uv: f32,
    /// Around the levels of the square wave, uV rms.
    pub noise_uv: f32,
    /// With shorted input, uV rms.
    pub shorted_noise_uv: f32,
    /// The first limit that does not hold.
    pub fault: Option<SelfTestFault>,
}

/// The rate of DRDY.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReadyReport {
    /// Set, mHz.
    pub expected: u32,
    /// Measured, mHz; 0 if it was not.
    pub measured: u32,
    /// Edges that came too early.
    pub early: u32,
    /// Edges that are missing.
    pub missed: u32,
    /// Why that is wrong.
    pub fault: Option<RateError>,
}

/// Why a self-test is not passed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Finding {
    /// The chain as a whole: a chip's ID or register, the bus, DRDY.
    Chain(Error),
    /// The rate.
    Rate(RateError),
    /// A chip's frames.
    Frames {
        /// Which chip.
        chip: u8,
        /// Frames that were bad.
        bad: u32,
    },
    /// A channel.
    Channel {
        /// Its chip.
        chip: u8,
        /// Its number on the chip, from 0.
        channel: u8,
        /// What is wrong.
        fault: SelfTestFault,
    },
    /// The chain is not again what it was before.
    NotRestored(Error),
}

impl<const CHIPS: usize> SelfTestReport<CHIPS> {
    /// Before anything was measured.
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

    /// The verdict.
    ///
    /// # Errors
    /// The first finding, with the chip that it begins with: a chip that is broken takes frames and
    /// channels of others with it, so that registers come before the rate, and frames before channels.
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

    /// Whether nothing was found.
    pub fn is_passed(&self) -> bool {
        self.check().is_ok()
    }
}

impl ChipReport {
    /// The first register that did not keep what was written.
    pub const fn first_differing(&self) -> Option<Register> {
        match self.fault {
            Some(Error::NotKept { register, .. }) => Some(register),
            _ => None,
        }
    }
}

impl Finding {
    /// The chip that it begins with; none if it is the bus or a pin of all of them.
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
