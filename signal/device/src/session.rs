//! The device's side of the protocol with the host.

use link::{
    Ack, AckResult, ClockReading, Converters, Counters, Decoder, FrameError, Hello, ResetInto,
    SelfTest, Start, Stats, Streams, Substitutes, Timing, ToDevice, ToHost,
};
use pipeline::{Code, FeatureFilters, Mains, Rate};

use crate::acquired_sample::Counts;
use crate::board::{Abilities, Identity, Order, Run};
use crate::impedance::{HAS_IMPEDANCE, spoils};
use crate::message;
use crate::model_slot::{CodeScales, Slot, UploadOutcome, UploadedModel};
use crate::producer::{Output, Payload};
use crate::sender::{FrameQueue, MAX_FRAME, Sender};

/// Answers the host's commands and sends the producer's outputs as messages.
///
/// Messages are built on the stack and take up to 2 KB.
#[derive(Debug)]
pub struct Session<'i> {
    identity: Identity<'i>,
    abilities: Abilities,
    /// The active run; after a `Stop`, the last run with its streams cleared.
    run: Run,
    /// False if the model is damaged; every `Start` is then refused.
    can_stream: bool,
    /// Electrodes that the recording lacks, interpolated or zero; none if the device measures
    /// instead of playing a recording.
    substitutes: Substitutes,
    /// Newest status of the converters; `None` before the first status.
    converters: Option<Converters>,
    /// True from the moment a self-test is ordered until its result is sent.
    is_testing: bool,
    /// True while the impedance of the electrodes is measured: from the command that starts the
    /// measurement until the next `Stop`.
    measures_impedance: bool,
    /// The uploaded model; `None` while the device uses the built-in one.
    uploaded: Option<UploadedModel>,
    /// Filters that the host has set and [`Self::take_filters`] has not returned yet.
    filters: Option<FeatureFilters>,
    decoder: Decoder<MAX_FRAME>,
    /// Counters that the session itself counts; [`Self::stats`] adds the counters of acquisition,
    /// sender and decoder.
    stats: Stats,
}

impl<'i> Session<'i> {
    /// Creates the session of a device that has just started; call [`Self::introduce`] before any
    /// other method that sends messages.
    pub fn new(identity: Identity<'i>, abilities: Abilities, mains: Mains) -> Self {
        Self {
            identity,
            abilities,
            run: Run { mains, ..Run::NONE },
            can_stream: true,
            substitutes: Substitutes::NONE,
            converters: None,
            is_testing: false,
            measures_impedance: false,
            uploaded: None,
            filters: None,
            decoder: Decoder::new(),
            stats: Stats::default(),
        }
    }

    /// Sets the electrodes that have substitute samples, for a device that plays a recording.
    #[must_use]
    pub fn with_substitutes(mut self, substitutes: Substitutes) -> Self {
        self.substitutes = substitutes;
        self
    }

    /// Refuses every `Start` from now on. Call this if the model is damaged, and report the damage
    /// in [`Identity::fault`].
    pub fn refuse_starts(&mut self) {
        self.can_stream = false;
    }

    /// Returns true between a `Start` and the next `Stop`.
    pub const fn is_streaming(&self) -> bool {
        !self.run.streams.is_empty()
    }

    fn is_current_run(&self, run: u32) -> bool {
        self.is_streaming() && run == self.run.number
    }

    fn model_id(&self) -> [u8; 8] {
        self.uploaded.map_or(model::MODEL_ID, |model| model.id)
    }

    /// Returns the streams that a `Start` can request: the board's streams, without codes and
    /// audits if a host with the uploaded model could not decode the codes.
    fn streams(&self) -> Streams {
        match self.uploaded {
            Some(UploadedModel { code_scales: None, .. }) => {
                (self.abilities.streams).without(Streams::CODES | Streams::AUDIT)
            }
            _ => self.abilities.streams,
        }
    }

    /// Sends `Hello`, `Substitutes` if there are any, `Capabilities` and, if known, `Converters`.
    pub fn introduce(&self, now_us: u64, sender: &mut Sender<impl FrameQueue>) {
        let hello = Hello {
            firmware: self.identity.firmware,
            board: self.identity.board,
            chip_uid: self.identity.chip_uid,
            model_id: self.model_id(),
            session_id: self.identity.session_id,
            reset_cause: self.identity.reset_cause,
            fault: self.identity.fault,
        };
        sender.send(now_us, &ToHost::Hello(hello));
        if self.substitutes != Substitutes::NONE {
            sender.send(now_us, &ToHost::Substitutes(self.substitutes));
        }
        self.send_capabilities(now_us, sender);
        self.send_converters(now_us, sender);
    }

