//! A board without clock and port. Receives samples and commands, and sends frames to an outbox.

use std::collections::VecDeque;

use ads1299::SelfTestReport;
use device::{
    Abilities, AcquiredSample, BothEncoders, CHIPS, CapturedEvent, Counts, FrameQueue, Marks,
    ModelSlot, Order, Output, Payload, Producer, Run, Sender, Session,
};
use link::{AckResult, EventKind, ResetCause, Start, Stats, Substitutes};
use pipeline::{Acquisition, Mains, Sample};

use crate::contact::{Contact, impedances};
use crate::converters::{ConvertedSample, Converters};
use crate::fault::Faults;
use crate::outbox::Outbox;
use crate::trigger::Trigger;

/// Facts that the virtual board reports about itself and that its user can choose.
#[derive(Clone, Copy, Debug, Default)]
pub struct Identity {
    /// Session id, which should be different at each start of the board. A `Reset` increments it.
    pub session_id: u32,
    /// Unique id of 96 bits, which a board would read from its microcontroller.
    pub chip_uid: [u8; 12],
    /// Electrodes that the source of the samples lacks, and whether they are interpolated or zero.
    pub substitutes: Substitutes,
}

impl Identity {
    fn with_reset_cause(&self, reset_cause: ResetCause) -> device::Identity<'static> {
        device::Identity {
            firmware: env!("CARGO_PKG_VERSION"),
            board: "host-sim",
            chip_uid: self.chip_uid,
            session_id: self.session_id,
            reset_cause,
            fault: "",
        }
    }
}

const ABILITIES: Abilities = Abilities {
    streams: device::streams_with::<BothEncoders>(),
    self_test: true,
    bootloader: false,
    clock: true,
    impedance: true,
};

/// Creates the session of a board that has just started.
fn session(identity: &Identity, cause: ResetCause, mains: Mains) -> Session<'static> {
    let session = Session::new(identity.with_reset_cause(cause), ABILITIES, mains);
    session.with_substitutes(identity.substitutes)
}

/// A board with simulated converters. Receives samples at the electrodes and bytes from the host;
/// sends frames to an [`Outbox`].
///
/// Methods take the device time as an argument, in microseconds since boot.
#[derive(Debug)]
pub struct VirtualBoard {
    identity: Identity,
    /// Mains frequency that the notch filter removes after each start of the board, until a host
    /// selects another one.
    mains: Mains,
    session: Session<'static>,
    sender: Sender<Outbox>,
    converters: Converters,
    trigger: Option<Trigger>,
    /// Trigger edges captured since the last sample; they are sent with the next sample.
    captured: VecDeque<CapturedEvent>,
    /// Number of captured edges since boot; wraps.
    edges: u32,
    acquisition: Acquisition,
    producer: Box<Producer<BothEncoders>>,
    /// Memory for an uploaded model, which a restart clears.
    slot: Box<ModelSlot>,
    /// Parameters of the run that starts with the next sample; `None` if no run is about to start.
    new_run: Option<Run>,
    /// Number of samples since boot; `overruns` and `adc_status_bad` also count from boot.
    samples: u64,
    overruns: u32,
    adc_status_bad: u32,
    /// Number of packed blocks made since boot.
    packed_blocks: u64,
    /// Number of steps since the last `Start`.
    steps: u64,
}

impl VirtualBoard {
    /// Creates a board that has just started. `Hello`, `Capabilities` and `Converters` are in the
    /// outbox.
    pub fn new(identity: Identity, mains: Mains, outbox: Outbox) -> Self {
        Self::with_faults(identity, mains, Faults::default(), outbox)
    }

    /// Creates a board as [`Self::new`] does, with faults in its converters.
    pub fn with_faults(identity: Identity, mains: Mains, faults: Faults, outbox: Outbox) -> Self {
        let mut board = Self {
            identity,
            mains,
            session: session(&identity, ResetCause::PowerOn, mains),
            sender: Sender::new(outbox),
            converters: Converters::new(faults),
            trigger: None,
            captured: VecDeque::new(),
            edges: 0,
            acquisition: Acquisition::new(mains),
            producer: Box::new(Producer::new(BothEncoders::EMPTY)),
            slot: Box::new(ModelSlot::empty()),
            new_run: None,
            samples: 0,
            overruns: 0,
            adc_status_bad: 0,
            packed_blocks: 0,
            steps: 0,
        };
        board.introduce(0);
        board.with_contacts(&[])
    }

