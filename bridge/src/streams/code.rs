//! The stream of codes, published on `/encoded` and passed to the decoder.

use std::sync::Arc;

use link::{Code, Flags};
use neuro_ros::NeuroFrame;

use crate::decoder::reconstruction::{Reconstruction, TimedCode};
use crate::device::Device;
use crate::effects::Effects;
use crate::settings::{FillerPolicy, Settings, StampPoint};
use crate::streams::continuity::{Continuity, MissingStretch};
use crate::streams::counts::CodeCounts;
use crate::streams::ledger::Arrival;
use crate::streams::stamps::{MonotoneStamps, Reception};
use crate::streams::tri::TriWords;

/// Converts codes to NeuroFrames for `/encoded` and to input for the decoder. Fillers replace lost
/// codes.
///
/// Shape of the frames, sequence numbers and counts persist while the bridge runs, across restarts
/// of the device.
#[derive(Debug)]
pub(crate) struct CodeStream {
    settings: Settings,
    device: Arc<Device>,
    decodable: bool,
    frame: NeuroFrame,
    z: Vec<f32>,
    /// Whether `z` holds a code of this recording.
    has_last: bool,
    /// Whether a code, a `Stats` message or an acknowledgement has shown that the stream runs.
    running: bool,
    /// Device time of the newest code or filler in this stream, microseconds.
    last_device_us: Option<u64>,
    /// Index of the newest window, received or filled.
    last_window: u32,
    continuity: Continuity,
    /// Newest stretch of missing codes, until the bus has reported it.
    missing: Option<MissingStretch>,
    counts: CodeCounts,
    encoded_stamps: MonotoneStamps,
    window_stamps: MonotoneStamps,
}

/// Window index, device time and status of a published code or filler.
#[derive(Clone, Copy, Debug)]
struct CodePosition {
    window: u32,
    /// Device time of the window's last step in the newest run, microseconds; negative before that
    /// run began.
    device_us: i128,
    flags: Flags,
    /// Number of codes missing so far.
    missing: u64,
}

/// Codes that are missing directly before another code.
#[derive(Clone, Copy, Debug)]
struct Gap {
    /// Number of codes that the device made in this run.
    lost: u32,
    /// Number of codes before the first one of this run.
    between_runs: u64,
}

impl CodeStream {
    pub(crate) fn new(device: Arc<Device>, decodable: bool, settings: Settings) -> CodeStream {
        CodeStream {
            settings,
            decodable,
            frame: device.encoded_frame(),
            z: vec![0.0; device.numbers()],
            device,
            has_last: false,
            running: false,
            last_device_us: None,
            last_window: 0,
            continuity: Continuity::default(),
            missing: None,
            counts: CodeCounts::default(),
            encoded_stamps: MonotoneStamps::default(),
            window_stamps: MonotoneStamps::default(),
        }
    }

    /// Switches to another device of the same shape, or to the same device with another mains
    /// frequency. Sequence numbers, counts and stamps continue.
    pub(crate) fn replace_device(&mut self, device: Arc<Device>, decodable: bool) {
        let numbers = (self.frame.header.seq, self.frame.neuroheader.seq);
        self.frame = device.encoded_frame();
        (self.frame.header.seq, self.frame.neuroheader.seq) = numbers;
        self.device = device;
        self.decodable = decodable;
    }

    /// Starts another run. Call this when the device counts windows from 0 again. The time until the
    /// run's first code is filled.
    pub(crate) fn restart(&mut self) {
        self.counts.ledger.expect_next(0);
        self.running = false;
        self.last_device_us = None;
        self.continuity.end_run();
    }

    /// Ends the recording, because the user stopped the stream. The time until the next start is not
    /// filled.
    pub(crate) fn end_recording(&mut self) {
        self.restart();
        self.continuity = Continuity::default();
        self.has_last = false;
        self.z.fill(0.0);
    }

    /// Records that the stream runs. From now on, the window index in `Stats` is that of this
    /// stream.
    pub(crate) fn mark_running(&mut self) {
        self.running = true;
    }

    /// Returns whether the stream is known to run since the last restart. Before that, a `Stats`
    /// message without the stream of codes is the late answer to a `Stop`, and its window index
    /// belongs to the previous stream.
    pub(crate) fn is_running(&self) -> bool {
        self.running
    }

