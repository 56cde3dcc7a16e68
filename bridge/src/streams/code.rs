//! From codes to frames of `/encoded`, losses filled.

use std::sync::Arc;

use link::{CODE_LEN, Code, Flags};
use neuro_ros::NeuroFrame;

use crate::decoder::reconstruction::{Reconstruction, TimedCode};
use crate::device::Device;
use crate::effects::Effects;
use crate::settings::{FillerPolicy, Settings, StampPoint};
use crate::streams::ledger::{Arrival, Ledger};
use crate::streams::stamps::{MonotoneStamps, Reception};
use crate::streams::tri::TriWords;

/// Most fillers for one gap: 68 min at 16 Hz. A longer outage is a new recording.
const MAX_FILLERS: u32 = 65_536;

/// From codes to frames of `/encoded`, losses filled; shape and numbering of one session.
#[derive(Debug)]
pub(crate) struct CodeStream {
    settings: Settings,
    device: Arc<Device>,
    decodable: bool,
    frame: NeuroFrame,
    z: [f32; CODE_LEN],
    /// Whether `z` holds a code of this stream.
    has_last: bool,
    /// The device streams since the last begin: a code, a report or an acknowledgement said so.
    running: bool,
    /// Device time of the newest code of this stream, received or filled.
    last_device_us: Option<u64>,
    counts: CodeCounts,
    encoded_stamps: MonotoneStamps,
    window_stamps: MonotoneStamps,
}

/// What happened to codes.
#[derive(Clone, Debug, Default)]
pub(crate) struct CodeCounts {
    pub(crate) ledger: Ledger,
    pub(crate) fillers: u64,
    /// Lost codes beyond [`MAX_FILLERS`] of one gap.
    pub(crate) unfilled: u64,
    /// Codes of another model or format than the device said it has.
    pub(crate) foreign: u64,
    /// Values that the device clipped on their way into int8, once for each window.
    pub(crate) clipped: u64,
    /// Values of codes that the device clipped.
    pub(crate) clipped_values: u64,
}

/// Where and when a code belongs.
#[derive(Clone, Copy, Debug)]
struct CodePosition {
    window: u32,
    device_us: u64,
    flags: Flags,
    lost: u64,
}

impl CodeStream {
    pub(crate) fn new(device: Arc<Device>, decodable: bool, settings: Settings) -> CodeStream {
        CodeStream {
            settings,
            decodable,
            frame: device.encoded_frame(),
            device,
            z: [0.0; CODE_LEN],
            has_last: false,
            running: false,
            last_device_us: None,
            counts: CodeCounts::default(),
            encoded_stamps: MonotoneStamps::default(),
            window_stamps: MonotoneStamps::default(),
        }
    }

    /// Another device of the same shape, or the same one with other mains: numbers, counts and
    /// stamps go on.
    pub(crate) fn replace_device(&mut self, device: Arc<Device>, decodable: bool) {
        let numbers = (self.frame.header.seq, self.frame.neuroheader.seq);
        self.frame = device.encoded_frame();
        (self.frame.header.seq, self.frame.neuroheader.seq) = numbers;
        self.device = device;
        self.decodable = decodable;
    }

    /// The device begins its stream anew: windows count from 0.
    pub(crate) fn restart(&mut self) {
        self.counts.ledger.expect_next(0);
        self.has_last = false;
        self.running = false;
        self.last_device_us = None;
        self.z = [0.0; CODE_LEN];
    }

    /// The device streams: from here on its reports count this stream's codes.
    pub(crate) fn mark_running(&mut self) {
        self.running = true;
    }

    /// Whether the device streams since the last begin. Until then a report without streams is
    /// the late answer to a stop, and counts the codes of the stream before.
    pub(crate) fn is_running(&self) -> bool {
        self.running
    }

    pub(crate) fn device(&self) -> &Arc<Device> {
        &self.device
    }

    pub(crate) fn counts(&self) -> &CodeCounts {
        &self.counts
    }

    /// Stamps that had to be moved forwards.
    pub(crate) fn moved_stamps(&self) -> u64 {
        self.encoded_stamps.moved() + self.window_stamps.moved()
    }

    /// Whether the device has begun its stream anew with this code, though nobody told it to: its frame
    /// is new, its index is not.
    pub(crate) fn is_restart(&self, code: &Code) -> bool {
        self.counts.ledger.is_old(code.window)
    }

    /// A code came, made at `device_us`. A time that the clock did not take for one is replaced by
    /// that of the code's position in the stream.
    pub(crate) fn receive(
        &mut self,
        code: &Code,
        device_us: Option<u64>,
        reception: Reception<'_>,
        effects: &mut dyn Effects,
    ) {
        let format = code.values.format();
        if (code.model_id, format) != (self.device.model_id, self.device.code_format) {
            self.counts.foreign += 1;
            return;
        }
        let mut arrival = self.counts.ledger.record(code.window);
        if arrival == Arrival::Old {
            tracing::warn!(window = code.window, "the device began its stream anew");
            self.restart();
            arrival = self.counts.ledger.record(code.window);
        }
        let Arrival::New { lost } = arrival else {
            return;
        };
        let device_us = device_us.unwrap_or_else(|| self.time_of_next(lost, 0));
        self.fill(code.window, lost, device_us, reception, effects);
        let device = Arc::clone(&self.device);
        device.dequantise(&code.values, &mut self.z);
        self.has_last = true;
        self.running = true;
        self.last_device_us = Some(device_us);
        self.counts.clipped += u64::from(code.clipped);
        self.counts.clipped_values += u64::from(code.clipped_values);
        let (flags, lost) = (code.flags, self.counts.ledger.lost());
        let position = CodePosition {
            window: code.window,
            device_us,
            flags,
            lost,
        };
        self.publish(position, true, reception, effects);
    }

