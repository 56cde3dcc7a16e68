//! Decides which command to the device is due, and when it must be repeated.

use link::{
    AckResult, ExclusionPolicy, FeatureFilters, ModelBegin, ModelReceived, Start, Streams, ToDevice,
};

use crate::wire::self_test::SelfTestState;
use crate::wire::upload::{Upload, Uploading};
use crate::wire::wanted::{ClockQuery, WantedStreams};
use crate::wire::words;

/// Time without a frame after which the device is pinged, microseconds. A working device sends
/// `Stats` every second.
const PING_AFTER_US: i64 = 2_000_000;
/// Time without a code, packed block, features or `Stats` after which a streaming device is asked
/// to identify itself again, microseconds. It may have restarted and its `Hello` may be lost, or
/// another program may have sent it `Stop`.
const STARVED_AFTER_US: i64 = 2_000_000;
/// Time between two calls of `next_command`, microseconds, above which the host must have been
/// suspended or this program stopped. What the device sent in this time is still unread, so the
/// time without frames is counted from 0 again.
const HOST_SUSPENDED_AFTER_US: i64 = 1_000_000;

/// Decides which command is due: first `Identify`, then `Stop` if a stream runs that this bridge
/// did not start, then clock queries if a recording goes on after a restart, then `Start`. Every
/// command but a clock query is repeated until the device acknowledges it.
#[derive(Clone, Debug)]
pub(crate) struct Commands {
    mains_hz: u8,
    /// Wanted rate of the packed code, 0 (finest) to 15 (coarsest); `None`: the device chooses.
    rate: Option<u8>,
    /// Rate in the newest `SetRate` that the device has answered, and the answer.
    answered_rate: Option<(u8, AckResult)>,
    /// The exclusion policy that the user wants.
    exclusion: ExclusionPolicy,
    /// The exclusion policy that the device has, according to its newest report or answer.
    known_exclusion: ExclusionPolicy,
    /// The exclusion policy that the device has refused, and the device's answer.
    refused_exclusion: Option<(ExclusionPolicy, AckResult)>,
    /// Filters of the classifier, whose weights are in `filter_weights`; `None` without one.
    filters: Option<FeatureFilters<'static>>,
    filter_weights: Vec<u8>,
    /// Id of the filters in the newest `SetFeatures` that the device has answered, with any result.
    answered_filters: Option<u32>,
    /// Whether the device must be asked to measure the impedance of the electrodes.
    impedance: ImpedanceState,
    /// A self-test that the user has asked for.
    pub(crate) self_test: SelfTestState,
    /// Upload of a model, which precedes the stream.
    upload: UploadState,
    /// Whether the device accepts a packed model; asked only if the caller requires it.
    slot: SlotState,
    /// Size in bytes of the model that is announced to find out whether the device has a slot.
    asked_bytes: u32,
    streams: WantedStreams,
    streaming_wanted: bool,
    device: Introduction,
    /// Whether this bridge has started every stream that may run on the device. Set when the device
    /// acknowledges a `Stop`, because only this bridge starts streams from then on. Cleared when
    /// the device restarts or another device is connected.
    owns_stream: bool,
    stream: StreamState,
    pending: Option<PendingCommand>,
    connected: bool,
    /// The newest `Start` that the device refused, if asking for fewer streams cannot help.
    refused_start: Option<RefusedStart>,
    last_frame_us: i64,
    /// Host time of the newest code, packed block, features or `Stats`, microseconds; before the
    /// first, host time of the stream's start. `None` while no stream is expected.
    last_stream_us: Option<i64>,
    last_identify_us: i64,
    clock_query: ClockQuery,
    last_tick_us: i64,
}

/// Whether the device has introduced itself since the port was opened, and with which result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Introduction {
    Missing,
    /// The device's codes can be published.
    Usable,
    Unusable,
}

/// Whether the device streams, according to its acknowledgements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum StreamState {
    Stopped,
    /// The device may stream: a `Start` is not acknowledged yet, or the port was reopened.
    Unconfirmed,
    Running,
}

