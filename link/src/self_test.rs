//! What the device found out about its converters.

use heapless::{String, Vec};
use serde::{Deserialize, Serialize};

use crate::{MAX_CHIPS, MAX_ELECTRODES, MAX_TEXT_BYTES};

/// What the device found out about its converters: the result of a `SelfTest`, once, some seconds
/// after its `Ack`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SelfTest {
    /// The first thing that is wrong, in words that name the chip; empty where everything is in
    /// order.
    pub fault: String<MAX_TEXT_BYTES>,
    /// Rate of DRDY's edges, millihertz on the device's clock; 0 where it was not measured.
    pub ready_mhz: u32,
    /// Rate that was set, millihertz.
    pub expected_mhz: u32,
    /// Edges of DRDY that came too early.
    pub ready_early: u32,
    /// Edges of DRDY that are missing.
    pub ready_missed: u32,
    /// The chips, the first being the one at MISO.
    pub chips: Vec<ChipTest, MAX_CHIPS>,
    /// Their channels, in the order of the ADC's; none where it did not come so far.
    pub channels: Vec<ChannelTest, MAX_ELECTRODES>,
}

/// What was found out about one chip.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ChipTest {
    /// What its ID register says.
    pub id: u8,
    /// Registers that did not keep what was written.
    pub registers_wrong: u8,
    /// Address of the first of them; 0 where there is none, which is the ID itself.
    pub first_wrong: u8,
    /// Frames that were not to be trusted.
    pub frames_bad: u32,
}

/// What was found out about one channel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ChannelTest {
    /// Amplitude of the chip's square wave by what was set, less 1.
    pub gain_error: f32,
    /// Middle of the square wave, microvolt at the input.
    pub offset_uv: f32,
    /// Around the square wave's levels, microvolt RMS at the input.
    pub noise_uv: f32,
    /// With the input shorted, microvolt RMS at the input.
    pub shorted_noise_uv: f32,
    /// The first limit that does not hold.
    pub fault: ChannelFault,
}

/// What is wrong with a channel; one byte on the wire.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "u8", into = "u8")]
pub enum ChannelFault {
    /// 0: nothing.
    #[default]
    None,
    /// 1: too few samples to judge by.
    Samples,
    /// 2: the amplitude of the square wave is off.
    Gain,
    /// 3: the middle is not at zero.
    Offset,
    /// 4: too loud.
    Noisy,
    /// 5: too quiet to be alive.
    Silent,
    /// Any other: a fault newer than this host.
    Newer(u8),
}

impl From<u8> for ChannelFault {
    fn from(byte: u8) -> ChannelFault {
        match byte {
            0 => ChannelFault::None,
            1 => ChannelFault::Samples,
            2 => ChannelFault::Gain,
            3 => ChannelFault::Offset,
            4 => ChannelFault::Noisy,
            5 => ChannelFault::Silent,
            newer => ChannelFault::Newer(newer),
        }
    }
}

impl From<ChannelFault> for u8 {
    fn from(fault: ChannelFault) -> u8 {
        match fault {
            ChannelFault::None => 0,
            ChannelFault::Samples => 1,
            ChannelFault::Gain => 2,
            ChannelFault::Offset => 3,
            ChannelFault::Noisy => 4,
            ChannelFault::Silent => 5,
            ChannelFault::Newer(newer) => newer,
        }
    }
}
