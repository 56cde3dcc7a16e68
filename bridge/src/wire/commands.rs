//! What the bridge asks of the device, and when it asks again.

use link::{AckResult, Start, Streams, ToDevice};

/// How long an answer may take before the command is sent again, microseconds.
const RETRY_US: i64 = 500_000;
/// After a refusal that will not go away by itself, microseconds.
const REFUSED_RETRY_US: i64 = 10_000_000;
/// Silence after which the device is pinged, microseconds; `Stats` comes every second.
const PING_AFTER_US: i64 = 2_000_000;
/// Silence after which the port is taken for dead, microseconds; pings were sent meanwhile.
const UNRESPONSIVE_AFTER_US: i64 = 5_000_000;
/// Time without a code or `Stats` after which a device that streams is asked who it is,
/// microseconds: it may have been reset and its `Hello` lost, or stopped by someone else.
const STARVED_AFTER_US: i64 = 2_000_000;

/// Time between two looks at the clock from which on it was the host that was silent: it slept, or
/// this program was stopped. What the device said meanwhile waits to be read.
const HOST_SUSPENDED_AFTER_US: i64 = 1_000_000;
/// How long after the start of a stream the device's clock is first asked for, microseconds: codes
/// come by then.
const FIRST_CLOCK_QUERY_US: i64 = 2_000_000;
/// How often it is asked for then, microseconds.
const CLOCK_QUERY_INTERVAL_US: i64 = 10_000_000;

/// What the bridge asks of the device: to say who it is, to stop what it may have been doing
/// before the bridge came, to start. Every command is repeated until it is acknowledged.
#[derive(Clone, Debug)]
pub(crate) struct Commands {
    mains_hz: u8,
    /// What shall stream.
    wanted_streams: Streams,
    /// What the device is asked for: less than that, after it refused.
    streams: Streams,
    streaming_wanted: bool,
    device: Introduction,
    /// What the device streams, if anything, was begun by this bridge: it was stopped or reset
    /// since it is known.
    owns_stream: bool,
    stream: StreamState,
    pending: Option<Pending>,
    connected: bool,
    /// A refused `Start` is not sent again before.
    start_not_before_us: i64,
    last_frame_us: i64,
    /// When the newest code or `Stats` came, or the stream began; `None` while none is due.
    last_stream_us: Option<i64>,
    /// When a starved device was last asked who it is.
    last_identify_us: i64,
    clock_query: ClockQuery,
    last_tick_us: i64,
}

/// What is known about the device since the port was opened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Introduction {
    Missing,
    Usable,
    /// Its codes cannot be published.
    Unusable,
}

/// Whether the device streams.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum StreamState {
    Stopped,
    /// It was asked to, or was streaming when it was last heard of.
    Unconfirmed,
    Running,
}

/// The question for the device's clock, which is not repeated: the next one is as good.
#[derive(Clone, Copy, Debug, Default)]
struct ClockQuery {
    /// When it is due; none while nothing streams.
    due_us: Option<i64>,
    /// Number and host time of the newest one.
    sent: Option<(u32, i64)>,
    /// The device does not know it.
    refused: bool,
}

/// A command that has no answer yet.
#[derive(Clone, Copy, Debug)]
struct Pending {
    command: ToDevice,
    first_seq: u32,
    last_seq: u32,
    sent_us: i64,
}

/// What an acknowledgement means to the rest of the bridge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum AckEffect {
    /// Nothing that anyone needs to know.
    NoChange,
    /// The stream begins now.
    Started,
    /// The stream has ended.
    Stopped,
    /// The device will not do it.
    Refused(ToDevice, AckResult),
}

impl Commands {
    /// Nothing is connected yet; streaming is streaming_wanted.
    pub(crate) fn new(mains_hz: u8, streams: Streams) -> Commands {
        let streams = streams | Streams::CODES;
        Commands {
            mains_hz,
            wanted_streams: streams,
            streams,
            streaming_wanted: true,
            device: Introduction::Missing,
            owns_stream: false,
            stream: StreamState::Stopped,
            pending: None,
            connected: false,
            start_not_before_us: 0,
            last_frame_us: 0,
            last_stream_us: None,
            last_identify_us: 0,
            clock_query: ClockQuery::default(),
            last_tick_us: 0,
        }
    }

    /// A port was opened: ask who is there. A stream that was ours may still be running.
    pub(crate) fn connected(&mut self, now_us: i64) {
        self.device = Introduction::Missing;
        self.stream = StreamState::Unconfirmed;
        self.pending = None;
        self.connected = true;
        self.start_not_before_us = now_us;
        self.last_frame_us = now_us;
        self.last_stream_us = None;
    }

    /// The port has gone: there is nobody to ask.
    pub(crate) fn disconnected(&mut self) {
        self.device = Introduction::Missing;
        self.stream = StreamState::Stopped;
        self.pending = None;
        self.connected = false;
        self.last_stream_us = None;
    }