    /// Adds a simulated trigger input; `None` for an input without edges.
    #[must_use]
    pub fn with_trigger(mut self, trigger: Option<Trigger>) -> Self {
        self.trigger = trigger;
        self
    }

    /// Sets the electrodes' impedances. Electrodes that `contacts` does not name have 5 kOhm.
    #[must_use]
    pub fn with_contacts(mut self, contacts: &[Contact]) -> Self {
        self.converters.set_impedances(&impedances(contacts));
        self
    }

    /// Captures an edge of the trigger input that happens at `at_us` and precedes the next sample.
    /// Must not be called on a board that has a trigger from [`Self::with_trigger`].
    pub fn capture_edge(&mut self, kind: EventKind, at_us: u64) {
        self.captured.push_back(CapturedEvent { kind, number: self.edges, at_us });
        self.edges = self.edges.wrapping_add(1);
    }

    /// Receives bytes from the host; executes and acknowledges the commands that they complete.
    pub fn receive(&mut self, bytes: &[u8], now_us: u64) {
        let counts = self.counts();
        let mut orders = Vec::new();
        let (slot, sender) = (&mut *self.slot, &mut self.sender);
        self.session.receive(bytes, now_us, counts, slot, sender, |order| {
            orders.push(order);
        });
        if let Some(filters) = self.session.take_filters() {
            self.producer.set_filters(filters);
        }
        for order in orders {
            self.execute(order, now_us);
        }
    }

    /// Executes a `Start` without a command from a host, and sends no `Ack`.
    pub fn start(&mut self, start: Start, now_us: u64) -> AckResult {
        let (result, order) = self.session.start(start, now_us, &mut self.sender);
        if let Some(order) = order {
            self.execute(order, now_us);
        }
        result
    }

    fn execute(&mut self, order: Order, now_us: u64) {
        match order {
            Order::Start(run) => {
                self.acquisition = Acquisition::new(run.mains);
                self.new_run = Some(run);
                self.steps = 0;
            }
            Order::Stop => self.converters.set_excitation(false),
            Order::SetImpedance(on) => self.converters.set_excitation(on),
            Order::SetRate(rate) => self.producer.set_rate(rate),
            Order::SetExclusion(policy) => self.producer.set_exclusion(policy),
            Order::SelfTest => {
                let report = self.converters.run_self_test();
                let result = device::self_test_message(&report);
                self.session.send_self_test(result, now_us, &mut self.sender);
                self.update_converters(now_us);
            }
            Order::Reset(_) => self.restart(ResetCause::Software, now_us),
        }
    }

    /// Restarts the board as a reset does, for the reason `cause`. The converters keep their state
    /// except for the excitation. Frames in the outbox are still sent.
    pub fn restart(&mut self, cause: ResetCause, now_us: u64) {
        let outbox = self.sender.queue().clone();
        self.identity.session_id = self.identity.session_id.wrapping_add(1);
        self.session = session(&self.identity, cause, self.mains);
        self.sender = Sender::new(outbox);
        self.acquisition = Acquisition::new(self.mains);
        *self.producer = Producer::new(BothEncoders::EMPTY);
        *self.slot = ModelSlot::empty();
        self.converters.set_excitation(false);
        self.new_run = None;
        (self.samples, self.overruns, self.adc_status_bad) = (0, 0, 0);
        self.packed_blocks = 0;
        self.captured.clear();
        self.edges = 0;
        if let Some(trigger) = &mut self.trigger {
            trigger.restart(now_us);
        }
        self.introduce(now_us);
    }

    fn introduce(&mut self, now_us: u64) {
        self.session.introduce(now_us, &mut self.sender);
        self.update_converters(now_us);
    }

    fn update_converters(&mut self, now_us: u64) {
        let message = self.converters.message();
        self.session.update_converters(message, now_us, &mut self.sender);
    }