    /// Decodes bytes from the host and answers each command that they complete. An uploaded model
    /// goes to `slot`. If a command requires an action of the board, `order` is called before the
    /// command's `Ack` is queued.
    pub fn receive(
        &mut self,
        mut bytes: &[u8],
        now_us: u64,
        counts: Counts,
        slot: &mut impl Slot,
        sender: &mut Sender<impl FrameQueue>,
        mut order: impl FnMut(Order),
    ) {
        while let Some(outcome) = self.decoder.next::<ToDevice<'_>>(&mut bytes) {
            let (of, result) = match outcome {
                Ok(frame) => {
                    self.stats.commands = self.stats.commands.wrapping_add(1);
                    let seq = frame.header.seq;
                    let is_streaming = !self.run.streams.is_empty();
                    let upload = upload(&frame.message, self.abilities.streams, is_streaming, slot);
                    let filters = filters(&frame.message);
                    let command = frame.message.without_bytes();
                    let result = match &upload {
                        Some(Ok(outcome)) => self.answer_upload(outcome, now_us, sender),
                        Some(Err(refusal)) => *refusal,
                        None if filters.is_some() => {
                            self.filters = filters;
                            AckResult::Done
                        }
                        None => {
                            let (result, effect) = self.execute(command, now_us, counts, sender);
                            effect.into_iter().for_each(&mut order);
                            result
                        }
                    };
                    (seq, result)
                }
                Err(FrameError::Unknown { header, .. }) => (header.seq, AckResult::UnknownCommand),
                // An unusable frame has no `seq` to acknowledge; the decoder has counted it.
                Err(_) => continue,
            };
            sender.send(now_us, &ToHost::Ack(Ack { of, result }));
        }
    }

    /// Returns the filters that the host has set since the last call, for
    /// [`Producer::set_filters`](crate::Producer::set_filters). Call this after [`Self::receive`].
    /// Filters are not an [`Order`], because they take 600 bytes.
    pub fn take_filters(&mut self) -> Option<FeatureFilters> {
        self.filters.take()
    }

    fn execute(
        &mut self,
        command: ToDevice<'_>,
        now_us: u64,
        counts: Counts,
        sender: &mut Sender<impl FrameQueue>,
    ) -> (AckResult, Option<Order>) {
        match command {
            ToDevice::Start(start) => return self.start(start, now_us, sender),
            ToDevice::Stop => return self.stop(now_us, counts, sender),
            ToDevice::Identify => self.introduce(now_us, sender),
            ToDevice::Ping => {}
            ToDevice::SelfTest => return self.start_self_test(),
            ToDevice::SyncTime { .. } if !self.abilities.clock => {
                return (AckResult::NotSupported, None);
            }
            ToDevice::SyncTime { host_time_us } => {
                let reading = ClockReading { host_time_us, received_us: now_us };
                sender.send(now_us, &ToHost::ClockReading(reading));
            }
            ToDevice::Reset(into) => return self.reset(into),
            ToDevice::SetRate { rate } => return self.set_rate(rate),
            // `receive` has already handled filters in range, so these are out of range.
            ToDevice::SetFeatures(_) => return (AckResult::BadArgument, None),
            ToDevice::SetImpedance { on } => return self.set_impedance(on),
            ToDevice::SetExclusion(_) if model::SUBSTITUTION.is_none() => {
                return (AckResult::NotSupported, None);
            }
            ToDevice::SetExclusion(policy) => {
                return (AckResult::Done, Some(Order::SetExclusion(policy)));
            }
            ToDevice::ModelBegin(_) | ToDevice::ModelChunk(_) | ToDevice::ModelEnd => {
                return (AckResult::NotSupported, None);
            }
        }
        (AckResult::Done, None)
    }

    /// Sends `ModelReceived` for a command of an upload and returns the result for its `Ack`. If
    /// the model in use has changed, first calls [`Self::introduce`], so that the host learns of
    /// the change.
    fn answer_upload(
        &mut self,
        outcome: &UploadOutcome,
        now_us: u64,
        sender: &mut Sender<impl FrameQueue>,
    ) -> AckResult {
        sender.send(now_us, &ToHost::ModelReceived(outcome.received));
        if self.uploaded != outcome.model {
            self.uploaded = outcome.model;
            self.introduce(now_us, sender);
        }
        outcome.result
    }

    fn stop(
        &mut self,
        now_us: u64,
        counts: Counts,
        sender: &mut Sender<impl FrameQueue>,
    ) -> (AckResult, Option<Order>) {
        // Without an active run no `Order::Stop` is needed, and it would replace an order that the
        // acquisition has not executed yet.
        let order = if self.is_streaming() {
            Some(Order::Stop)
        } else {
            (HAS_IMPEDANCE && self.measures_impedance).then_some(Order::SetImpedance(false))
        };
        self.measures_impedance = false;
        self.run.streams = Streams::empty();
        self.send_stats(now_us, counts, sender);
        (AckResult::Done, order)
    }

    fn start_self_test(&mut self) -> (AckResult, Option<Order>) {
        if !self.abilities.self_test {
            return (AckResult::NotSupported, None);
        }
        if self.is_testing || self.is_streaming() {
            return (AckResult::Busy, None);
        }
        self.is_testing = true;
        (AckResult::Done, Some(Order::SelfTest))
    }

    fn set_rate(&self, rate: u8) -> (AckResult, Option<Order>) {
        if !self.abilities.streams.contains(Streams::PACKED) {
            return (AckResult::NotSupported, None);
        }
        match Rate::new(rate) {
            Some(rate) => (AckResult::Done, Some(Order::SetRate(rate))),
            None => (AckResult::BadArgument, None),
        }
    }

    fn set_impedance(&mut self, on: bool) -> (AckResult, Option<Order>) {
        if !HAS_IMPEDANCE || !self.abilities.impedance {
            return (AckResult::NotSupported, None);
        }
        if on && spoils(self.run.streams) {
            return (AckResult::Busy, None);
        }
        self.measures_impedance = on;
        (AckResult::Done, Some(Order::SetImpedance(on)))
    }

    fn reset(&self, into: ResetInto) -> (AckResult, Option<Order>) {
        match into {
            ResetInto::Newer(_) => (AckResult::BadArgument, None),
            ResetInto::Bootloader if !self.abilities.bootloader => (AckResult::NotSupported, None),
            into => (AckResult::Done, Some(Order::Reset(into))),
        }
    }

    /// Executes a `Start`. A new run begins, with windows and samples counted from 0, unless a run
    /// with the same streams and the same mains frequency is already active.
    pub fn start(
        &mut self,
        start: Start,
        now_us: u64,
        sender: &mut Sender<impl FrameQueue>,
    ) -> (AckResult, Option<Order>) {
        if !self.can_stream {
            return (AckResult::NotSupported, None);
        }
        if self.is_testing || self.measures_impedance && spoils(start.streams) {
            return (AckResult::Busy, None);
        }
        let mains = match start.mains_hz {
            0 => Some(self.run.mains),
            hz => Mains::from_hz(hz),
        };
        let Some(mains) = mains else {
            return (AckResult::BadArgument, None);
        };
        let streams = start.streams;
        if streams.is_empty() || !self.streams().contains(streams) {
            return (AckResult::BadArgument, None);
        }
        if streams == self.run.streams && mains == self.run.mains {
            return (AckResult::Done, None);
        }
        let previous_mains = self.run.mains;
        let number = self.run.number.wrapping_add(1);
        self.run = Run { number, mains, streams };
        if mains != previous_mains {
            self.send_capabilities(now_us, sender);
        }
        self.stats.next_window = 0;
        (AckResult::Done, Some(Order::Start(self.run)))
    }

    /// Sends an output if it belongs to the active run. An output can still be queued when its run
    /// ends, and is then discarded.
    pub fn send(&mut self, output: &Output<'_>, sender: &mut Sender<impl FrameQueue>) {
        if !self.is_current_run(output.run) {
            return;
        }
        let mut bytes = [0; pipeline::CodeValues::MAX_BYTES];
        let message = match output.payload {
            Payload::Code(code, marks) => {
                self.count_code(code);
                ToHost::Code(message::code(self.model_id(), code, marks, &mut bytes))
            }
            Payload::PackedCode(code, marks) => {
                ToHost::PackedCode(message::packed_code(code, marks))
            }
            Payload::Features(features, marks) => {
                ToHost::Features(message::features(features, marks))
            }
            Payload::Event(event) => ToHost::Event(event),
            Payload::Exclusion(exclusion) => ToHost::Exclusion(exclusion),
            Payload::Quality(quality) => ToHost::Quality(message::quality(quality)),
            Payload::Impedance(impedance) if HAS_IMPEDANCE => {
                ToHost::Impedance(impedance.message())
            }
            Payload::Impedance(_) => return,
            Payload::Raw(samples) => ToHost::Raw(samples.message()),
            Payload::CompressedRaw(samples) => ToHost::CompressedRaw(samples.message()),
            Payload::Filtered(steps) => ToHost::Filtered(steps.message()),
            Payload::Audit(window) => ToHost::Audit(window.message(self.model_id(), &mut bytes)),
        };
        sender.send(output.at_us, &message);
    }

    fn count_code(&mut self, code: &Code) {
        self.stats.codes_made = self.stats.codes_made.wrapping_add(1);
        self.stats.next_window = code.window.wrapping_add(1);
        let clipped = code.clipped_values.into();
        self.stats.clipped_values = self.stats.clipped_values.wrapping_add(clipped);
    }

    /// Stores the status of the converters, which every later answer to `Identify` contains. Also
    /// sends the status at once if it is the first one, if a run is active, or if the fault in the
    /// status has changed.
    pub fn update_converters(
        &mut self,
        converters: Converters,
        now_us: u64,
        sender: &mut Sender<impl FrameQueue>,
    ) {
        let previous = self.converters.replace(converters);
        let is_new = previous.is_none_or(|previous| self.converters_fault() != previous.fault);
        if is_new || self.is_streaming() {
            self.send_converters(now_us, sender);
        }
    }

    fn converters_fault(&self) -> &str {
        let converters = self.converters.as_ref();
        converters.map_or("", |converters| &converters.fault)
    }

    fn send_converters(&self, now_us: u64, sender: &mut Sender<impl FrameQueue>) {
        if let Some(converters) = &self.converters {
            sender.send(now_us, &ToHost::Converters(converters.clone()));
        }
    }

    /// Sends the result of the ordered self-test, and accepts `Start` again.
    pub fn send_self_test(
        &mut self,
        result: SelfTest,
        now_us: u64,
        sender: &mut Sender<impl FrameQueue>,
    ) {
        self.is_testing = false;
        sender.send(now_us, &ToHost::SelfTest(result));
    }

    /// Sends the counters as `Stats`. Call this every second while streaming; in answer to a `Stop`
    /// the session sends them itself.
    pub fn send_stats(&self, now_us: u64, counts: Counts, sender: &mut Sender<impl FrameQueue>) {
        let stats = self.stats(counts, sender.dropped());
        sender.send(now_us, &ToHost::Stats(stats));
    }

    /// Sends the durations of the stages. On a device that measures them, call this every second
    /// while streaming, after [`Self::send_stats`].
    pub fn send_timing(&self, timing: Timing, now_us: u64, sender: &mut Sender<impl FrameQueue>) {
        sender.send(now_us, &ToHost::Timing(timing));
    }

    /// Returns the counters of session, acquisition, sender and decoder since boot, as `Stats`.
    pub fn stats(&self, counts: Counts, frames_dropped: u32) -> Stats {
        Stats {
            streams: self.run.streams,
            frames_dropped,
            samples: counts.samples,
            overruns: counts.overruns,
            adc_status_bad: counts.adc_status_bad,
            clipped: counts.clipped,
            input_bad: input_bad(self.decoder.counters()),
            ..self.stats
        }
    }

    fn send_capabilities(&self, now_us: u64, sender: &mut Sender<impl FrameQueue>) {
        let uploaded = self.uploaded.as_ref();
        let scales = uploaded.and_then(|model| model.code_scales.as_ref());
        let scales = scales.unwrap_or(CodeScales::BUILT_IN);
        let capabilities = message::capabilities(self.run.mains, scales);
        sender.send(now_us, &ToHost::Capabilities(capabilities));
    }
}

