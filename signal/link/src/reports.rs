//! What a device reports every second: counters, signal quality, durations.

use core::fmt;

use heapless::Vec;
use serde::{Deserialize, Serialize};

use crate::commands::{ExclusionPolicy, Streams};

/// Counters of the device since boot; sent every second while streaming, and after `Stop`.
///
/// Every counter wraps; a host computes differences modulo 2^32 (`samples`: 2^64).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stats {
    /// Streams that are running; empty on an idle device.
    pub streams: Streams,
    /// Index of the next window that will yield a code: the number of codes produced since `Start`.
    pub next_window: u32,
    /// Codes produced since boot, including codes that were dropped.
    pub codes_made: u32,
    /// Frames that were numbered and then dropped, because the host did not read them in time.
    pub frames_dropped: u32,
    /// ADC samples that were read.
    pub samples: u64,
    /// ADC samples that were lost: not read in time, or dropped by a full queue.
    pub overruns: u32,
    /// ADC samples with a wrong status word.
    pub adc_status_bad: u32,
    /// Electrode values clipped to int8, each counted once although windows overlap.
    pub clipped: u32,
    /// Values of codes that were clipped to the range of the code's format.
    pub clipped_values: u32,
    /// Commands received intact.
    pub commands: u32,
    /// Frames from the host that were refused, for any [`FrameError`](crate::FrameError).
    pub input_bad: u32,
}

/// Largest number of electrodes in a [`Quality`]; equals the number of bits of
/// [`Code::saturated`](crate::Code::saturated).
pub const MAX_ELECTRODES: usize = 64;

/// Signal quality of each electrode over one second; sent every second while streaming.
///
/// `pipeline::Quality` is the device's own type, with as many electrodes as its model. This type
/// has room for any model, because a host reads devices with any model.
///
/// Seconds are counted from `Start`; a second that `Stop` interrupts is not reported.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Quality {
    /// Index of the second's first ADC sample, counted from `Start`.
    pub first_sample: u64,
    /// True if the filters had not settled: `rms_uv` and `mains_residual_uv` then include the
    /// filters' transient.
    pub settling: bool,
    /// One entry per electrode, in the order of
    /// [`Capabilities::labels`](crate::Capabilities::labels).
    pub electrodes: Vec<ElectrodeQuality, MAX_ELECTRODES>,
}

/// Signal quality of one electrode over one second.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ElectrodeQuality {
    /// RMS of the filtered steps that the encoder reads, microvolt.
    pub rms_uv: f32,
    /// RMS of the mains frequency ([`Capabilities::mains_hz`](crate::Capabilities::mains_hz)) at
    /// the input, before any filter, microvolt.
    pub mains_uv: f32,
    /// RMS of the mains frequency that is left in the filtered steps, microvolt.
    pub mains_residual_uv: f32,
    /// Number of ADC samples at the converter's rail, at most the number of samples in a second.
    pub samples_at_rail: u16,
    /// True if the peak-to-peak range of the ADC samples was less than half the converter's own
    /// noise. A working converter has a larger range, even with its input shorted.
    pub flat: bool,
}

/// Impedance of each electrode; sent about every second while the device streams and measures it
/// (`SetImpedance`), every two seconds at an ADC rate of 250 Hz.
///
/// The header holds the time of the last sample of the measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Impedance<'a> {
    /// Impedance of each electrode, in the order of
    /// [`Capabilities::labels`](crate::Capabilities::labels): ohms, 32 bits each, least significant
    /// byte first, or [`Self::OPEN`]. Serde skips them, because the frame carries them after the
    /// message's fields.
    #[serde(skip)]
    pub ohms: &'a [u8],
}

impl Impedance<'_> {
    /// Reading of an electrode that is disconnected, or whose impedance is above the range.
    pub const OPEN: u32 = u32::MAX;

    /// Returns the impedance of each electrode, in ohms; `None` for [`Self::OPEN`].
    pub fn electrodes(&self) -> impl ExactSizeIterator<Item = Option<u32>> {
        let ohms = self.ohms.as_chunks().0.iter();
        ohms.map(|bytes| Some(u32::from_le_bytes(*bytes)).filter(|ohms| *ohms != Self::OPEN))
    }

    /// Returns whether the bytes are the impedances of 1 to [`MAX_ELECTRODES`] electrodes.
    pub(crate) const fn is_list(bytes: &[u8]) -> bool {
        let (electrodes, rest) = bytes.as_chunks::<4>();
        rest.is_empty() && !electrodes.is_empty() && electrodes.len() <= MAX_ELECTRODES
    }
}

/// Largest number of stages in a [`Timing`].
pub const MAX_STAGES: usize = 8;

/// Durations of the stages of the signal path since boot. A device that measures them sends this
/// message every second while streaming, after `Stats`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Timing {
    /// One entry for each stage that the device measures, in the order of [`Stage`].
    pub stages: Vec<StageTiming, MAX_STAGES>,
    /// Deepest use of the stack since boot, bytes; 0 on a device that does not measure it.
    pub stack_used: u32,
    /// Size of the stack, bytes; 0 on a device that does not measure its use.
    pub stack_size: u32,
}

/// Durations of one stage since boot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StageTiming {
    /// Stage of the signal path that was measured.
    pub stage: Stage,
    /// Longest allowed duration, nanoseconds; anything longer is late.
    pub deadline_ns: u32,
    /// Longest measured duration, nanoseconds; saturates.
    pub worst_ns: u32,
    /// Number of durations by eighths of the deadline. Element k below 8 counts durations above k/8
    /// and up to (k+1)/8 of the deadline; element 8 counts longer ones. Every element wraps.
    pub histogram: [u32; 9],
}

byte_enum! {
    /// Interval between two points of the signal path; one byte on the wire.
    pub enum Stage {
        /// 0: from a sample's DRDY edge until the sample is in the encoder's queue.
        Acquire = 0,
        /// 1: processing of a sample that completes a step: encoder, reports, streams.
        Step = 1,
        /// 2: from the DRDY edge of a window's last sample until its code is in the output queue.
        Code = 2,
        /// 3: from a code's entry into the output queue until its frame is written to the port.
        Send = 3,
        _ => "Any other: a stage newer than this host.",
    }
}

impl fmt::Display for Stage {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Stage::Acquire => formatter.write_str("acquire"),
            Stage::Step => formatter.write_str("step"),
            Stage::Code => formatter.write_str("code"),
            Stage::Send => formatter.write_str("send"),
            Stage::Newer(number) => write!(formatter, "stage {number}"),
        }
    }
}

/// Electrodes that the device excludes from its codes, because they are bad or because the host
/// excludes them; the device fills their values from the others. Sent at each change, before the
/// first code or packed block that contains the change, and every second while streaming.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Exclusion {
    /// Index of the first step in which these electrodes are excluded, counted from `Start`.
    pub first_step: u64,
    /// Excluded electrodes; bit n is electrode n of
    /// [`Capabilities::labels`](crate::Capabilities::labels).
    pub excluded: u64,
    /// The host's policy; [`ExclusionPolicy::AUTOMATIC`] until the host sets another.
    pub policy: ExclusionPolicy,
}