/// Whether a model must be uploaded to the device before it streams.
#[derive(Clone, Debug)]
enum UploadState {
    NotDue,
    Underway(Uploading),
    /// The device has refused the model since its last restart.
    Refused,
}

/// Whether the device must be asked to measure the impedance of the electrodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ImpedanceState {
    NotWanted,
    /// The device is to be asked when it streams.
    Due,
    /// The device has answered since its stream began.
    Answered(AckResult),
}

/// Whether the device accepts a packed model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum SlotState {
    /// The device is not asked.
    NotRequired,
    Unknown,
    Exists,
    Missing,
}

/// What an acknowledgement means for the rest of the bridge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum AckEffect {
    NoChange,
    /// The device has acknowledged `Start`.
    Started,
    /// The device has acknowledged `Stop`.
    Stopped {
        /// Whether the device was stopped because the user wants no stream.
        by_user: bool,
    },
    /// The device has refused a command, for a reason other than `Busy` or `Failed`.
    Refused(ToDevice<'static>, AckResult),
}

impl Commands {
    /// Creates the state before the first connection, in which the user wants the device to stream.
    pub(crate) fn new(mains_hz: u8, streams: Streams, rate: Option<u8>) -> Commands {
        Commands {
            mains_hz,
            rate,
            answered_rate: None,
            exclusion: ExclusionPolicy::AUTOMATIC,
            known_exclusion: ExclusionPolicy::AUTOMATIC,
            refused_exclusion: None,
            filters: None,
            filter_weights: Vec::new(),
            answered_filters: None,
            impedance: ImpedanceState::NotWanted,
            self_test: SelfTestState::NotWanted,
            upload: UploadState::NotDue,
            slot: SlotState::NotRequired,
            asked_bytes: 0,
            streams: WantedStreams::new(streams),
            streaming_wanted: true,
            device: Introduction::Missing,
            owns_stream: false,
            stream: StreamState::Stopped,
            pending: None,
            connected: false,
            refused_start: None,
            last_frame_us: 0,
            last_stream_us: None,
            last_identify_us: 0,
            clock_query: ClockQuery::default(),
            last_tick_us: 0,
        }
    }

    /// Records that the port was opened at `now_us`. The device must identify itself again, and a
    /// stream that this bridge started earlier may still run.
    pub(crate) fn connected(&mut self, now_us: i64) {
        self.device = Introduction::Missing;
        self.stream = StreamState::Unconfirmed;
        self.pending = None;
        self.answered_rate = None;
        self.answered_filters = None;
        self.connected = true;
        self.ask_for_impedance_again();
        self.refused_start = None;
        self.last_frame_us = now_us;
        self.last_stream_us = None;
    }

    /// Records that the port was closed or lost. Until the next connection, no command is due.
    pub(crate) fn disconnected(&mut self) {
        self.self_test.interrupt("the connection was lost");
        self.device = Introduction::Missing;
        self.stream = StreamState::Stopped;
        self.pending = None;
        self.connected = false;
        self.last_stream_us = None;
    }

    pub(crate) fn set_streaming(&mut self, streaming: bool) {
        self.streaming_wanted = streaming;
    }

    /// Sets the rate of the packed code. [`Self::next_command`] then returns the command.
    pub(crate) fn set_rate(&mut self, rate: u8) {
        self.rate = Some(rate);
        self.answered_rate = None;
    }

    /// Sets which electrodes the device excludes. [`Self::next_command`] then returns the command.
    pub(crate) fn set_exclusion(&mut self, policy: ExclusionPolicy) {
        self.exclusion = policy;
    }

    /// Returns the device's answer to the wanted exclusion; `None` until it has answered.
    pub(crate) fn exclusion_answer(&self) -> Option<AckResult> {
        if self.known_exclusion == self.exclusion {
            return Some(AckResult::Done);
        }
        let refused = self.refused_exclusion;
        let (_, result) = refused.filter(|(policy, _)| *policy == self.exclusion)?;
        Some(result)
    }

    /// Returns the device's answer to the wanted rate; `None` until it has answered.
    pub(crate) fn rate_answer(&self) -> Option<AckResult> {
        let (_, result) = self.answered_rate.filter(|(rate, _)| Some(*rate) == self.rate)?;
        Some(result)
    }