    /// Streaming is streaming_wanted, or not.
    pub(crate) fn set_streaming(&mut self, streaming: bool) {
        self.streaming_wanted = streaming;
    }

    /// The device introduced itself; `usable` if its codes can be published.
    pub(crate) fn device_introduced(&mut self, usable: bool) {
        self.device = if usable {
            Introduction::Usable
        } else {
            Introduction::Unusable
        };
    }

    /// Another boot, or another device: who it is must be asked, and what it may be streaming,
    /// since it may have been started by someone else, stopped.
    pub(crate) fn device_restarted(&mut self) {
        self.device = Introduction::Missing;
        self.owns_stream = false;
        self.streams = self.wanted_streams;
        self.stream = StreamState::Unconfirmed;
        self.pending = None;
        self.start_not_before_us = 0;
        self.last_stream_us = None;
        self.clock_query = ClockQuery::default();
    }

    /// Ask again who is there: the frames do not fit what is known.
    pub(crate) fn identify_again(&mut self) {
        self.device = Introduction::Missing;
    }

    /// A sound frame came.
    pub(crate) fn frame_received(&mut self, now_us: i64) {
        self.last_frame_us = now_us;
    }

    /// A code came, or `Stats` of a running stream.
    pub(crate) fn stream_received(&mut self, now_us: i64) {
        self.last_stream_us = Some(now_us);
    }

    /// The device says by itself that it does not stream.
    pub(crate) fn device_stopped(&mut self) {
        self.stream = StreamState::Stopped;
        self.last_stream_us = None;
    }

    /// Whether the device should be streaming, answers perhaps, and sends nothing of a stream.
    pub(crate) fn is_starved(&self, now_us: i64) -> bool {
        let last_stream_us = self
            .last_stream_us
            .filter(|_| self.stream != StreamState::Stopped);
        last_stream_us.is_some_and(|last_stream_us| now_us - last_stream_us > STARVED_AFTER_US)
    }

    /// What the device is asked to stream: what is streaming_wanted, or what an older one has left of it.
    pub(crate) fn streams(&self) -> Streams {
        self.streams
    }

    /// What the device refuses to stream.
    pub(crate) fn refused_streams(&self) -> Streams {
        Streams::from_bits(self.wanted_streams.bits() & !self.streams.bits())
    }

    /// When the device's clock was asked for last, microseconds of the host's.
    pub(crate) fn clock_query_sent_us(&self) -> Option<i64> {
        self.clock_query.sent.map(|(_, host_us)| host_us)
    }

    /// Whether streaming is streaming_wanted.
    pub(crate) fn wants_stream(&self) -> bool {
        self.streaming_wanted && self.device != Introduction::Unusable
    }

    /// Whether the device introduced itself since the port was opened, and what it streams was
    /// begun by this bridge.
    pub(crate) fn accepts_codes(&self) -> bool {
        self.device == Introduction::Usable && self.owns_stream
    }

    /// Whether a start was acknowledged and no stop since.
    pub(crate) fn is_streaming(&self) -> bool {
        self.stream == StreamState::Running
    }

    /// Whether the device may be streaming for this bridge.
    pub(crate) fn is_possibly_streaming(&self) -> bool {
        self.accepts_codes() && self.stream != StreamState::Stopped
    }

    /// Whether the device has stopped as streaming_wanted, or there is nothing to stop.
    pub(crate) fn is_stopped(&self) -> bool {
        !self.streaming_wanted && self.stream == StreamState::Stopped
    }

    /// Whether the port has been silent for so long that it is dead.
    pub(crate) fn is_unresponsive(&self, now_us: i64) -> bool {
        self.connected && now_us - self.last_frame_us > UNRESPONSIVE_AFTER_US
    }

    /// The command that is due now, if any; it goes out with `seq`.
    pub(crate) fn next_command(&mut self, now_us: i64, seq: u32) -> Option<ToDevice> {
        if now_us - self.last_tick_us > HOST_SUSPENDED_AFTER_US {
            self.last_frame_us = now_us;
            self.last_stream_us = self.last_stream_us.map(|_| now_us);
        }
        self.last_tick_us = now_us;
        if !self.connected {
            return None;
        }
        let Some(command) = self.required_command(now_us) else {
            return self.clock_query(now_us, seq);
        };
        let repeated = self.pending.filter(|pending| pending.command == command);
        if repeated.is_some_and(|pending| now_us < pending.sent_us + RETRY_US) {
            return None;
        }
        if command == ToDevice::Identify {
            self.last_identify_us = now_us;
        }
        if matches!(command, ToDevice::Start(_)) {
            self.stream = StreamState::Unconfirmed;
        }
        let first_seq = repeated.map_or(seq, |pending| pending.first_seq);
        self.pending = Some(Pending {
            command,
            first_seq,
            last_seq: seq,
            sent_us: now_us,
        });
        Some(command)
    }

