//! The firmware's pipeline without converters, clock and port: samples in, frames out.

use device::{
    Abilities, AcquiredSample, BothEncoders, Counts, Encoders, FrameQueue, Identity, Marks, Order,
    Output, Payload, Producer, Run, Sender, Session,
};
use link::{ResetCause, Start, Stats, Streams, Substitutes};
use pipeline::{Acquisition, Mains, Rate, Sample};

use super::{EncodedStream, PackedCounts};

/// Frames of the device that have not been written to the file yet.
#[derive(Debug, Default)]
struct Frames(Vec<u8>);

impl FrameQueue for Frames {
    fn push(&mut self, frame: &[u8]) {
        self.0.extend(frame);
    }

    /// Never called: the queue has no limit, and every message with a code fits into a frame.
    fn count_dropped(&mut self) {}

    fn dropped(&self) -> u32 {
        0
    }
}

/// Identity in the `Hello` with which a file of codes begins.
const IDENTITY: Identity<'static> = Identity {
    firmware: env!("CARGO_PKG_VERSION"),
    board: "host-sim",
    chip_uid: *b"\0host-sim\0\0\0",
    // The session id is constant, so that equal recordings yield equal files.
    session_id: 1,
    reset_cause: ResetCause::PowerOn,
    fault: "",
};

const ABILITIES: Abilities = Abilities {
    streams: BothEncoders::STREAMS,
    self_test: false,
    bootloader: false,
    clock: false,
    impedance: false,
};

/// A device that streams codes or packed blocks from its first sample on. Its frames equal a
/// board's, except that the status of the converters is missing.
#[derive(Debug)]
pub(super) struct Device {
    session: Session<'static>,
    sender: Sender<Frames>,
    acquisition: Acquisition,
    producer: Box<Producer<BothEncoders>>,
    /// Parameters with which the first sample starts the run; `None` after the first sample.
    new_run: Option<Run>,
    samples: u64,
    steps: u64,
    packed: PackedCounts,
}

impl Device {
    /// Creates a device. The first [`Self::take_frames`] returns its `Hello` and `Capabilities`.
    pub(super) fn new(mains: Mains, substitutes: Substitutes, stream: EncodedStream) -> Self {
        let mut sender = Sender::new(Frames::default());
        let session = Session::new(IDENTITY, ABILITIES, mains);
        let mut session = session.with_substitutes(substitutes);
        session.introduce(0, &mut sender);
        let (streams, rate) = match stream {
            EncodedStream::Codes => (Streams::CODES, None),
            EncodedStream::Packed(rate) => (Streams::PACKED, rate.and_then(Rate::new)),
        };
        let mut producer = Box::new(Producer::new(BothEncoders::EMPTY));
        if let Some(rate) = rate {
            producer.set_rate(rate);
        }
        let start = Start { streams, mains_hz: 0 };
        let (_, order) = session.start(start, 0, &mut sender);
        Self {
            session,
            sender,
            acquisition: Acquisition::new(mains),
            producer,
            new_run: match order {
                Some(Order::Start(run)) => Some(run),
                _ => None,
            },
            samples: 0,
            steps: 0,
            packed: PackedCounts::default(),
        }
    }

    pub(super) fn process(&mut self, sample: Sample) {
        let drdy_us = self.samples * 1_000_000 / u64::from(model::ADC_RATE_HZ);
        let step_index = self.steps;
        let step = self.acquisition.process_sample(&sample);
        self.steps += u64::from(step.is_some());
        let acquired = AcquiredSample {
            new_run: self.new_run.take(),
            sample,
            index: self.samples,
            step_index,
            step,
            drdy_us,
            marks: Marks::NONE,
            lost: Marks::NONE,
            excited: false,
        };
        self.samples += 1;
        let counts = self.counts();
        let (session, sender) = (&mut self.session, &mut self.sender);
        let packed = &mut self.packed;
        let mut emit = |output: Output<'_>| {
            if let Payload::PackedCode(code, _) = &output.payload {
                packed.add(code);
            }
            if output.ends_second() {
                session.send_stats(output.at_us, counts, sender);
            }
            session.send(&output, sender);
        };
        self.producer.process(&acquired, &mut emit);
    }

    pub(super) const fn packed(&self) -> PackedCounts {
        self.packed
    }

    /// Returns the number of bytes that [`Self::take_frames`] would return.
    pub(super) fn waiting_bytes(&mut self) -> usize {
        self.sender.queue().0.len()
    }

    /// Returns the frames that the device has made since the last call.
    pub(super) fn take_frames(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.sender.queue().0)
    }

    /// Returns the counters, and sends them as a device does after a run.
    pub(super) fn finish(&mut self) -> Stats {
        let counts = self.counts();
        let now_us = self.samples * 1_000_000 / u64::from(model::ADC_RATE_HZ);
        self.session.send_stats(now_us, counts, &mut self.sender);
        self.session.stats(counts, 0)
    }

    fn counts(&self) -> Counts {
        Counts { samples: self.samples, clipped: self.producer.clipped(), ..Counts::default() }
    }
}