    /// The device says at `device_us` that its next code will be `next`: what has not come until
    /// here is lost.
    pub(crate) fn fill_before(
        &mut self,
        next: u32,
        device_us: u64,
        reception: Reception<'_>,
        effects: &mut dyn Effects,
    ) {
        let lost = self.counts.ledger.count_lost_before(next);
        // Before the first code of a stream the report's own time is the best there is: the last
        // code was made within a hop before it.
        let next_us = self.time_of_next(lost, device_us);
        self.fill(next, lost, next_us, reception, effects);
        if lost > 0 {
            self.last_device_us = Some(next_us.saturating_add_signed(-self.hop_us()));
        }
    }

    /// Device time of the code that follows `lost` lost ones; if no code's time is known, one hop
    /// after `fallback_us`.
    fn time_of_next(&self, lost: u32, fallback_us: u64) -> u64 {
        let (known_us, hops) = match self.last_device_us {
            Some(last_us) => (last_us, i64::from(lost) + 1),
            None => (fallback_us, 1),
        };
        known_us.saturating_add_signed(hops * self.hop_us())
    }

    fn hop_us(&self) -> i64 {
        self.device.steps_us(u32::from(self.device.hop_steps))
    }

    /// Publish fillers for the `lost` codes right before `window`, which was made at `device_us`.
    fn fill(
        &mut self,
        window: u32,
        lost: u32,
        device_us: u64,
        reception: Reception<'_>,
        effects: &mut dyn Effects,
    ) {
        if lost == 0 {
            return;
        }
        tracing::warn!(lost, before = window, "codes lost");
        let filled = lost.min(MAX_FILLERS);
        if filled < lost {
            self.counts.unfilled += u64::from(lost - filled);
            tracing::error!(
                unfilled = lost - filled,
                "the outage was too long to fill; start a new recording"
            );
        }
        let hop_us = self.hop_us();
        if self.settings.filler == FillerPolicy::Zeros || !self.has_last {
            self.z = [0.0; CODE_LEN];
        }
        for back in (1..=filled).rev() {
            let position = CodePosition {
                window: window.wrapping_sub(back),
                device_us: device_us.saturating_add_signed(-hop_us * i64::from(back)),
                flags: Flags::FILLER,
                lost: self.counts.ledger.lost() - u64::from(back) + 1,
            };
            self.counts.fillers += u64::from(self.settings.filler != FillerPolicy::Off);
            self.publish(position, false, reception, effects);
        }
    }

    fn publish(
        &mut self,
        position: CodePosition,
        received: bool,
        reception: Reception<'_>,
        effects: &mut dyn Effects,
    ) {
        let words = TriWords {
            flags: position.flags.bits(),
            window: position.window,
            device_time_us: position.device_us,
            lost: position.lost,
            trigger: reception
                .trigger
                .level_at(self.device.last_sample(position.window)),
        };
        let steps_back = reception.clock.wall_steps_back();
        let window_lookback = u32::from(self.device.window_steps) - 1;
        if received || self.settings.filler != FillerPolicy::Off {
            let first = self.wall_time_ns(position, window_lookback, window_lookback, reception);
            let frame = &mut self.frame;
            frame.header.stamp = self.encoded_stamps.next(first, steps_back);
            frame.neuroheader.seq = frame.neuroheader.seq.wrapping_add(1);
            frame.header.seq = frame.neuroheader.seq;
            frame.eeg.data.copy_from_slice(&self.z);
            frame.tri.data.copy_from_slice(&words.words());
            effects.publish_encoded(frame);
        }
        if self.decodable {
            let lookback = Reconstruction::lookback_steps(&self.device, self.settings.low_latency);
            let length = u32::from(self.device.hop_steps) - 1;
            let time = self.wall_time_ns(position, lookback, length, reception);
            let stamp = self.window_stamps.next(time, steps_back);
            let z = received.then(|| Box::new(self.z));
            effects.decode(TimedCode { z, stamp, words });
        }
    }

    /// Wall clock time of a frame that begins `lookback` steps before the window's last step and
    /// ends `length` steps later, nanoseconds.
    fn wall_time_ns(
        &self,
        position: CodePosition,
        lookback: u32,
        length: u32,
        reception: Reception<'_>,
    ) -> i64 {
        let back_us = match self.settings.stamp {
            StampPoint::First => self.device.steps_us(lookback),
            StampPoint::Last => self.device.steps_us(lookback - length),
            StampPoint::Arrival => return reception.clock.wall_of_host_ns(reception.read),
        };
        let on_scalp = i128::from(position.device_us)
            - i128::from(back_us)
            - i128::from(self.device.group_delay_us);
        let wall_ns = reception.clock.wall_ns(on_scalp);
        wall_ns.unwrap_or(reception.read.wall_ns)
    }
}
