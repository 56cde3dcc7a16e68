//! The board's behaviour between ADC and port, without time and without a port.

use device::{
    Abilities, Counts, FrameQueue, Made, Marks, Order, Producer, Run, Sender, Session, Taken, What,
};
use link::{AckResult, ResetCause, Start, Stats, Streams};
use pipeline::{Acquisition, Mains, Sample};

use crate::Outbox;

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

/// Pipeline and link as on a board: samples and bytes in, frames out.
///
/// Time is an argument: the device clock in microseconds since boot.
#[derive(Debug)]
pub struct VirtualBoard {
    session: Session<'static>,
    sender: Sender<Outbox>,
    acquisition: Acquisition,
    producer: Box<Producer>,
    /// Told to the producer with the next sample.
    begun: Option<Run>,
    /// Since boot.
    samples: u64,
    /// Steps since the last `Start`.
    steps: u64,
    /// Values that the int8 input clipped before the last `Start`.
    clipped_before: u32,
}

impl VirtualBoard {
    /// A board that has just started: it introduces itself into the outbox.
    pub fn new(identity: Identity, mains: Mains, outbox: Outbox) -> Self {
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
            acquisition: Acquisition::new(mains),
            producer: Box::default(),
            begun: None,
            samples: 0,
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

    /// Takes the sample whose DRDY edge was at `now_us`. Ignored while nothing streams.
    pub fn sample(&mut self, sample: &Sample, now_us: u64) {
        if !self.is_streaming() {
            return;
        }
        self.samples += 1;
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
            marks: Marks::NONE,
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
            clipped: self.clipped_before.wrapping_add(self.acquisition.clipped()),
            ..Counts::default()
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
