//! Status and self-test of the chain of converters (ADS1299).

use heapless::{String, Vec};
use serde::{Deserialize, Serialize};

use crate::introduction::MAX_TEXT_BYTES;
use crate::reports::MAX_ELECTRODES;

/// Largest number of chips in a chain of converters.
pub const MAX_CHIPS: usize = 8;

/// Status of the chain of converters.
///
/// A device that has a chain sends this message after [`Capabilities`](crate::Capabilities), every
/// second while streaming, and at once when `fault` changes.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Converters {
    /// Text of the fault found when the chain was initialised, naming the chip; empty if none.
    pub fault: String<MAX_TEXT_BYTES>,
    /// Rate of the DRDY edges since the chain was started, millihertz; 0 if it is not known.
    pub drdy_millihertz: u32,
    /// ADC channels with lead-off at the positive input in the newest sample; bit n is channel n.
    pub off_positive: u64,
    /// ADC channels with lead-off at the negative input in the newest sample; bit n is channel n.
    pub off_negative: u64,
    /// Number of readings of the chain in which each chip was bad, since boot; wraps. A reading
    /// with a wrong sample rate counts for chip 0, a reading without a frame for all chips. Element
    /// 0 is the chip whose data output is wired to MISO.
    pub frames_bad: Vec<u32, MAX_CHIPS>,
}

/// Result of the command `SelfTest`: sent once, some seconds after the `Ack` of that command.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SelfTest {
    /// Text of the first fault found, naming the chip; empty if none.
    pub fault: String<MAX_TEXT_BYTES>,
    /// Rate of the DRDY edges, millihertz on the device's clock; 0 if it was not measured.
    pub drdy_millihertz: u32,
    /// Rate that the converters are configured for, millihertz.
    pub expected_millihertz: u32,
    /// Number of DRDY edges that were too early.
    pub drdy_early: u32,
    /// Number of DRDY edges that were missing.
    pub drdy_missed: u32,
    /// One entry per chip; element 0 is the chip whose data output is wired to MISO.
    pub chips: Vec<ChipTest, MAX_CHIPS>,
    /// One entry per ADC channel, in the ADC's order; empty if the test ended before it measured
    /// the channels.
    pub channels: Vec<ChannelTest, MAX_ELECTRODES>,
}

/// Self-test result of one chip of the chain: its registers and its frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ChipTest {
    /// Content of the chip's ID register; an ADS1299 of eight channels has 0x3E.
    pub id: u8,
    /// Number of registers that did not keep the value written.
    pub registers_wrong: u8,
    /// Address of the first wrong register. If `registers_wrong` is 0, this is 0; otherwise 0
    /// means the ID register.
    pub first_wrong: u8,
    /// Number of ADC frames in which the chip's data were damaged or repeated; the test leaves them
    /// out of its measurements.
    pub frames_bad: u32,
}

/// Self-test result of one channel: gain, offset, noise and the first fault.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ChannelTest {
    /// Relative error of the gain: measured amplitude of the chip's test square wave, divided by
    /// the configured amplitude, minus 1.
    pub gain_error: f32,
    /// Mean of the two levels of the square wave, microvolt at the input.
    pub offset_uv: f32,
    /// Noise around the levels of the square wave, microvolt RMS at the input.
    pub noise_uv: f32,
    /// Noise with the input shorted, microvolt RMS at the input.
    pub shorted_noise_uv: f32,
    /// The first limit that the channel violates; `None` if it keeps all limits.
    pub fault: ChannelFault,
}

byte_enum! {
    /// Fault of a channel; one byte on the wire.
    #[derive(Default)]
    pub enum ChannelFault {
        /// 0: the channel meets every limit.
        #[default]
        None = 0,
        /// 1: too few samples for a result.
        Samples = 1,
        /// 2: the amplitude of the square wave is wrong.
        Gain = 2,
        /// 3: the offset is too large.
        Offset = 3,
        /// 4: the noise is too large.
        Noisy = 4,
        /// 5: the noise is smaller than the noise of a working converter.
        Silent = 5,
        _ => "Any other: a fault newer than this host.",
    }
}