    /// Sets the filters of the features; [`Self::next_command`] then returns the command.
    pub(crate) fn set_filters(&mut self, filters: FeatureFilters<'_>) {
        self.filter_weights = filters.weights.to_vec();
        self.filters = Some(FeatureFilters { weights: &[], ..filters });
        self.answered_filters = None;
    }

    /// Asks for the impedance of the electrodes. While the device streams, [`Self::next_command`]
    /// then returns the command.
    pub(crate) fn measure_impedance(&mut self) {
        self.impedance = ImpedanceState::Due;
    }

    /// Asks for events as the only stream. While it streams only events, every device can measure
    /// impedance.
    pub(crate) fn stream_events_alone(&mut self) {
        self.streams = WantedStreams::alone(Streams::EVENTS);
    }

    /// Asks for the impedance again, after the device has or may have ended the measurement.
    fn ask_for_impedance_again(&mut self) {
        if self.impedance != ImpedanceState::NotWanted {
            self.impedance = ImpedanceState::Due;
        }
    }

    /// Returns why the device refuses to measure the impedance; `None` if it does not.
    pub(crate) fn impedance_refusal(&self) -> Option<AckResult> {
        match self.impedance {
            ImpedanceState::Answered(result) if result != AckResult::Done => Some(result),
            _ => None,
        }
    }

    /// Records the policy that the device reports. Another program may have set it.
    pub(crate) fn exclusion_reported(&mut self, policy: ExclusionPolicy) {
        self.known_exclusion = policy;
    }

    /// Starts to upload this model. The device streams only when the upload has ended.
    pub(crate) fn start_upload(&mut self, upload: Upload) {
        self.upload = UploadState::Underway(Uploading::new(upload));
    }

    /// Records that no upload is due, because the device has the model or cannot accept it.
    pub(crate) fn end_upload(&mut self) {
        if !self.refuses_upload() {
            self.upload = UploadState::NotDue;
        }
    }

    /// Returns whether the device has refused the model since its last restart.
    pub(crate) fn refuses_upload(&self) -> bool {
        matches!(self.upload, UploadState::Refused)
    }

    /// Asks the device whether it accepts a packed model and, if `with_linear`, also a linear code.
    /// A device that does not accept them is not started.
    pub(crate) fn require_slot(&mut self, with_linear: bool) {
        self.slot = SlotState::Unknown;
        self.asked_bytes = if with_linear { u32::MAX } else { 0 };
    }

    /// Returns whether the device has answered that it does not accept the model that
    /// [`Self::require_slot`] asks for.
    pub(crate) fn lacks_slot(&self) -> bool {
        self.slot == SlotState::Missing
    }

    /// Records how much of the announced model the device reports to have.
    pub(crate) fn model_received(&mut self, received: ModelReceived) {
        if let UploadState::Underway(uploading) = &mut self.upload {
            uploading.record(received);
        }
    }

    /// Returns the uploaded part of the model, percent; `None` if no upload is under way.
    pub(crate) fn upload_percent(&self) -> Option<u64> {
        match &self.upload {
            UploadState::Underway(uploading) => Some(uploading.percent()),
            _ => None,
        }
    }

    /// Records that the device has introduced itself. `usable` states whether its codes can be
    /// published.
    pub(crate) fn device_introduced(&mut self, usable: bool) {
        self.device = if usable { Introduction::Usable } else { Introduction::Unusable };
    }

    /// Asks for clock queries before the next `Start`, which continues a recording.
    pub(crate) fn query_clock_before_start(&mut self) {
        self.clock_query.query_before_start();
    }

    /// Records that the device restarted or another device was connected. It must be identified and
    /// then stopped, because another program may have started its stream.
    pub(crate) fn device_restarted(&mut self) {
        self.device = Introduction::Missing;
        self.owns_stream = false;
        self.streams.ask_for_all();
        self.answered_rate = None;
        self.answered_filters = None;
        self.ask_for_impedance_again();
        self.known_exclusion = ExclusionPolicy::AUTOMATIC;
        self.refused_exclusion = None;
        self.self_test.interrupt("the device restarted");
        self.upload = UploadState::NotDue;
        if self.slot != SlotState::NotRequired {
            self.slot = SlotState::Unknown;
        }
        self.stream = StreamState::Unconfirmed;
        self.pending = None;
        self.refused_start = None;
        self.last_stream_us = None;
        self.clock_query = ClockQuery::default();
    }

