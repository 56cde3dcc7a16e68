//! A device inside this process, which encodes samples and speaks the wire format.

use device::{
    Abilities, AcquiredSample, Counts, FrameQueue, Identity, Marks, ModelSlot, Order, Output,
    Payload, Producer, Run, Sender, Session,
};
use link::{ResetCause, Streams, Substitutes};
use pipeline::{Acquisition, EncoderMemory, Mains, Sample};

/// Abilities that the device reports to its host.
const ABILITIES: Abilities = Abilities {
    streams: Streams::from_bits(CODES.bits() | Streams::FEATURES.bits()),
    self_test: false,
    bootloader: false,
    clock: false,
    impedance: false,
};

/// The streams of codes, and of audits with which the bridge checks the codes.
pub(crate) const CODES: Streams = Streams::from_bits(Streams::CODES.bits() | Streams::AUDIT.bits());

/// A device that gets its samples from this program instead of converters. It runs the code of a
/// board: session, acquisition and encoder.
///
/// Methods take the device time as an argument, in microseconds since the device's start.
pub struct EncoderDevice {
    session: Session<'static>,
    sender: Sender<Outgoing>,
    acquisition: Acquisition,
    producer: Box<Producer<EncoderMemory>>,
    /// Memory for a personal model, which the host uploads.
    slot: Box<ModelSlot>,
    /// Parameters with which the next sample begins a run; `None` while a run continues.
    new_run: Option<Run>,
    /// Number of steps since the last `Start`.
    steps: u64,
    counts: Counts,
}

/// Queue of bytes for the host. [`EncoderDevice::take_bytes`] takes the bytes out.
#[derive(Clone, Debug, Default)]
struct Outgoing {
    bytes: Vec<u8>,
    dropped: u32,
}

impl FrameQueue for Outgoing {
    fn push(&mut self, frame: &[u8]) {
        self.bytes.extend_from_slice(frame);
    }

    fn count_dropped(&mut self) {
        self.dropped = self.dropped.wrapping_add(1);
    }

    fn dropped(&self) -> u32 {
        self.dropped
    }
}

impl EncoderDevice {
    /// Creates a device, which introduces itself to the host. The host recognises a new device by
    /// its `session_id`, which must differ from the previous device's.
    pub fn new(session_id: u32, substitutes: Substitutes, mains: Mains) -> EncoderDevice {
        let identity = Identity {
            firmware: env!("CARGO_PKG_VERSION"),
            board: "corticode-node",
            chip_uid: [0; 12],
            session_id,
            reset_cause: ResetCause::PowerOn,
            fault: "",
        };
        let session = Session::new(identity, ABILITIES, mains).with_substitutes(substitutes);
        let mut sender = Sender::new(Outgoing::default());
        session.introduce(0, &mut sender);
        EncoderDevice {
            session,
            sender,
            acquisition: Acquisition::new(mains),
            producer: Box::new(Producer::new(EncoderMemory::EMPTY)),
            slot: Box::new(ModelSlot::empty()),
            new_run: None,
            steps: 0,
            counts: Counts::default(),
        }
    }

    /// Reads bytes from the host, and answers the commands in them.
    pub fn receive(&mut self, bytes: &[u8], now_us: u64) {
        let counts = self.counts();
        let mut started = None;
        let producer = &mut self.producer;
        self.session.receive(bytes, now_us, counts, &mut *self.slot, &mut self.sender, |order| {
            match order {
                Order::Start(run) => started = Some(run),
                Order::SetExclusion(policy) => producer.set_exclusion(policy),
                _ => {}
            }
        });
        if let Some(filters) = self.session.take_filters() {
            producer.set_filters(filters);
        }
        if let Some(run) = started {
            self.acquisition = Acquisition::new(run.mains);
            self.new_run = Some(run);
            self.steps = 0;
        }
    }

    /// Returns whether the streams run: true from a `Start` to the next `Stop`.
    pub fn is_streaming(&self) -> bool {
        self.session.is_streaming()
    }

    /// Encodes a sample, or ignores it while no streams run. If the sample `is_lost`, codes of
    /// windows that contain it are not sent, so that the host finds them missing.
    pub fn process(&mut self, sample: &Sample, is_lost: bool, at_us: u64) {
        if !self.is_streaming() {
            return;
        }
        self.counts.samples += 1;
        self.counts.overruns = self.counts.overruns.wrapping_add(is_lost.into());
        let index = self.acquisition.samples();
        let step_index = self.steps;
        let step = self.acquisition.process_sample(sample);
        self.steps += u64::from(step.is_some());
        let marks = Marks { overrun: is_lost, ..Marks::NONE };
        let acquired = AcquiredSample {
            new_run: self.new_run.take(),
            sample: *sample,
            index,
            step_index,
            step,
            drdy_us: at_us,
            marks,
            lost: Marks::NONE,
            excited: false,
        };
        let counts = self.counts();
        let (session, sender) = (&mut self.session, &mut self.sender);
        let mut emit = |output: Output<'_>| {
            if let Payload::Code(_, marks) = &output.payload
                && marks.overrun
            {
                sender.skip();
                return;
            }
            if output.ends_second() {
                session.send_stats(output.at_us, counts, sender);
            }
            session.send(&output, sender);
        };
        let uploaded = self.slot.weights();
        self.producer.process_with(uploaded.as_ref(), &acquired, &mut emit);
    }

    /// Sends the device's counters, from which the host knows that the device still runs.
    pub fn send_stats(&mut self, at_us: u64) {
        let counts = self.counts();
        self.session.send_stats(at_us, counts, &mut self.sender);
    }

    /// Removes and returns the bytes to pass to the host.
    pub fn take_bytes(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.sender.queue().bytes)
    }

    fn counts(&self) -> Counts {
        Counts { clipped: self.producer.clipped(), ..self.counts }
    }
}
