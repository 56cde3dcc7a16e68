//! The device's side of the conversation with its host.

use link::{
    Ack, AckResult, ClockReading, Converters, Counters, Decoder, Event, FrameError, ResetInto,
    SelfTest, Start, Stats, Streams, Timing, ToDevice, ToHost,
};
use pipeline::{Code, Mains, Quality};

use crate::{
    Abilities, AuditedWindow, Counts, FilteredChunk, FrameQueue, Identity, Made, Marks, RawChunk,
    Sender, What, message,
};

/// From one start to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Run {
    /// Starts before this one, since boot; wraps. Tells what is still under way from what is new.
    pub number: u32,
    /// The notch.
    pub mains: Mains,
    /// What the host wants to have.
    pub streams: Streams,
}

impl Run {
    /// Before the first start.
    pub const NONE: Self = Self {
        number: 0,
        mains: Mains::Hz50,
        streams: Streams::empty(),
    };
}

/// What a command makes the board do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// Begin at sample 0.
    Start(Run),
    /// Rest.
    Stop,
    /// Try the converters; [`Session::self_test`] tells the host.
    SelfTest,
    /// Start anew, when what waits for the host has had a tenth of a second to go out.
    Reset(ResetInto),
}

/// Obeys commands and puts what happens into messages.
///
/// Messages are built on the stack, the largest in two kilobytes: what makes them is never part of its
/// caller, so that a task's frame does not hold all of them at once.
#[derive(Debug)]
pub struct Session<'i> {
    identity: Identity<'i>,
    abilities: Abilities,
    /// The run that is, or the last one, whose streams are then none.
    run: Run,
    /// Whether there is anything to start.
    can_stream: bool,
    /// How the converters are, if there are any.
    converters: Option<Converters>,
    /// A self-test was ordered and has no result yet.
    is_testing: bool,
    decoder: Decoder,
    /// What this side counts; the rest is filled in when it is sent.
    stats: Stats,
}

impl<'i> Session<'i> {
    /// A session of a device that has just started; [`Self::introduce`] comes first.
    pub fn new(identity: Identity<'i>, abilities: Abilities, mains: Mains) -> Self {
        Self {
            identity,
            abilities,
            run: Run { mains, ..Run::NONE },
            can_stream: true,
            converters: None,
            is_testing: false,
            decoder: Decoder::new(),
            stats: Stats::default(),
        }
    }

    /// Starts nothing from now on: the model is damaged. [`Identity::fault`] should say so.
    pub fn refuse_starts(&mut self) {
        self.can_stream = false;
    }

    /// Whether a host has started a stream.
    pub const fn is_streaming(&self) -> bool {
        !self.run.streams.is_empty()
    }

    /// Whether what was made in this run still interests the host.
    fn is_of_now(&self, run: u32) -> bool {
        self.is_streaming() && run == self.run.number
    }

    /// Says who the device is and what it measures.
    pub fn introduce(&self, now_us: u64, sender: &mut Sender<impl FrameQueue>) {
        self.send_hello(now_us, sender);
        self.send_capabilities(now_us, sender);
        self.send_converters(now_us, sender);
    }

    /// Takes bytes from the host and answers the commands that they complete; `order` gets what the
    /// acquisition has to do about them, before the answer goes out.
    #[inline(never)]
    pub fn receive(
        &mut self,
        mut bytes: &[u8],
        now_us: u64,
        counts: Counts,
        sender: &mut Sender<impl FrameQueue>,
        mut order: impl FnMut(Order),
    ) {
        while let Some(outcome) = self.decoder.next::<ToDevice>(&mut bytes) {
            let (of, result) = match outcome {
                Ok(frame) => {
                    self.stats.commands = self.stats.commands.wrapping_add(1);
                    let (result, what) = self.obey(frame.message, now_us, counts, sender);
                    what.into_iter().for_each(&mut order);
                    (frame.header.seq, result)
                }
                Err(FrameError::Unknown { header, .. }) => (header.seq, AckResult::UnknownCommand),
                // Counted by the decoder; there is no seq to acknowledge.
                Err(_) => continue,
            };
            send_ack(Ack { of, result }, now_us, sender);
        }
    }

