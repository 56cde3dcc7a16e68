//! Converts what the bridge's core publishes of a recording to blocks and events.

use std::sync::Arc;

use bridge_core::{
    Announcement, Device, Effects, EventPlace, Model, PackedReconstruction, Reconstruction,
    Settings, TimedCode, TimedPackedBlock,
};
use neuro_ros::{NeuroDataInfo, NeuroEvent, NeuroFrame, NeuroOutput, TriWords};

use crate::conversion::block::{Block, STREAMS, Stream, TimedEvent};

/// Event code of a rising edge of the trigger input; a falling edge has bit 15 as well.
const TRIGGER: u16 = 1;

/// Time by which the fillers of a stream may be longer than the recording, seconds. It allows for
/// the drift between the clocks of device and host.
const SPARE_S: u64 = 120;
/// Maximum total duration of the fillers of a stream, seconds: a day.
const MAX_FILLERS_S: u64 = 86_400;

/// Receives the blocks and events of a recording, in the order in which the core publishes them.
pub(crate) trait Listener {
    /// Whether the listener reads the values of reconstructed rows. If not, they are not decoded,
    /// because decoding takes most of the time of a pass.
    const DECODES: bool;

    /// Receives the next rows of a stream.
    fn block(&mut self, block: Block);

    /// Receives the next event: an edge of the trigger input, or a marker.
    fn event(&mut self, event: TimedEvent);
}

/// Turns what the core publishes into blocks and events, and passes these to a [`Listener`].
pub(crate) struct Collector<L> {
    pub(crate) listener: L,
    settings: Settings,
    model: Arc<Model>,
    device: Option<Arc<Device>>,
    reconstruction: Option<Reconstruction>,
    packed: Option<PackedReconstruction>,
    /// The newest packed block. Its frame is published when the next block arrives.
    newest_packed: PassedBlock,
    /// Number of restarts of the device so far.
    pub(crate) run: u32,
    /// Device time, microseconds, in the header of the frame that the bridge's core is handling.
    pub(crate) frame_us: u64,
    /// Commands that the core has sent and the caller has not taken yet.
    pub(crate) commands: Vec<Vec<u8>>,
    /// Newest block of samples, and newest block of filtered steps.
    newest: [Option<Block>; 2],
    /// Time from the first record to the newest one, seconds.
    pub(crate) elapsed_s: u64,
    /// Number of rows of each stream so far, without fillers.
    received: [u64; STREAMS],
    /// Number of filler rows of each stream so far.
    fillers: [u64; STREAMS],
    /// Number of missing rows that no filler replaces, because their stream already has as many
    /// fillers as permitted.
    pub(crate) unfilled: u64,
}

/// A packed block whose frame waits for the next block.
#[derive(Clone, Copy, Debug, Default)]
struct PassedBlock {
    /// Number of restarts of the device before it made the block.
    run: u32,
    /// False if the block was lost.
    is_received: bool,
}

impl<L: Listener> Collector<L> {
    pub(crate) fn new(listener: L, settings: Settings, model: Arc<Model>) -> Collector<L> {
        Collector {
            listener,
            settings,
            model,
            device: None,
            reconstruction: None,
            packed: None,
            newest_packed: PassedBlock::default(),
            run: 0,
            frame_us: 0,
            commands: Vec::new(),
            newest: [None, None],
            elapsed_s: 0,
            received: [0; STREAMS],
            fillers: [0; STREAMS],
            unfilled: 0,
        }
    }

    /// Returns the number of packed blocks that were malformed.
    pub(crate) fn malformed(&self) -> u64 {
        let packed = self.packed.as_ref();
        packed.map_or(0, PackedReconstruction::malformed)
    }

    /// Passes a marker of the user to the listener. A marker without a device time gets the device
    /// time of the newest frame. Markers bypass the core, because the core publishes them only if
    /// the recording has the stream of events.
    pub(crate) fn mark(&mut self, text: String, device_us: Option<i64>, wall_ns: i64) {
        let newest_us = i64::try_from(self.frame_us).unwrap_or(i64::MAX);
        self.listener.event(TimedEvent {
            run: self.run,
            device_us: device_us.unwrap_or(newest_us),
            wall_ns,
            code: event_code(NeuroEvent::MARKER),
            description: text,
        });
    }

    /// Passes a frame that the device made since its newest start to the listener. The first row
    /// happened `delay_us` before the device time in the frame's status words.
    fn publish(&mut self, stream: Stream, frame: &NeuroFrame, delay_us: i64) {
        let block = Self::block_of(self.run, stream, frame, delay_us);
        let is_filler = block.is_filler();
        self.pass_on(block, is_filler);
    }

