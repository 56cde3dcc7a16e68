//! The board's behaviour between ADC and port, without time and without a port.

use ads1299::SelfTestReport;
use device::{
    Abilities, Counts, FrameQueue, Made, Marks, Order, Producer, Run, Sender, Session, Taken, What,
};
use link::{AckResult, ResetCause, Start, Stats, Streams};
use pipeline::{Acquisition, Mains, Sample};

use crate::{CHIPS, Converted, Converters, Faults, Outbox};

/// Who the virtual board says it is.
#[derive(Clone, Copy, Debug)]
pub struct Identity {
    /// Differs from start to start.
    pub session_id: u32,
    /// Made-up chip id.
    pub chip_uid: [u8; 12],
}

/// What the virtual board can do.
const ABILITIES: Abilities = Abilities {
    streams: Streams::ALL,
    self_test: false,
    bootloader: false,
};

/// Converters, pipeline and link as on a board: samples at the electrodes and bytes in, frames out.
///
/// Time is an argument: the device clock in microseconds since boot.
#[derive(Debug)]
pub struct VirtualBoard {
    session: Session<'static>,
    sender: Sender<Outbox>,
    converters: Converters,
    acquisition: Acquisition,
    producer: Box<Producer>,
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
        let identity = device::Identity {
            firmware: env!("CARGO_PKG_VERSION"),
            board: "host-sim",
            chip_uid: identity.chip_uid,
            session_id: identity.session_id,
            reset_cause: ResetCause::PowerOn,
            fault: "",
        };
        let mut board = Self {
            session: Session::new(identity, ABILITIES, mains),
            sender: Sender::new(outbox),
            converters: Converters::new(faults),
            acquisition: Acquisition::new(mains),
            producer: Box::default(),
            begun: None,
            samples: 0,
            overruns: 0,
            adc_status_bad: 0,
            steps: 0,
            clipped_before: 0,
        };
        board.session.introduce(0, &mut board.sender);
        board
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
            self.obey(order);
        }
    }

    /// Obeys a `Start` that no host has sent.
    pub fn start(&mut self, start: Start, now_us: u64) -> AckResult {
        let (result, order) = self.session.start(start, now_us, &mut self.sender);
        if let Some(order) = order {
            self.obey(order);
        }
        result
    }

    fn obey(&mut self, order: Order) {
        if let Order::Start(run) = order {
            self.clipped_before = self.clipped_before.wrapping_add(self.acquisition.clipped());
            self.acquisition = Acquisition::new(run.mains);
            self.begun = Some(run);
            self.steps = 0;
        }
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
        let step = self.acquisition.push(sample).map(|step| {
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
        self.producer.take(&taken, &mut |made: Made| {
            if matches!(made.what, What::Quality(_)) {
                session.send_stats(made.at_us, counts, sender);
            }
            session.send(&made, sender);
        });
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
