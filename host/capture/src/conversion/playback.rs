//! Plays a recording to the bridge's core: delivers the device's frames, each at its time.

use std::collections::HashMap;
use std::mem::discriminant;
use std::sync::Arc;

use bridge_core::{Core, Effects, HostTime, Identity, Model, Settings};
use link::{Ack, AckResult, Decoder, Frame, Header, MAX_FRAME, ToDevice, ToHost};

use crate::conversion::collector::{Collector, Listener};
use crate::recording::renumbering::{Hop, Renumbering};
use crate::recording::{Record, RecordKind};

/// Time between two calls of [`Core::tick`], microseconds.
const TICK_US: i64 = 100_000;

/// Longest pause in a recording that the core is ticked through, microseconds. All of the core's
/// timeouts are shorter, so ticks in the rest of a longer pause would change nothing.
const MAX_TICKS_US: i64 = 120_000_000;

/// Sequence number that no command of the core has, because the core counts from 0.
const NOT_SENT: u32 = u32::MAX;

/// Plays the records of a recording to a core.
///
/// The core sends commands as the bridge did while it recorded, but their sequence numbers can
/// differ: a newer bridge may send more commands. So each recorded acknowledgement is passed to the
/// core with the number of the core's own command of the same kind, or, if it has sent none, with a
/// number that it does not use.
pub(crate) struct Playback<L> {
    pub(crate) core: Core,
    pub(crate) collector: Collector<L>,
    /// Commands in the recording so far, by their sequence number.
    recorded: HashMap<u32, ToDevice<'static>>,
    /// Newest command of each kind that the core has sent, preceded by its sequence number.
    own: Vec<(u32, ToDevice<'static>)>,
    from_device: Decoder<MAX_FRAME>,
    from_host: Decoder<MAX_FRAME>,
    identity: Option<Identity>,
    hop: Option<Hop>,
    renumbering: Renumbering,
    /// Time of the newest record; `None` after the core has been ticked for this time.
    due: Option<HostTime>,
    /// Time of the newest record.
    newest: Option<HostTime>,
    /// Time of the first record.
    first: Option<HostTime>,
}

impl<L: Listener> Playback<L> {
    pub(crate) fn new(settings: Settings, model: Arc<Model>, listener: L) -> Playback<L> {
        Playback {
            core: Core::new(settings, Some(Arc::clone(&model))),
            collector: Collector::new(listener, settings, model),
            recorded: HashMap::new(),
            own: Vec::new(),
            from_device: Decoder::new(),
            from_host: Decoder::new(),
            identity: None,
            hop: None,
            renumbering: Renumbering::Off,
            due: None,
            newest: None,
            first: None,
        }
    }

    pub(crate) fn play(&mut self, record: Record<'_>) {
        let time = record.time;
        let first = *self.first.get_or_insert(time);
        let since_first_us = time.monotonic_us - first.monotonic_us;
        self.collector.elapsed_s = u64::try_from(since_first_us / 1_000_000).unwrap_or(0);
        // Tick the core only when the time changes: frames that were read together have the same
        // time, and the core sends commands only after the last of them.
        if self.due.is_some_and(|due| due.monotonic_us != time.monotonic_us) {
            self.tick();
        }
        self.pass_time(time);
        match record.kind {
            RecordKind::Opened => {
                self.from_device.reset();
                self.core.connected(time, &mut self.collector);
                self.note_commands();
            }
            RecordKind::Closed => self.core.disconnected(),
            RecordKind::Ending => {
                self.core.set_streaming(false);
                self.due = Some(time);
                self.tick();
            }
            RecordKind::Sent => {
                let mut bytes = record.payload;
                while let Some(outcome) = self.from_host.next::<ToDevice>(&mut bytes) {
                    if let Ok(frame) = outcome {
                        let command = frame.message.without_bytes();
                        if matches!(command, ToDevice::Start(_)) {
                            self.renumbering = Renumbering::Off;
                        }
                        self.recorded.insert(frame.header.seq, command);
                    }
                }
                self.due = Some(time);
                self.tick();
            }
            RecordKind::Received => {
                self.receive(record.payload, time);
                self.due = Some(time);
            }
            RecordKind::Marker => {
                let text = String::from_utf8_lossy(record.payload).into_owned();
                let (device_us, wall_ns) = self.core.times_at(time);
                self.collector.mark(text, device_us, wall_ns);
            }
            RecordKind::Joined => self.renumbering = Renumbering::joined(self.hop),
            RecordKind::Newer(_) => {}
        }
        self.newest = Some(time);
    }