    /// Passes the frame of a packed block to the listener. The first pass decodes no blocks, so it
    /// does not flag a malformed block as a filler. For equal results, both passes ignore this flag
    /// and count a malformed block as received.
    fn publish_packed(&mut self, of: PassedBlock, frame: &NeuroFrame, delay_us: i64) {
        let block = Self::block_of(of.run, Stream::Reconstructed, frame, delay_us);
        self.pass_on(block, !of.is_received);
    }

    fn block_of(run: u32, stream: Stream, frame: &NeuroFrame, delay_us: i64) -> Block {
        let word = |index: usize| i64::from(frame.tri.data.get(index).copied().unwrap_or(0));
        let device_us_of = |row: u16| {
            let word = |index| word(8 * usize::from(row) + index);
            word(3) | word(4) << 16 | word(5) << 32
        };
        let last = frame.eeg.info.nsamples.saturating_sub(1);
        let [first_us, last_us] = [0, last].map(device_us_of);
        let device_us = if last_us < first_us {
            // The device restarted within the frame. The frame's last row was made after the
            // restart, so count back from that row.
            last_us - i64::from(last) * 1_000_000 / i64::from(frame.sr.max(1))
        } else {
            first_us
        };
        let number = (word(1) | word(2) << 16).unsigned_abs();
        let rows = u64::from(frame.eeg.info.nsamples);
        let has_index = matches!(stream, Stream::Raw | Stream::Filtered);
        Block {
            stream,
            frame: frame.clone(),
            run,
            first_us: device_us - delay_us,
            wall_ns: frame.header.stamp.nanoseconds(),
            index: has_index.then_some(number * rows),
        }
    }

    fn pass_on(&mut self, block: Block, is_filler: bool) {
        self.fill_skipped(&block);
        if is_filler && self.take_fillers(&block, 1) == 0 {
            return;
        }
        if !is_filler {
            self.received[block.stream as usize] += block.rows() as u64;
        }
        self.listener.block(block);
    }

    /// Returns how many of `count` blocks of fillers the stream may still have, and counts them as
    /// used. The limit exists because a damaged recording can lack so much data that the fillers
    /// for it would not fit on a disk.
    fn take_fillers(&mut self, block: &Block, count: u64) -> u64 {
        let seconds = self.elapsed_s.saturating_add(SPARE_S).min(MAX_FILLERS_S);
        // A device that is faster than real time, such as a simulated one, sends more than a second
        // of signal per second, so the rows received from it raise the limit.
        let most = seconds * u64::from(block.frame.sr) + self.received[block.stream as usize];
        let rows = (block.rows() as u64).max(1);
        let fillers = &mut self.fillers[block.stream as usize];
        let taken = count.min(most.saturating_sub(*fillers) / rows);
        *fillers += taken * rows;
        let missing = (count - taken).saturating_mul(rows);
        self.unfilled = self.unfilled.saturating_add(missing);
        taken
    }

    /// Passes fillers to the listener for the missing frames before `block` that the core did not
    /// fill. The core fills only as many frames as fit into the queues of subscribers. After a
    /// restart, the times of the fillers continue the times of the previous run.
    fn fill_skipped(&mut self, block: &Block) {
        let place = match block.stream {
            Stream::Raw => 0,
            Stream::Filtered => 1,
            Stream::Codes | Stream::Reconstructed | Stream::Predictions => return,
        };
        let rows = (block.rows() as u64).max(1);
        if let (Some(mut filler), Some(index)) = (self.newest[place].take(), block.index) {
            let next = filler.index.unwrap_or(0) + rows;
            let skipped = index.saturating_sub(next).div_ceil(rows);
            for _ in 0..self.take_fillers(block, skipped) {
                filler.become_filler(rows);
                self.listener.block(filler.clone());
            }
        }
        self.newest[place] = Some(block.clone());
    }

    /// Returns how long before the device time of a code or packed block its first step was at the
    /// electrodes, microseconds. `steps` returns the number of steps in the code or block.
    fn delay_us(&self, steps: impl Fn(&Device) -> u8) -> i64 {
        self.device.as_ref().map_or(0, |device| {
            let lookback = u32::from(steps(device)) - 1;
            device.steps_us(lookback) + i64::from(device.group_delay_us)
        })
    }
}

impl<L: Listener> Effects for Collector<L> {
    fn send(&mut self, frame: &[u8]) {
        self.commands.push(frame.to_vec());
    }

    fn announce(&mut self, announcement: &Announcement) {
        self.device = Some(Arc::clone(&announcement.device));
        if announcement.decodable {
            let model = Arc::clone(&self.model);
            let mut next = Reconstruction::new(&announcement.device, model, self.settings);
            if let Some(before) = &self.reconstruction {
                next.continue_from(before);
            }
            self.reconstruction = Some(next);
            let (device, model) = (&announcement.device, &self.model);
            let mut next = PackedReconstruction::new(device, model, self.settings);
            if let (Some(next), Some(before)) = (&mut next, &mut self.packed) {
                next.continue_from(before);
            }
            self.packed = next;
        }
    }

