//! The board's behaviour between ADC and port, without time and without a port.

use ads1299::SelfTestReport;
use device::{
    Abilities, Counts, FrameQueue, Made, Marks, Order, Producer, Run, Sender, Session, Taken, What,
};
use link::{AckResult, ResetCause, Start, Stats, Streams};
use pipeline::{Acquisition, EncoderMemory, Mains, Sample};

use crate::{CHIPS, Converted, Converters, Faults, Outbox, Trigger};

/// Who the virtual board says it is.
#[derive(Clone, Copy, Debug)]
pub struct Identity {
    /// Differs from start to start.
    pub session_id: u32,
    /// Made-up chip id.
    pub chip_uid: [u8; 12],
}

impl Identity {
    fn after(&self, reset_cause: ResetCause) -> device::Identity<'static> {
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

/// What the virtual board can do.
const ABILITIES: Abilities = Abilities {
    streams: Streams::ALL,
    self_test: true,
    bootloader: false,
};

/// Converters, pipeline and link as on a board: samples at the electrodes and bytes in, frames out.
///
/// Time is an argument: the device clock in microseconds since boot.
#[derive(Debug)]
pub struct VirtualBoard {
    identity: Identity,
    /// At boot.
    mains: Mains,
    session: Session<'static>,
    sender: Sender<Outbox>,
    converters: Converters,
    /// None where nothing happens at the inputs.
    trigger: Option<Trigger>,
    acquisition: Acquisition,
    producer: Box<Producer<EncoderMemory>>,
    /// Told to the producer with the next sample.
    begun: Option<Run>,
    /// Since boot.
    samples: u64,
    overruns: u32,
    adc_status_bad: u32,
    /// Steps since the last `Start`.
    steps: u64,
    /// Values that the int8 input clipped before the last `Start`.
    clipped_before: u32,
}

impl VirtualBoard {
    /// A board that has just started: it introduces itself into the outbox.
    pub fn new(identity: Identity, mains: Mains, outbox: Outbox) -> Self {
        Self::with_faults(identity, mains, Faults::NONE, outbox)
    }

    /// The same with converters that break.
    pub fn with_faults(identity: Identity, mains: Mains, faults: Faults, outbox: Outbox) -> Self {
        let boot = identity.after(ResetCause::PowerOn);
        let mut board = Self {
            identity,
            mains,
            session: Session::new(boot, ABILITIES, mains),
            sender: Sender::new(outbox),
            converters: Converters::new(faults),
            trigger: None,
            acquisition: Acquisition::new(mains),
            producer: Box::new(Producer::new(EncoderMemory::EMPTY)),
            begun: None,
            samples: 0,
            overruns: 0,
            adc_status_bad: 0,
            steps: 0,
            clipped_before: 0,
        };
        board.introduce(0);
        board
    }

    /// The same with edges that are made up.
    #[must_use]
    pub fn with_trigger(mut self, trigger: Option<Trigger>) -> Self {
        self.trigger = trigger;
        self
    }

    /// Takes bytes from the host and answers the commands that they complete.
    pub fn receive(&mut self, bytes: &[u8], now_us: u64) {
        let counts = self.counts();
        let mut order = None;
        self.session
            .receive(bytes, now_us, counts, &mut self.sender, |new| {
                order = Some(new);
            });
        if let Some(order) = order {
            self.obey(order, now_us);
        }
    }

    /// Obeys a `Start` that no host has sent.
    pub fn start(&mut self, start: Start, now_us: u64) -> AckResult {
        let (result, order) = self.session.start(start, now_us, &mut self.sender);
        if let Some(order) = order {
            self.obey(order, now_us);
        }
        result
    }

    fn obey(&mut self, order: Order, now_us: u64) {
        match order {
            Order::Start(run) => {
                self.clipped_before = self.clipped_before.wrapping_add(self.acquisition.clipped());
                self.acquisition = Acquisition::new(run.mains);
                self.begun = Some(run);
                self.steps = 0;
            }
            Order::Stop => {}
            Order::SelfTest => {
                let report = self.converters.self_test();
                let result = device::self_test(&report);
                self.session.self_test(&result, now_us, &mut self.sender);
                self.tell_of_converters(now_us);
            }
            Order::Reset(_) => self.restart(now_us),
        }
    }

