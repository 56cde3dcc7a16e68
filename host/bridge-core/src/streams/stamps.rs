//! Time stamps of published frames.

use neuro_ros::Stamp;

use crate::device::Device;
use crate::settings::StampPoint;
use crate::streams::trigger::Trigger;
use crate::time::clock::Clock;
use crate::time::host_time::HostTime;

/// Context for the conversion of a message: the time at which it was read, the fitted clock and the
/// trigger input.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reception<'a> {
    /// Host time at which the message was read.
    pub(crate) read: HostTime,
    pub(crate) clock: &'a Clock,
    pub(crate) trigger: &'a Trigger,
}

/// Steps of a frame, relative to the item of the device that completes it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FrameSteps {
    /// Steps from the frame's first step to the last step of the item.
    pub(crate) lookback: u32,
    /// Number of steps of the frame.
    pub(crate) length: u32,
}

/// Returns the time of a frame for its stamp, nanoseconds since 1970. `device_us` is the time of the last
/// step of the item that completes the frame.
pub(crate) fn frame_time_ns(
    device: &Device,
    point: StampPoint,
    device_us: i128,
    steps: FrameSteps,
    reception: Reception<'_>,
) -> i64 {
    let back_us = match point {
        StampPoint::First => device.steps_us(steps.lookback),
        StampPoint::Last => device.steps_us(steps.lookback + 1 - steps.length),
        StampPoint::Arrival => return reception.clock.wall_of_host_ns(reception.read),
    };
    let on_scalp = device_us - i128::from(back_us) - i128::from(device.group_delay_us);
    let wall_ns = reception.clock.wall_ns(on_scalp);
    wall_ns.unwrap_or(reception.read.wall_ns)
}

/// Generator of increasing stamps. Each stamp is at least 1 us later than the previous stamp,
/// unless the wall clock was set back by more than 30 s.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct MonotoneStamps {
    last_ns: i64,
    moved: u64,
    /// Number of times so far that the wall clock was set back by more than 30 s.
    steps_back: u32,
}

impl MonotoneStamps {
    /// Returns the stamp for the time `nanoseconds` of the wall clock. A stamp that would be less
    /// than 1 us after the previous stamp is moved forwards to 1 us after it.
    ///
    /// `steps_back` is the number of times that the wall clock was set back by more than 30 s
    /// ([`Clock::wall_steps_back`]). When it increases, the stamps go back with the clock.
    pub(crate) fn next(&mut self, nanoseconds: i64, steps_back: u32) -> Stamp {
        if std::mem::replace(&mut self.steps_back, steps_back) != steps_back {
            self.last_ns = 0;
        }
        let least = self.last_ns.saturating_add(1000);
        self.moved += u64::from(nanoseconds < least);
        self.last_ns = nanoseconds.max(least);
        Stamp::from_nanoseconds(self.last_ns)
    }

    /// Number of stamps that were moved forwards.
    pub(crate) fn moved(&self) -> u64 {
        self.moved
    }
}