    pub(crate) fn device(&self) -> &Arc<Device> {
        &self.device
    }

    /// Returns the newest stretch of missing codes once. It starts where the frames do.
    pub(crate) fn take_missing(&mut self) -> Option<MissingStretch> {
        self.missing.take()
    }

    pub(crate) fn counts(&self) -> &CodeCounts {
        &self.counts
    }

    /// Returns the number of stamps that were moved forwards, because they were not at least 1 us
    /// later than the previous stamp.
    pub(crate) fn moved_stamps(&self) -> u64 {
        self.encoded_stamps.moved() + self.window_stamps.moved()
    }

    /// Returns whether `code` shows that the device restarted its stream without a command. A
    /// restart is assumed if the code's frame is new but its window index was already counted.
    pub(crate) fn is_restart(&self, code: &Code) -> bool {
        self.counts.ledger.is_old(code.window)
    }

    /// Publishes a code that the device made at `device_us`. Fillers for the codes lost before it
    /// are published first.
    ///
    /// `device_us` is `None` if the frame's device time was impossible. The time is then computed
    /// from the window index.
    pub(crate) fn receive(
        &mut self,
        code: &Code,
        device_us: Option<u64>,
        reception: Reception<'_>,
        effects: &mut dyn Effects,
    ) {
        let (format, numbers) = (code.values.format(), code.values.len());
        let device = &self.device;
        let expected = (device.model_id, device.code_format, device.numbers());
        if (code.model_id, format, numbers) != expected {
            self.counts.foreign += 1;
            return;
        }
        let mut arrival = self.counts.ledger.record(code.window);
        if arrival == Arrival::Old {
            tracing::warn!(window = code.window, "the device restarted its stream");
            self.restart();
            arrival = self.counts.ledger.record(code.window);
        }
        let Arrival::New { lost } = arrival else {
            return;
        };
        let host_us = device_us.and_then(|us| reception.clock.host_us(us.into()));
        let device_us = device_us.unwrap_or_else(|| self.time_of_next(lost, 0));
        let gap = Gap {
            lost,
            between_runs: self.missing_between_runs(host_us, lost, reception),
        };
        self.fill(code.window, gap, device_us, reception, effects);
        let device = Arc::clone(&self.device);
        device.dequantise(&code.values, &mut self.z);
        self.has_last = true;
        self.running = true;
        self.last_device_us = Some(device_us);
        self.counts.clipped += u64::from(code.clipped);
        self.counts.clipped_values += u64::from(code.clipped_values);
        let position = CodePosition {
            window: code.window,
            device_us: device_us.into(),
            flags: code.flags,
            missing: self.counts.missing(),
        };
        self.publish(position, true, reception, effects);
    }

    /// Publishes fillers for all codes before index `next` that have not arrived. According to a
    /// `Stats` message that the device made at `device_us`, its next code has this index.
    pub(crate) fn fill_before(
        &mut self,
        next: u32,
        device_us: u64,
        reception: Reception<'_>,
        effects: &mut dyn Effects,
    ) {
        let lost = self.counts.ledger.count_lost_before(next);
        if lost == 0 {
            return;
        }
        // Before the first code of a stream, only the time of the `Stats` message is known. The
        // device made its last code at most one hop before that time.
        let next_us = self.time_of_next(lost, device_us);
        let host_us = reception.clock.host_us(next_us.into());
        let gap = Gap {
            lost,
            between_runs: self.missing_between_runs(host_us, lost, reception),
        };
        self.fill(next, gap, next_us, reception, effects);
        self.last_device_us = Some(next_us.saturating_add_signed(-self.hop_us()));
    }

    /// Returns the number of codes missing between two runs; 0 within a run. `host_us` is the host
    /// time of a code of the newer run, of which `lost` codes before it are lost.
    fn missing_between_runs(
        &mut self,
        host_us: Option<f64>,
        lost: u32,
        reception: Reception<'_>,
    ) -> u64 {
        let read_us = reception.read.monotonic_us;
        #[expect(clippy::cast_precision_loss, reason = "within 2^53 us (285 years)")]
        let [read_us, hop_us] = [read_us, self.hop_us()].map(|us| us as f64);
        let first_us = host_us.unwrap_or(read_us) - f64::from(lost) * hop_us;
        let missing = self.continuity.missing_before(first_us, hop_us);
        self.counts.between_runs += missing;
        missing
    }