    /// Asks the device to introduce itself again, because its frames contradict its introduction.
    pub(crate) fn identify_again(&mut self) {
        self.device = Introduction::Missing;
    }

    /// Records that a valid frame was read. Call this for every frame, so that the device does not
    /// count as unresponsive.
    pub(crate) fn frame_received(&mut self, now_us: i64) {
        self.last_frame_us = now_us;
    }

    /// Records that the stream runs. Call this for every code and packed block, for all features,
    /// and for every `Stats` that reports a running stream.
    pub(crate) fn stream_received(&mut self, now_us: i64) {
        self.last_stream_us = Some(now_us);
    }

    /// Records that the device reports no running stream, although this bridge did not stop it.
    pub(crate) fn device_stopped(&mut self) {
        self.ask_for_impedance_again();
        self.stream = StreamState::Stopped;
        self.last_stream_us = None;
    }

    /// Returns whether the device should be streaming, but has sent no codes, packed blocks or
    /// features, and no `Stats` with a running stream, for 2 s.
    pub(crate) fn is_starved(&self, now_us: i64) -> bool {
        let last_stream_us = self.last_stream_us.filter(|_| self.stream != StreamState::Stopped);
        last_stream_us.is_some_and(|last_stream_us| now_us - last_stream_us > STARVED_AFTER_US)
    }

    /// Returns the streams that `Start` asks the device for: what the user wants, less what the
    /// device refused.
    pub(crate) fn streams(&self) -> Streams {
        self.streams.asked()
    }

    /// Returns the streams that the user wants but the device refused.
    pub(crate) fn refused_streams(&self) -> Streams {
        self.streams.refused()
    }

    /// Returns why the device refuses to stream at all, and what the user can do; `None` if the
    /// device streams or was not asked.
    pub(crate) fn start_refusal(&self) -> Option<String> {
        let refused = self.refused_start.filter(|_| self.streaming_wanted)?;
        Some(words::refusal(&refused.command, refused.result))
    }

    /// Returns the host time of the newest clock query, microseconds; `None` if none was sent.
    pub(crate) fn clock_query_sent_us(&self) -> Option<i64> {
        self.clock_query.sent_us()
    }

    /// Returns whether the user wants the device to stream, and the bridge accepts the device.
    pub(crate) fn wants_stream(&self) -> bool {
        self.streaming_wanted && self.device != Introduction::Unusable
    }

    /// Returns whether the device's codes can be published. The device must have introduced itself
    /// since the port was opened, this bridge must have started its stream, and no upload may be
    /// under way.
    pub(crate) fn accepts_codes(&self) -> bool {
        let waits = matches!(self.upload, UploadState::Underway(_));
        self.device == Introduction::Usable && self.owns_stream && !waits
    }

    /// Returns whether the device has acknowledged `Start`, without a `Stop` or reconnection since.
    pub(crate) fn is_streaming(&self) -> bool {
        self.stream == StreamState::Running
    }

    /// Returns whether this bridge's stream runs on the device, or may run because a `Start` is not
    /// acknowledged yet.
    pub(crate) fn is_possibly_streaming(&self) -> bool {
        self.accepts_codes() && self.stream != StreamState::Stopped
    }

    /// Returns whether the user wants no stream and, according to the last acknowledgement, none is
    /// running.
    pub(crate) fn is_stopped(&self) -> bool {
        !self.streaming_wanted && self.stream == StreamState::Stopped
    }

    /// Returns whether the connected device has sent no frame for more than `limit_us`
    /// microseconds.
    pub(crate) fn is_unresponsive(&self, now_us: i64, limit_us: i64) -> bool {
        self.connected && now_us - self.last_frame_us > limit_us
    }