    /// Publishes the last packed block, which has been waiting for the next block. Call this at the
    /// end.
    pub(crate) fn finish(&mut self) {
        self.collector.finish_blocks();
    }

    fn tick(&mut self) {
        if let Some(due) = self.due.take() {
            self.core.tick(due, &mut self.collector);
            self.note_commands();
        }
    }

    /// Ticks the core through the time until `time`, as the bridge would, so that timeouts expire.
    fn pass_time(&mut self, time: HostTime) {
        let Some(newest) = self.newest else { return };
        let mut now = newest;
        let end_us = time.monotonic_us.min(newest.monotonic_us + MAX_TICKS_US);
        while now.monotonic_us + TICK_US < end_us {
            now.monotonic_us += TICK_US;
            now.wall_ns += TICK_US * 1000;
            self.core.tick(now, &mut self.collector);
            self.note_commands();
        }
    }

    fn receive(&mut self, payload: &[u8], read: HostTime) {
        let mut bytes = payload;
        let mut decoder = std::mem::take(&mut self.from_device);
        let mut changed = None;
        while let Some(outcome) = decoder.next::<ToHost>(&mut bytes) {
            let Ok(frame) = outcome else { continue };
            self.collector.frame_us = frame.header.device_time_us;
            match frame.message {
                ToHost::Hello(hello) => {
                    let same = |identity: &Identity| identity.is_same_start(&hello);
                    if self.identity.as_ref().is_some_and(|known| !same(known)) {
                        self.collector.run += 1;
                        self.renumbering = Renumbering::Off;
                    }
                    self.identity = Some(Identity::new(&hello));
                }
                ToHost::Capabilities(ref capabilities) => self.hop = Hop::of(capabilities),
                ToHost::Ack(ack) => changed = self.own_answer(&frame, ack),
                _ if self.renumbering != Renumbering::Off => {
                    // Replace a message from before the recording by an acknowledgement of no
                    // command, so that its frame does not count as lost.
                    let none = ToHost::Ack(Ack { of: NOT_SENT, result: AckResult::Done });
                    let message = self.renumbering.apply(&frame.message).unwrap_or(none);
                    changed = encoded(&frame.header, &message);
                }
                _ => {}
            }
        }
        self.from_device = decoder;
        let bytes = changed.as_deref().unwrap_or(payload);
        self.core.handle(bytes, read, &mut self.collector);
    }

    /// Returns the bytes of `frame`, with its acknowledgement `ack` changed to name the core's own
    /// command; `None` if the recording lacks the acknowledged command.
    fn own_answer(&self, frame: &Frame<ToHost>, ack: Ack) -> Option<Vec<u8>> {
        let recorded = discriminant(self.recorded.get(&ack.of)?);
        let mut own = self.own.iter().rev();
        let own = own.find(|(_, own)| discriminant(own) == recorded);
        let of = own.map_or(NOT_SENT, |(of, _)| *of);
        encoded(&frame.header, &ToHost::Ack(Ack { of, ..ack }))
    }

    fn note_commands(&mut self) {
        let mut decoder = Decoder::<MAX_FRAME>::new();
        for bytes in self.collector.commands.drain(..) {
            let mut bytes = &bytes[..];
            while let Some(Ok(frame)) = decoder.next::<ToDevice>(&mut bytes) {
                let kind = discriminant(&frame.message);
                self.own.retain(|(_, known)| discriminant(known) != kind);
                self.own.push((frame.header.seq, frame.message.without_bytes()));
            }
        }
    }
}

fn encoded(header: &Header, message: &ToHost) -> Option<Vec<u8>> {
    let mut buffer = [0; MAX_FRAME];
    let bytes = link::encode(header, message, &mut buffer).ok()?;
    Some(bytes.to_vec())
}