/// Executes a command about an uploaded model, or returns why the command is refused; `None` for
/// every other command, and on a device without a slot. `abilities` are the device's streams.
fn upload<S: Slot>(
    command: &ToDevice<'_>,
    abilities: Streams,
    is_streaming: bool,
    slot: &mut S,
) -> Option<Result<UploadOutcome, AckResult>> {
    let is_upload =
        matches!(command, ToDevice::ModelBegin(_) | ToDevice::ModelChunk(_) | ToDevice::ModelEnd);
    if !is_upload || !S::EXISTS {
        return None;
    }
    if is_streaming {
        return Some(Err(AckResult::Busy));
    }
    let outcome = slot.with(|slot| match *command {
        ToDevice::ModelBegin(begin) => slot.begin(begin, abilities),
        ToDevice::ModelChunk(chunk) => slot.store(chunk),
        _ => slot.end(),
    });
    Some(outcome.ok_or(AckResult::Busy))
}

/// Returns the filters of `SetFeatures`; `None` for any other command, and for filters out of
/// range.
fn filters(command: &ToDevice<'_>) -> Option<FeatureFilters> {
    let ToDevice::SetFeatures(filters) = command else {
        return None;
    };
    let sections = [filters.first, filters.second].map(|s| [s.gain, s.a1, s.a2]);
    FeatureFilters::new(filters.id, sections, filters.weights)
}

/// Returns the number of unusable frames from the host; wraps.
fn input_bad(counters: &Counters) -> u32 {
    [
        counters.crc,
        counters.cobs,
        counters.oversize,
        counters.version,
        counters.unknown,
        counters.malformed,
    ]
    .into_iter()
    .fold(0, u32::wrapping_add)
}

#[cfg(test)]
mod tests;