    /// Applies a sample, whose DRDY edge is due at `now_us`, to the electrodes and processes what
    /// the driver reads. Ignores the sample outside a run.
    pub fn process_sample(&mut self, sample: &Sample, now_us: u64) {
        if !self.is_streaming() {
            return;
        }
        self.converters.start_period(sample);
        while let Some(converted) = self.converters.read() {
            self.process(&converted, now_us.saturating_sub(converted.early_us));
        }
    }

    fn process(&mut self, ConvertedSample { sample, reading, .. }: &ConvertedSample, now_us: u64) {
        let marks = Marks {
            adc_status_bad: !reading.is_sound(),
            lead_off: reading.lead_off(),
            overrun: reading.missed > 0,
            ..Marks::NONE
        };
        self.samples += 1;
        self.overruns = self.overruns.wrapping_add(reading.missed);
        self.adc_status_bad = self.adc_status_bad.wrapping_add(marks.adc_status_bad.into());
        let index = self.acquisition.samples();
        let step_index = self.steps;
        let step = self.acquisition.process_sample(sample);
        self.steps += u64::from(step.is_some());
        let acquired = AcquiredSample {
            new_run: self.new_run.take(),
            sample: *sample,
            index,
            step_index,
            step,
            drdy_us: now_us,
            marks,
            lost: Marks::NONE,
            excited: self.converters.is_excited(),
        };
        let counts = self.counts();
        let (session, sender) = (&mut self.session, &mut self.sender);
        let (converters, blocks) = (&self.converters, &mut self.packed_blocks);
        let mut emit = |output: Output<'_>| {
            *blocks += u64::from(matches!(output.payload, Payload::PackedCode(..)));
            if output.ends_second() {
                session.send_stats(output.at_us, counts, sender);
                session.update_converters(converters.message(), output.at_us, sender);
            }
            session.send(&output, sender);
        };
        let mut trigger = self.trigger.as_mut();
        let is_first = acquired.new_run.is_some();
        if let (true, Some(trigger)) = (is_first, &mut trigger) {
            trigger.skip_before(now_us);
        }
        let captured = &mut self.captured;
        let mut next = || {
            let edge = captured.pop_front();
            edge.or_else(|| trigger.as_mut()?.next(now_us))
        };
        // Trigger edges precede the results of their sample, except in the first sample of a run:
        // the run must start before its edges are sent.
        if !is_first {
            self.producer.place_events(&acquired, &mut next, &mut emit);
        }
        let uploaded = self.slot.weights();
        self.producer.process_with(uploaded.as_ref(), &acquired, &mut emit);
        if is_first {
            self.producer.place_events(&acquired, &mut next, &mut emit);
        }
    }

    /// Returns true between a `Start` and the next `Stop`.
    pub const fn is_streaming(&self) -> bool {
        self.session.is_streaming()
    }

    /// Returns the converters, for their counters and the fault found when they were initialised.
    pub const fn converters(&self) -> &Converters {
        &self.converters
    }

    /// Runs the self-test of the converters, which then resume conversion. Unlike the command
    /// `SelfTest`, this function also works while a run is active.
    pub fn run_self_test(&mut self) -> SelfTestReport<CHIPS> {
        self.converters.run_self_test()
    }

    /// Returns the counters of samples, codes, commands and losses since boot.
    pub fn stats(&self) -> Stats {
        self.session.stats(self.counts(), self.sender.dropped())
    }

    /// Returns the number of packed blocks made since boot, which [`Self::stats`] lacks.
    pub const fn packed_blocks(&self) -> u64 {
        self.packed_blocks
    }

    /// Sends the counters, as a board does every second and after `Stop`.
    pub fn send_stats(&mut self, now_us: u64) {
        let counts = self.counts();
        self.session.send_stats(now_us, counts, &mut self.sender);
    }

    fn counts(&self) -> Counts {
        Counts {
            samples: self.samples,
            overruns: self.overruns,
            adc_status_bad: self.adc_status_bad,
            clipped: self.producer.clipped(),
        }
    }
}

impl FrameQueue for Outbox {
    fn push(&mut self, frame: &[u8]) {
        Outbox::push(self, frame);
    }

    fn count_dropped(&mut self) {
        Outbox::count_dropped(self);
    }

    fn dropped(&self) -> u32 {
        Outbox::dropped(self)
    }
}

#[cfg(test)]
mod tests;
