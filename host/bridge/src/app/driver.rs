//! Drives the state machine [`Core`] on a port, for every subcommand that streams.

use std::time::Duration;

use bridge_core::{Core, Effects, HostTime};
use tokio::time::{Instant, Interval, MissedTickBehavior, interval};

use crate::app::log::SilenceLog;
use crate::error::BridgeError;
use crate::wire::connection::{Event, Feed};

/// Time without a frame from the device after which the log reports the silence.
const SILENCE: Duration = Duration::from_secs(5);
/// Time limit for the device to stop when the program ends.
pub(crate) const DRAIN_TIMEOUT: Duration = Duration::from_secs(1);

/// Effects of a core that sends bytes to a device through a port.
pub(crate) trait PortEffects: Effects {
    /// Returns the bytes for the device that the port has not accepted yet.
    fn outgoing(&mut self) -> &mut Vec<u8>;

    /// Receives each event of the port, with the bytes that were read, before the core handles it.
    fn note(&mut self, _event: Event, _bytes: &[u8], _at: HostTime) {}
}

/// A core with its connection to the device.
pub(crate) struct Driver<F> {
    pub(crate) core: Box<Core>,
    pub(crate) connection: F,
    buffer: Vec<u8>,
    ticks: Interval,
    silence_log: SilenceLog,
    /// When to end even if the device has not stopped; `None` until [`Self::end`].
    deadline: Option<Instant>,
}

impl<F: Feed> Driver<F> {
    pub(crate) fn new(core: Core, connection: F) -> Driver<F> {
        let mut ticks = interval(Core::TICK);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Skip);
        Driver {
            core: Box::new(core),
            connection,
            buffer: vec![0; 4096],
            ticks,
            silence_log: SilenceLog::default(),
            deadline: None,
        }
    }

    /// Waits for an event at the port or for the next tick, and lets the core handle it. Returns
    /// the event; `None` after a tick. While `is_paused`, the port is not read, so the device waits
    /// or drops frames. Cancel safe.
    ///
    /// # Errors
    ///
    /// The errors of [`Feed::next_event`].
    pub(crate) async fn next(
        &mut self,
        effects: &mut impl PortEffects,
        is_paused: bool,
    ) -> Result<Option<Event>, BridgeError> {
        let event = tokio::select! {
            event = self.connection.next_event(&mut self.buffer, effects.outgoing()), if !is_paused => Some(event?),
            _ = self.ticks.tick() => None,
        };
        match event {
            Some(event) => self.handle(event, effects),
            None => self.tick(effects, is_paused),
        }
        Ok(event)
    }

    fn handle(&mut self, event: Event, effects: &mut impl PortEffects) {
        // Read the clock directly after the bytes: the device's clock is fitted to the times at
        // which bytes arrive.
        let now = self.connection.read_time();
        match event {
            Event::Opened => {
                effects.note(event, &[], now);
                self.core.connected(now, effects);
            }
            Event::Bytes(count) => {
                let bytes = &self.buffer[..count];
                effects.note(event, bytes, now);
                self.core.receive(bytes, now, effects);
                let frames = self.core.wire_counters().frames;
                self.connection.mark_stranger(frames == 0);
            }
            Event::Closed => {
                if self.connection.is_stranger() {
                    self.log_silence();
                }
                self.disconnected(effects, now);
            }
        }
    }

    fn tick(&mut self, effects: &mut impl PortEffects, is_paused: bool) {
        let now = HostTime::now();
        self.core.tick(now, effects);
        if is_paused || !self.connection.is_open() {
            return;
        }
        if self.core.is_unresponsive(now, SILENCE) {
            self.log_silence();
        }
        let limit = self.connection.silence_limit();
        if self.core.is_unresponsive(now, limit) {
            self.connection.close_silently();
            self.disconnected(effects, now);
        }
    }

    fn log_silence(&mut self) {
        let wire = self.core.wire_counters();
        self.silence_log.log(&self.connection.name(), wire);
    }

    fn disconnected(&mut self, effects: &mut impl PortEffects, now: HostTime) {
        effects.note(Event::Closed, &[], now);
        self.core.disconnected();
        effects.outgoing().clear();
    }

    /// Stops the device. [`Self::has_ended`] returns true after the device has stopped or the time
    /// limit has expired.
    pub(crate) fn end(&mut self, effects: &mut impl PortEffects) {
        self.core.set_streaming(false);
        self.core.tick(HostTime::now(), effects);
        self.deadline = Some(Instant::now() + DRAIN_TIMEOUT);
    }

    /// Returns whether [`Self::end`] was called.
    pub(crate) const fn is_ending(&self) -> bool {
        self.deadline.is_some()
    }

    /// Returns whether [`Self::end`] was called and the program need no longer wait for the device.
    pub(crate) fn has_ended(&self) -> bool {
        let is_done = !self.connection.is_open() || self.core.is_stopped();
        self.deadline.is_some_and(|deadline| is_done || Instant::now() >= deadline)
    }
}