    fn obey(
        &mut self,
        command: ToDevice,
        now_us: u64,
        counts: Counts,
        sender: &mut Sender<impl FrameQueue>,
    ) -> (AckResult, Option<Order>) {
        match command {
            ToDevice::Start(start) => return self.start(start, now_us, sender),
            ToDevice::Stop => return self.stop(now_us, counts, sender),
            ToDevice::Identify => self.introduce(now_us, sender),
            ToDevice::Ping => {}
            ToDevice::SelfTest => return self.begin_self_test(),
            ToDevice::SyncTime { host_time_us } => {
                let reading = ClockReading {
                    host_time_us,
                    received_us: now_us,
                };
                send_clock_reading(reading, now_us, sender);
            }
            ToDevice::Reset(into) => return self.reset(into),
        }
        (AckResult::Done, None)
    }

    fn stop(
        &mut self,
        now_us: u64,
        counts: Counts,
        sender: &mut Sender<impl FrameQueue>,
    ) -> (AckResult, Option<Order>) {
        // An order that nobody needs would displace one that somebody waits for.
        let order = self.is_streaming().then_some(Order::Stop);
        self.run.streams = Streams::empty();
        self.send_stats(now_us, counts, sender);
        (AckResult::Done, order)
    }

    fn begin_self_test(&mut self) -> (AckResult, Option<Order>) {
        if !self.abilities.self_test {
            return (AckResult::NotSupported, None);
        }
        if self.is_testing || self.is_streaming() {
            return (AckResult::Busy, None);
        }
        self.is_testing = true;
        (AckResult::Done, Some(Order::SelfTest))
    }

    fn reset(&self, into: ResetInto) -> (AckResult, Option<Order>) {
        match into {
            ResetInto::Newer(_) => (AckResult::BadArgument, None),
            ResetInto::Bootloader if !self.abilities.bootloader => (AckResult::NotSupported, None),
            into => (AckResult::Done, Some(Order::Reset(into))),
        }
    }