    /// Returns the device time of the code that follows `lost` lost codes, microseconds. If the
    /// time of no code is known, returns the time one hop after `fallback_us`.
    fn time_of_next(&self, lost: u32, fallback_us: u64) -> u64 {
        let (known_us, hops) = match self.last_device_us {
            Some(last_us) => (last_us, i64::from(lost) + 1),
            None => (fallback_us, 1),
        };
        known_us.saturating_add_signed(hops * self.hop_us())
    }

    /// Returns the time from the first step of an announced frame, at the electrodes, to the last step
    /// of the window that completes the frame, microseconds.
    fn lookback_us(&self) -> i128 {
        let announced = self.settings.announced;
        self.device
            .frame_lookback_us(announced, self.settings.low_latency)
            .into()
    }

    fn hop_us(&self) -> i64 {
        self.device.steps_us(u32::from(self.device.hop_steps))
    }

    /// Publishes fillers for the codes missing directly before index `window`. The code of index
    /// `window` has the device time `device_us`.
    fn fill(
        &mut self,
        window: u32,
        gap: Gap,
        device_us: u64,
        reception: Reception<'_>,
        effects: &mut dyn Effects,
    ) {
        let missing = gap.between_runs + u64::from(gap.lost);
        if missing == 0 {
            return;
        }
        tracing::debug!(
            lost = gap.lost,
            between_runs = gap.between_runs,
            before = window,
            "codes missing"
        );
        let hop_us = i128::from(self.hop_us());
        #[expect(
            clippy::cast_precision_loss,
            reason = "68 minutes are exact to the millisecond"
        )]
        let seconds = (hop_us * i128::from(missing)) as f32 / 1e6;
        self.missing = Some(MissingStretch {
            start_us: i128::from(device_us) - hop_us * i128::from(missing) - self.lookback_us(),
            seconds,
            restarted: gap.between_runs > 0,
        });
        let filled = missing.min(effects.max_fillers());
        if filled < missing {
            let unfilled = missing - filled;
            self.counts.unfilled += unfilled;
            // The indices show the gap, also those between two runs.
            let between_runs = unfilled.min(gap.between_runs);
            #[expect(clippy::cast_possible_truncation, reason = "indices wrap")]
            let between_runs = between_runs as u32;
            self.last_window = self.last_window.wrapping_add(between_runs);
            tracing::error!(
                unfilled,
                "the outage was too long to fill; start a new recording"
            );
        }
        if self.settings.filler == FillerPolicy::Zeros || !self.has_last {
            self.z.fill(0.0);
        }
        for back in (1..=filled).rev() {
            // The windows between two runs have no index of their own; those of the older run go on.
            let window = match u32::try_from(back) {
                Ok(back) if back <= gap.lost => window.wrapping_sub(back),
                _ => self.last_window.wrapping_add(1),
            };
            let position = CodePosition {
                window,
                device_us: i128::from(device_us) - hop_us * i128::from(back),
                flags: Flags::FILLER,
                missing: self.counts.missing() - back + 1,
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
        let host_us = reception.clock.host_us(position.device_us);
        #[expect(clippy::cast_precision_loss, reason = "within 2^53 us (285 years)")]
        let read_us = reception.read.monotonic_us as f64;
        self.continuity.record(host_us.unwrap_or(read_us));
        self.last_window = position.window;
        let words = TriWords {
            flags: position.flags.bits(),
            window: position.window,
            device_time_us: u64::try_from(position.device_us).unwrap_or(0),
            lost: position.missing,
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
            let z = received.then(|| self.z.clone());
            effects.decode(TimedCode { z, stamp, words });
        }
    }

    /// Returns the stamp of a frame, nanoseconds since 1970. The frame's first step is `lookback`
    /// steps before the last step of the window; the frame's last step is `length` steps after its
    /// first.
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
        let on_scalp =
            position.device_us - i128::from(back_us) - i128::from(self.device.group_delay_us);
        let wall_ns = reception.clock.wall_ns(on_scalp);
        wall_ns.unwrap_or(reception.read.wall_ns)
    }
}