    fn required_command(&self, now_us: i64) -> Option<ToDevice> {
        if self.device == Introduction::Missing {
            return Some(ToDevice::Identify);
        }
        let since_asked_us = now_us - self.last_identify_us;
        let refused = now_us < self.start_not_before_us;
        match (self.wants_stream(), self.stream) {
            (true, StreamState::Stopped | StreamState::Unconfirmed) if !self.owns_stream => {
                Some(ToDevice::Stop)
            }
            (true, StreamState::Stopped | StreamState::Unconfirmed) if !refused => {
                Some(ToDevice::Start(Start {
                    streams: self.streams,
                    mains_hz: self.mains_hz,
                }))
            }
            (false, StreamState::Unconfirmed | StreamState::Running) => Some(ToDevice::Stop),
            (true, StreamState::Running)
                if self.is_starved(now_us) && since_asked_us < RETRY_US =>
            {
                None
            }
            (true, StreamState::Running)
                if self.is_starved(now_us) && since_asked_us > STARVED_AFTER_US =>
            {
                Some(ToDevice::Identify)
            }
            _ => (now_us - self.last_frame_us > PING_AFTER_US).then_some(ToDevice::Ping),
        }
    }

    /// The question for the device's clock, when it is due; one that says nothing is not asked.
    fn clock_query(&mut self, now_us: i64, seq: u32) -> Option<ToDevice> {
        let due = self
            .clock_query
            .due_us
            .is_some_and(|due_us| now_us >= due_us);
        let fed = self
            .last_stream_us
            .is_some_and(|last_stream_us| now_us - last_stream_us < RETRY_US);
        if !due || !fed || self.clock_query.refused || self.stream != StreamState::Running {
            return None;
        }
        self.clock_query.due_us = Some(now_us + CLOCK_QUERY_INTERVAL_US);
        self.clock_query.sent = Some((seq, now_us));
        let host_time_us = now_us.unsigned_abs();
        Some(ToDevice::SyncTime { host_time_us })
    }

    /// What to ask for after the device refused to stream what was asked for: raw samples are too
    /// much for a UART, and firmware from before 0.2 knows codes alone.
    fn fewer_streams(&self) -> Option<Streams> {
        let removable = [Streams::RAW, Streams::FILTERED];
        let removable = removable
            .into_iter()
            .find(|stream| self.streams.contains(*stream));
        match removable {
            Some(stream) => Some(self.streams.without(stream)),
            None if self.streams == Streams::CODES => None,
            None => Some(Streams::CODES),
        }
    }

    /// The device acknowledged the command with number `of`.
    pub(crate) fn handle_ack(&mut self, of: u32, result: AckResult, now_us: i64) -> AckEffect {
        if self.clock_query.sent.is_some_and(|(seq, _)| seq == of) {
            self.clock_query.refused |= !matches!(result, AckResult::Done | AckResult::Busy);
            return AckEffect::NoChange;
        }
        let ours = |pending: &Pending| {
            of.wrapping_sub(pending.first_seq) <= pending.last_seq.wrapping_sub(pending.first_seq)
        };
        let Some(pending) = self.pending.filter(ours) else {
            return AckEffect::NoChange;
        };
        match (pending.command, result) {
            (_, AckResult::Busy | AckResult::Failed) => return AckEffect::NoChange,
            (ToDevice::Start(_), AckResult::Done) => {
                self.pending = None;
                self.stream = StreamState::Running;
                self.last_stream_us.get_or_insert(now_us);
                self.clock_query
                    .due_us
                    .get_or_insert(now_us + FIRST_CLOCK_QUERY_US);
                return AckEffect::Started;
            }
            (ToDevice::Stop, result) => {
                self.pending = None;
                self.owns_stream = true;
                self.stream = StreamState::Stopped;
                self.last_stream_us = None;
                if result == AckResult::Done {
                    return AckEffect::Stopped;
                }
            }
            (ToDevice::Start(_), AckResult::BadArgument) if self.fewer_streams().is_some() => {
                self.streams = self.fewer_streams().unwrap_or(Streams::CODES);
                self.pending = None;
                return AckEffect::NoChange;
            }
            (ToDevice::Start(_), _) => {
                self.start_not_before_us = now_us + REFUSED_RETRY_US;
                self.pending = None;
            }
            // The same boot of the same device: someone else may have stopped it. A start changes
            // nothing if it streams after all.
            (ToDevice::Identify, _) if self.is_starved(now_us) => {
                self.stream = StreamState::Unconfirmed
            }
            (ToDevice::Identify, _) => {}
            (
                ToDevice::Ping
                | ToDevice::SelfTest
                | ToDevice::SyncTime { .. }
                | ToDevice::Reset(_),
                _,
            ) => self.pending = None,
        }
        match result {
            AckResult::Done => AckEffect::NoChange,
            result => AckEffect::Refused(pending.command, result),
        }
    }
}