    /// Begins anew, as after a reset; what waits still goes out.
    fn restart(&mut self, now_us: u64) {
        let outbox = self.sender.queue().clone();
        self.identity.session_id = self.identity.session_id.wrapping_add(1);
        let identity = self.identity.after(ResetCause::Software);
        self.session = Session::new(identity, ABILITIES, self.mains);
        self.sender = Sender::new(outbox);
        self.acquisition = Acquisition::new(self.mains);
        self.begun = None;
        (self.samples, self.overruns, self.adc_status_bad) = (0, 0, 0);
        self.clipped_before = 0;
        if let Some(trigger) = &mut self.trigger {
            trigger.restart(now_us);
        }
        self.introduce(now_us);
    }

    fn introduce(&mut self, now_us: u64) {
        self.session.introduce(now_us, &mut self.sender);
        self.tell_of_converters(now_us);
    }

    fn tell_of_converters(&mut self, now_us: u64) {
        let message = self.converters.message();
        self.session.converters(message, now_us, &mut self.sender);
    }

    /// Lets the electrodes deliver a sample whose DRDY edge is due at `now_us`, and takes what the
    /// converters make of it. Ignored while nothing streams.
    pub fn sample(&mut self, sample: &Sample, now_us: u64) {
        if !self.is_streaming() {
            return;
        }
        self.converters.deliver(sample);
        while let Some(converted) = self.converters.take() {
            self.take(&converted, now_us.saturating_sub(converted.early_us));
        }
    }

    fn take(
        &mut self,
        Converted {
            sample, reading, ..
        }: &Converted,
        now_us: u64,
    ) {
        let marks = Marks {
            adc_status_bad: !reading.is_sound(),
            lead_off: reading.lead_off(),
            overrun: reading.missed > 0,
        };
        self.samples += 1;
        self.overruns = self.overruns.wrapping_add(reading.missed);
        self.adc_status_bad = self
            .adc_status_bad
            .wrapping_add(marks.adc_status_bad.into());
        let index = self.acquisition.samples();
        let step = self.acquisition.process_sample(sample).map(|step| {
            self.steps += 1;
            (self.steps - 1, step)
        });
        let taken = Taken {
            begun: self.begun.take(),
            sample: *sample,
            index,
            step,
            drdy_us: now_us,
            marks,
        };
        let counts = self.counts();
        let (session, sender) = (&mut self.session, &mut self.sender);
        let converters = &self.converters;
        let mut hand_on = |made: Made| {
            if matches!(made.what, What::Quality(_)) {
                session.send_stats(made.at_us, counts, sender);
                session.converters(converters.message(), made.at_us, sender);
            }
            session.send(&made, sender);
        };
        let mut trigger = self.trigger.as_mut();
        let begins = taken.begun.is_some();
        if let (true, Some(trigger)) = (begins, &mut trigger) {
            trigger.forget_before(now_us);
        }
        let mut next = || trigger.as_mut()?.next(now_us);
        // Events first: what is made of the sample says how the input stood. A run must have begun.
        if !begins {
            self.producer.place(&taken, &mut next, &mut hand_on);
        }
        self.producer.take(&taken, &mut hand_on);
        if begins {
            self.producer.place(&taken, &mut next, &mut hand_on);
        }
    }

    /// Whether a host has started the codes.
    pub const fn is_streaming(&self) -> bool {
        self.session.is_streaming()
    }

    /// The converters: their counters, and why they did not come up as they should.
    pub const fn converters(&self) -> &Converters {
        &self.converters
    }

    /// Tests the converters as a board does; they convert again afterwards. No code may be under way.
    pub fn self_test(&mut self) -> SelfTestReport<CHIPS> {
        self.converters.self_test()
    }

    /// What the board has counted since its start.
    pub fn stats(&self) -> Stats {
        self.session.stats(self.counts(), self.sender.dropped())
    }

    /// Sends the counters; a board does so every second and after `Stop`.
    pub fn send_stats(&mut self, now_us: u64) {
        let counts = self.counts();
        self.session.send_stats(now_us, counts, &mut self.sender);
    }

    fn counts(&self) -> Counts {
        Counts {
            samples: self.samples,
            overruns: self.overruns,
            adc_status_bad: self.adc_status_bad,
            clipped: self.clipped_before.wrapping_add(self.acquisition.clipped()),
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