    /// Obeys a `Start`: windows and samples are counted from 0 again, unless the same runs already.
    pub fn start(
        &mut self,
        start: Start,
        now_us: u64,
        sender: &mut Sender<impl FrameQueue>,
    ) -> (AckResult, Option<Order>) {
        if !self.can_stream {
            return (AckResult::NotSupported, None);
        }
        if self.is_testing {
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
        if streams.is_empty() || !self.abilities.streams.contains(streams) {
            return (AckResult::BadArgument, None);
        }
        if streams == self.run.streams && mains == self.run.mains {
            return (AckResult::Done, None);
        }
        let before = self.run.mains;
        let number = self.run.number.wrapping_add(1);
        self.run = Run {
            number,
            mains,
            streams,
        };
        if mains != before {
            self.send_capabilities(now_us, sender);
        }
        self.stats.next_window = 0;
        (AckResult::Done, Some(Order::Start(self.run)))
    }

    /// Sends what was made, if it is of the present run: a start or a stop may have overtaken it.
    pub fn send(&mut self, made: &Made, sender: &mut Sender<impl FrameQueue>) {
        if !self.is_of_now(made.run) {
            return;
        }
        match &made.what {
            What::Nothing => {}
            What::Code(code, marks) => self.code(code, *marks, made.at_us, sender),
            What::Quality(quality) => send_quality(quality, made.at_us, sender),
            What::Raw(samples) => send_raw(samples, made.at_us, sender),
            What::Filtered(steps) => send_filtered(steps, made.at_us, sender),
            What::Audit(window) => send_audit(window, made.at_us, sender),
            What::Event(event) => send_event(*event, made.at_us, sender),
        }
    }

    #[inline(never)]
    fn code(
        &mut self,
        code: &Code,
        marks: Marks,
        step_us: u64,
        sender: &mut Sender<impl FrameQueue>,
    ) {
        self.stats.codes_made = self.stats.codes_made.wrapping_add(1);
        self.stats.next_window = code.window.wrapping_add(1);
        let clipped = code.clipped_values.into();
        self.stats.clipped_values = self.stats.clipped_values.wrapping_add(clipped);
        sender.send(step_us, &ToHost::Code(message::code(code, marks)));
    }

    /// The chain of converters is like this now. It goes out while something streams, when it is other
    /// than before, and with every introduction from now on.
    #[inline(never)]
    pub fn converters(
        &mut self,
        converters: Converters,
        now_us: u64,
        sender: &mut Sender<impl FrameQueue>,
    ) {
        let before = self.converters.replace(converters);
        let is_news = before.is_none_or(|before| self.fault() != before.fault);
        if is_news || self.is_streaming() {
            self.send_converters(now_us, sender);
        }
    }

    fn fault(&self) -> &str {
        let converters = self.converters.as_ref();
        converters.map_or("", |converters| &converters.fault)
    }

    #[inline(never)]
    fn send_converters(&self, now_us: u64, sender: &mut Sender<impl FrameQueue>) {
        if let Some(converters) = &self.converters {
            sender.send(now_us, &ToHost::Converters(converters.clone()));
        }
    }

    /// Sends the result of the self-test that was ordered.
    #[inline(never)]
    pub fn self_test(
        &mut self,
        result: &SelfTest,
        now_us: u64,
        sender: &mut Sender<impl FrameQueue>,
    ) {
        self.is_testing = false;
        sender.send(now_us, &ToHost::SelfTest(result.clone()));
    }

    /// Sends the counters; a device does so every second while it streams, and after `Stop`.
    #[inline(never)]
    pub fn send_stats(&self, now_us: u64, counts: Counts, sender: &mut Sender<impl FrameQueue>) {
        let stats = self.stats(counts, sender.dropped());
        sender.send(now_us, &ToHost::Stats(stats));
    }

    /// Sends how long the stages took since boot; a device that measures it does so every second
    /// while it streams, after the counters.
    #[inline(never)]
    pub fn timing(&self, timing: &Timing, now_us: u64, sender: &mut Sender<impl FrameQueue>) {
        sender.send(now_us, &ToHost::Timing(timing.clone()));
    }

    /// What the device has counted since boot.
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

    #[inline(never)]
    fn send_hello(&self, now_us: u64, sender: &mut Sender<impl FrameQueue>) {
        sender.send(now_us, &ToHost::Hello(self.identity.hello()));
    }

    #[inline(never)]
    fn send_capabilities(&self, now_us: u64, sender: &mut Sender<impl FrameQueue>) {
        let capabilities = message::capabilities(self.run.mains);
        sender.send(now_us, &ToHost::Capabilities(capabilities));
    }
}

#[inline(never)]
fn send_ack(ack: Ack, now_us: u64, sender: &mut Sender<impl FrameQueue>) {
    sender.send(now_us, &ToHost::Ack(ack));
}

#[inline(never)]
fn send_clock_reading(reading: ClockReading, now_us: u64, sender: &mut Sender<impl FrameQueue>) {
    sender.send(now_us, &ToHost::ClockReading(reading));
}

#[inline(never)]
fn send_quality(quality: &Quality, at_us: u64, sender: &mut Sender<impl FrameQueue>) {
    sender.send(at_us, &ToHost::Quality(message::quality(quality)));
}

#[inline(never)]
fn send_audit(window: &AuditedWindow, at_us: u64, sender: &mut Sender<impl FrameQueue>) {
    sender.send(at_us, &ToHost::Audit(window.message()));
}

#[inline(never)]
fn send_raw(samples: &RawChunk, at_us: u64, sender: &mut Sender<impl FrameQueue>) {
    sender.send(at_us, &ToHost::Raw(samples.message()));
}

#[inline(never)]
fn send_filtered(steps: &FilteredChunk, at_us: u64, sender: &mut Sender<impl FrameQueue>) {
    sender.send(at_us, &ToHost::Filtered(steps.message()));
}

#[inline(never)]
fn send_event(event: Event, at_us: u64, sender: &mut Sender<impl FrameQueue>) {
    sender.send(at_us, &ToHost::Event(event));
}

/// Frames from the host that could not be used.
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