    /// Returns the command that is due at `now_us`, if any. The caller must send it in the frame
    /// with sequence number `seq`.
    pub(crate) fn next_command(&mut self, now_us: i64, seq: u32) -> Option<ToDevice<'_>> {
        if now_us - self.last_tick_us > HOST_SUSPENDED_AFTER_US {
            self.last_frame_us = now_us;
            self.last_stream_us = self.last_stream_us.map(|_| now_us);
        }
        self.last_tick_us = now_us;
        self.self_test.tick(now_us);
        if !self.connected {
            return None;
        }
        let Some(command) = self.required_command(now_us) else {
            return self.clock_query(now_us, seq);
        };
        let repeated = self.pending.filter(|pending| pending.command == command);
        if repeated.is_some_and(|pending| !pending.retry_is_due(now_us)) {
            return None;
        }
        if command == ToDevice::Identify {
            self.last_identify_us = now_us;
        }
        if matches!(command, ToDevice::Start(_)) {
            self.stream = StreamState::Unconfirmed;
        }
        self.pending = Some(PendingCommand::sent(repeated, command, seq, now_us));
        Some(match (&self.upload, command) {
            (_, ToDevice::SetFeatures(filters)) => {
                ToDevice::SetFeatures(FeatureFilters { weights: &self.filter_weights, ..filters })
            }
            (UploadState::Underway(uploading), command) => uploading.with_bytes(command),
            (_, command) => command,
        })
    }

    fn required_command(&self, now_us: i64) -> Option<ToDevice<'static>> {
        if self.device == Introduction::Missing {
            return Some(ToDevice::Identify);
        }
        let since_identify_us = now_us - self.last_identify_us;
        let is_recent = |refused: RefusedStart| now_us < refused.refused_us + REFUSED_RETRY_US;
        let refused = self.refused_start.is_some_and(is_recent);
        match (self.wants_stream() && !self.lacks_slot(), self.stream) {
            (true, StreamState::Stopped | StreamState::Unconfirmed) if !self.owns_stream => {
                Some(ToDevice::Stop)
            }
            (true, _) if let UploadState::Underway(uploading) = &self.upload => {
                Some(uploading.command())
            }
            // Every device refuses a model of this size and keeps its own. The reason reveals
            // whether the device has a slot and, if the announced size is the largest, whether it
            // accepts a linear code.
            (true, _) if self.slot == SlotState::Unknown => {
                Some(ToDevice::ModelBegin(ModelBegin {
                    bytes: self.asked_bytes,
                    ..ModelBegin::default()
                }))
            }
            (true, _) if let Some(rate) = self.due_rate() => Some(ToDevice::SetRate { rate }),
            (true, _) if self.exclusion_answer().is_none() => {
                Some(ToDevice::SetExclusion(self.exclusion))
            }
            (true, _) if let Some(filters) = self.due_filters() => {
                Some(ToDevice::SetFeatures(filters))
            }
            (true, StreamState::Stopped) if self.clock_query.precedes_start(now_us) => None,
            (true, StreamState::Stopped | StreamState::Unconfirmed) if !refused => {
                Some(ToDevice::Start(Start {
                    streams: self.streams.asked(),
                    mains_hz: self.mains_hz,
                }))
            }
            (false, StreamState::Unconfirmed | StreamState::Running) => Some(ToDevice::Stop),
            (false, StreamState::Stopped) if let Some(command) = self.self_test.command() => {
                Some(command)
            }
            // Ask only after `Start`: a device that cannot do both then refuses the measurement,
            // not the stream.
            (true, StreamState::Running) if self.impedance == ImpedanceState::Due => {
                Some(ToDevice::SetImpedance { on: true })
            }
            (true, StreamState::Running)
                if self.is_starved(now_us) && since_identify_us < RETRY_US =>
            {
                None
            }
            (true, StreamState::Running)
                if self.is_starved(now_us) && since_identify_us > STARVED_AFTER_US =>
            {
                Some(ToDevice::Identify)
            }
            _ => (now_us - self.last_frame_us > PING_AFTER_US).then_some(ToDevice::Ping),
        }
    }

    /// Returns the rate of the packed code, if it must be set on the device now.
    fn due_rate(&self) -> Option<u8> {
        let has_packed = self.streams.asked().contains(Streams::PACKED);
        let is_due = |rate: &u8| {
            has_packed && self.answered_rate.map(|(answered, _)| answered) != Some(*rate)
        };
        self.rate.filter(is_due)
    }

    /// Returns the filters of the features, if they must be sent to the device now.
    fn due_filters(&self) -> Option<FeatureFilters<'static>> {
        let is_asked = self.streams.asked().contains(Streams::FEATURES);
        let is_due = |filters: &FeatureFilters| self.answered_filters != Some(filters.id);
        self.filters.filter(|filters| is_asked && is_due(filters))
    }

    /// Returns the clock query if it is due: before a stream that continues a recording starts, and
    /// while codes arrive, because the answer is then compared with the clock's fit.
    fn clock_query(&mut self, now_us: i64, seq: u32) -> Option<ToDevice<'static>> {
        if self.wants_stream() && self.stream == StreamState::Stopped {
            return self.clock_query.next_before_start(now_us, seq);
        }
        let last_us = self.last_stream_us?;
        let codes_arrive = now_us - last_us < RETRY_US && self.stream == StreamState::Running;
        codes_arrive.then(|| self.clock_query.next(now_us, seq))?
    }

    /// Handles the acknowledgement of the command in the frame with sequence number `of`.
    pub(crate) fn handle_ack(&mut self, of: u32, result: AckResult, now_us: i64) -> AckEffect {
        if self.clock_query.handle_ack(of, result) {
            return AckEffect::NoChange;
        }
        let Some(pending) = self.pending.filter(|pending| pending.is_acknowledged_by(of)) else {
            return AckEffect::NoChange;
        };
        if is_upload(&pending.command) {
            return self.handle_upload(pending.command, result);
        }
        match (pending.command, result) {
            (ToDevice::SelfTest, result) => {
                self.pending = None;
                self.self_test.acknowledge(result, now_us);
                return AckEffect::NoChange;
            }
            // A device that cannot measure while these streams run is not asked again.
            (ToDevice::SetImpedance { .. }, AckResult::Busy) => {
                self.impedance = ImpedanceState::Answered(result);
                self.pending = None;
            }
            (_, AckResult::Busy | AckResult::Failed) => return AckEffect::NoChange,
            (ToDevice::Start(_), AckResult::Done) => {
                self.pending = None;
                self.stream = StreamState::Running;
                self.refused_start = None;
                self.last_stream_us.get_or_insert(now_us);
                self.clock_query.start(now_us);
                return AckEffect::Started;
            }
            (ToDevice::Stop, result) => {
                self.pending = None;
                self.owns_stream = true;
                self.ask_for_impedance_again();
                self.stream = StreamState::Stopped;
                self.last_stream_us = None;
                if result == AckResult::Done {
                    return AckEffect::Stopped { by_user: !self.streaming_wanted };
                }
            }
            (ToDevice::Start(_), result) => {
                self.pending = None;
                if result == AckResult::BadArgument && self.streams.ask_for_fewer() {
                    return AckEffect::NoChange;
                }
                self.streams.ask_for_all();
                self.refused_start =
                    Some(RefusedStart { command: pending.command, result, refused_us: now_us });
            }
            (ToDevice::SetRate { rate }, result) => {
                self.answered_rate = Some((rate, result));
                self.pending = None;
            }
            (ToDevice::SetExclusion(policy), result) => {
                if result == AckResult::Done {
                    self.known_exclusion = policy;
                } else {
                    self.refused_exclusion = Some((policy, result));
                }
                self.pending = None;
            }
            (ToDevice::SetImpedance { .. }, result) => {
                self.impedance = ImpedanceState::Answered(result);
                self.pending = None;
            }
            (ToDevice::SetFeatures(filters), _) => {
                self.answered_filters = Some(filters.id);
                self.pending = None;
            }
            // The device did not restart, so another program may have stopped its stream. If the
            // stream still runs after all, the `Start` that follows changes nothing.
            (ToDevice::Identify, _) if self.is_starved(now_us) => {
                self.stream = StreamState::Unconfirmed;
            }
            (ToDevice::Identify, _) => {}
            (
                ToDevice::Ping
                | ToDevice::SyncTime { .. }
                | ToDevice::Reset(_)
                | ToDevice::ModelBegin(_)
                | ToDevice::ModelChunk(_)
                | ToDevice::ModelEnd,
                _,
            ) => self.pending = None,
        }
        match result {
            AckResult::Done => AckEffect::NoChange,
            result => AckEffect::Refused(pending.command, result),
        }
    }

    /// Handles the acknowledgement of a command of the upload.
    fn handle_upload(&mut self, command: ToDevice<'static>, result: AckResult) -> AckEffect {
        let UploadState::Underway(uploading) = &mut self.upload else {
            self.pending = None;
            if self.slot == SlotState::Unknown {
                self.slot = match result {
                    AckResult::NotSupported | AckResult::UnknownCommand => SlotState::Missing,
                    _ => SlotState::Exists,
                };
            }
            return AckEffect::NoChange;
        };
        match result {
            AckResult::Done => {
                self.pending = None;
                // Ask for an introduction: the one that the device sends unasked may be lost.
                if command == ToDevice::ModelEnd {
                    self.device = Introduction::Missing;
                }
                AckEffect::NoChange
            }
            // Another program has started a stream, which must be stopped first.
            AckResult::Busy => {
                self.owns_stream = false;
                self.stream = StreamState::Unconfirmed;
                AckEffect::NoChange
            }
            result => {
                self.pending = None;
                if !uploading.handle_refusal(&command, result) {
                    return AckEffect::NoChange;
                }
                self.upload = UploadState::Refused;
                self.device = Introduction::Missing;
                AckEffect::Refused(command, result)
            }
        }
    }
}