    fn publish_encoded(&mut self, frame: &NeuroFrame) {
        self.publish(Stream::Codes, frame, self.delay_us(|device| device.window_steps));
    }

    fn decode(&mut self, window: TimedCode) {
        let delay_us = self.delay_us(|device| device.window_steps);
        let Some(mut reconstruction) = self.reconstruction.take() else {
            return;
        };
        let frame = if L::DECODES {
            reconstruction.next_frame(&window)
        } else {
            reconstruction.next_times(&window)
        };
        if let Some(frame) = frame {
            self.publish(Stream::Reconstructed, frame, delay_us);
        }
        self.reconstruction = Some(reconstruction);
    }

    fn decode_block(&mut self, block: TimedPackedBlock) {
        let delay_us = self.delay_us(|device| device.hop_steps);
        let Some(mut packed) = self.packed.take() else {
            return;
        };
        // The block completes the frame of the block before it, which may be of an earlier run.
        let newest = PassedBlock { run: self.run, is_received: block.block.is_some() };
        let before = std::mem::replace(&mut self.newest_packed, newest);
        let frame = if L::DECODES { packed.next_frame(&block) } else { packed.next_times(&block) };
        if let Some(frame) = frame {
            self.publish_packed(before, frame, delay_us);
        }
        self.packed = Some(packed);
    }

    fn finish_blocks(&mut self) {
        let delay_us = self.delay_us(|device| device.hop_steps);
        let Some(mut packed) = self.packed.take() else {
            return;
        };
        if let Some(frame) = packed.finish() {
            self.publish_packed(self.newest_packed, frame, delay_us);
        }
        self.packed = Some(packed);
    }

    fn publish_raw(&mut self, frame: &NeuroFrame) {
        self.publish(Stream::Raw, frame, 0);
    }

    fn publish_filtered(&mut self, frame: &NeuroFrame) {
        let delay_us = self.device.as_ref().map_or(0, |device| device.group_delay_us);
        self.publish(Stream::Filtered, frame, delay_us.into());
    }

    fn publish_prediction(&mut self, prediction: &NeuroOutput, words: TriWords) {
        let Some(device) = &self.device else {
            return;
        };
        let frame = prediction_frame(device, prediction, words);
        self.publish(Stream::Predictions, &frame, self.delay_us(|device| device.hop_steps));
    }

    fn publish_event(&mut self, event: &NeuroEvent, _: EventPlace) {
        let code = event_code(event.event);
        // The event bus also reports missing data of the announced stream. Such events are left
        // out, because missing rows have a flag.
        if code & 0x7fff != TRIGGER {
            return;
        }
        self.listener.event(TimedEvent {
            run: self.run,
            device_us: i64::try_from(self.frame_us).unwrap_or(i64::MAX),
            wall_ns: event.header.stamp.nanoseconds(),
            code,
            description: event.description.clone(),
        });
    }
}

/// Returns the 16-bit code of a ROS-Neuro event.
const fn event_code(of: i32) -> u16 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "an event's type has 16 bits"
    )]
    let code = of as u16;
    code
}

/// Returns a prediction as a row: the probability of each class, and the code of the chosen class,
/// or 0 if none is chosen.
fn prediction_frame(device: &Device, prediction: &NeuroOutput, words: TriWords) -> NeuroFrame {
    let soft = &prediction.softpredict;
    let codes = &prediction.decoder.classes;
    let chosen = prediction.hardpredict.data.iter().zip(codes);
    let chosen = chosen.filter(|(is_chosen, _)| **is_chosen == 1);
    let most = codes.iter().copied().max().unwrap_or(0);
    let decision = NeuroDataInfo {
        unit: String::new(),
        isint: 1,
        minmax: [-most, most].map(f64::from).to_vec(),
        ..soft.info.clone()
    };
    let decision = decision.with_labels(vec!["decision".to_owned()]);
    let rate_hz = device.codes_per_second();
    let mut frame = NeuroFrame::zeros(rate_hz, "classifier", soft.info.clone(), decision);
    frame.header.stamp = prediction.header.stamp;
    frame.eeg.data.copy_from_slice(&soft.data);
    #[expect(clippy::cast_precision_loss, reason = "the codes of a classifier have 16 bits")]
    frame.exg.data.fill(chosen.map(|(_, code)| *code).sum::<i32>() as f32);
    frame.tri.data.copy_from_slice(&words.words());
    frame
}