fn is_upload(command: &ToDevice) -> bool {
    use ToDevice::{ModelBegin, ModelChunk, ModelEnd};
    matches!(command, ModelBegin(_) | ModelChunk(_) | ModelEnd)
}

/// Time after which a command without an acknowledgement is sent again, microseconds.
pub(crate) const RETRY_US: i64 = 500_000;

/// A command that is not acknowledged yet, and the sequence numbers of the first and last frame
/// that carried it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PendingCommand {
    command: ToDevice<'static>,
    /// Sequence number of the first frame that carried the command.
    first_seq: u32,
    /// Sequence number of the last frame that carried the command.
    last_seq: u32,
    /// Host time at which the command was last sent, microseconds.
    sent_us: i64,
}

impl PendingCommand {
    /// Records that the frame with number `seq` carried `command` at the host time `now_us`.
    /// `before` is the pending command if this is a repetition of it.
    pub(crate) fn sent(
        before: Option<PendingCommand>,
        command: ToDevice<'static>,
        seq: u32,
        now_us: i64,
    ) -> PendingCommand {
        PendingCommand {
            command,
            first_seq: before.map_or(seq, |before| before.first_seq),
            last_seq: seq,
            sent_us: now_us,
        }
    }

    /// Returns whether the command must be sent again at `now_us`, because it has been without an
    /// acknowledgement for [`RETRY_US`].
    pub(crate) fn retry_is_due(&self, now_us: i64) -> bool {
        now_us >= self.sent_us + RETRY_US
    }

    /// Returns whether more than one frame has carried the command.
    pub(crate) fn was_sent_again(&self) -> bool {
        self.first_seq != self.last_seq
    }

    /// Returns whether the frame number `of` in an acknowledgement belongs to any transmission of
    /// this command, even if the sequence number has wrapped.
    pub(crate) fn is_acknowledged_by(&self, of: u32) -> bool {
        of.wrapping_sub(self.first_seq) <= self.last_seq.wrapping_sub(self.first_seq)
    }
}

/// Time after which a refused `Start` is sent again, microseconds.
const REFUSED_RETRY_US: i64 = 10_000_000;

/// A refused `Start` for which asking for fewer streams cannot help.
#[derive(Clone, Copy, Debug)]
struct RefusedStart {
    command: ToDevice<'static>,
    result: AckResult,
    /// Host time at which the refusal arrived, microseconds.
    refused_us: i64,
}
