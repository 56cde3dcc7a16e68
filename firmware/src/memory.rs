//! Static memory of the tasks and of the queues between them.

use device::{Encoders, FrameRing, Producer, Sender};
use embassy_sync::zerocopy_channel::Channel;
use pipeline::{Acquisition, Mains};
use static_cell::{ConstStaticCell, StaticCell};

use crate::{
    deadlines,
    queues::{
        OutputReceiver, OutputSender, OutputSlot, RawMutex, SampleReceiver, SampleSender,
        SampleSlot,
    },
};

/// Numbers frames and keeps them until the port accepts them.
pub type Frames = Sender<FrameRing<{ deadlines::FRAME_BYTES_WAITING }>>;

/// Memory of a board's tasks and queues; a board declares one static of this type.
///
/// [`init`](Self::init) builds most values on the stack and moves them into place. The memory of the encoders
/// `E`, by far the largest value, is initialised to zeros at compile time and takes no flash.
pub struct Memory<E: 'static> {
    frames: StaticCell<Frames>,
    acquisition: StaticCell<Acquisition>,
    encoders: ConstStaticCell<E>,
    producer: StaticCell<Producer<&'static mut E>>,
    samples: StaticCell<[SampleSlot; deadlines::SAMPLES_WAITING]>,
    sample_channel: StaticCell<Channel<'static, RawMutex, SampleSlot>>,
    outputs: StaticCell<[OutputSlot; deadlines::OUTPUTS_WAITING]>,
    output_channel: StaticCell<Channel<'static, RawMutex, OutputSlot>>,
}

/// References into a [`Memory`], grouped by the task that owns them.
pub struct TaskMemory<E: 'static> {
    /// Sending end of the sample queue, and the filters, for [`acquire`](fn@crate::acquire).
    pub acquire: (SampleSender, &'static mut Acquisition),
    /// Receiving end of the sample queue, sending end of the output queue, and the producer, for
    /// [`encode`](fn@crate::encode).
    pub encode: (
        SampleReceiver,
        OutputSender,
        &'static mut Producer<&'static mut E>,
    ),
    /// Frames, and the receiving end of the output queue, for [`converse`](fn@crate::converse).
    pub converse: (&'static mut Frames, OutputReceiver),
}

impl<E: Encoders + 'static> Memory<E> {
    /// Creates the memory for a static; [`init`](Self::init) then initialises it. `encoders` is their memory
    /// before the first step, such as [`BothEncoders::EMPTY`](device::BothEncoders::EMPTY).
    pub const fn new(encoders: E) -> Self {
        Self {
            frames: StaticCell::new(),
            acquisition: StaticCell::new(),
            encoders: ConstStaticCell::new(encoders),
            producer: StaticCell::new(),
            samples: StaticCell::new(),
            sample_channel: StaticCell::new(),
            outputs: StaticCell::new(),
            output_channel: StaticCell::new(),
        }
    }

    /// Initialises the memory and splits it among the tasks.
    ///
    /// # Panics
    /// On the second call.
    pub fn init(&'static self) -> TaskMemory<E> {
        let samples = self.sample_channel.init(sample_channel(&self.samples));
        let (sample_sender, sample_receiver) = samples.split();
        let outputs = self.output_channel.init(output_channel(&self.outputs));
        let (output_sender, output_receiver) = outputs.split();
        TaskMemory {
            acquire: (sample_sender, acquisition(&self.acquisition)),
            encode: (
                sample_receiver,
                output_sender,
                producer(&self.producer, self.encoders.take()),
            ),
            converse: (frames(&self.frames), output_receiver),
        }
    }
}

// None of these functions is inlined: the first tasks run before the board's start function returns, so the
// temporaries of an inlined one would take stack from these tasks.

#[inline(never)]
fn sample_channel(
    samples: &'static StaticCell<[SampleSlot; deadlines::SAMPLES_WAITING]>,
) -> Channel<'static, RawMutex, SampleSlot> {
    Channel::new(samples.init_with(|| core::array::from_fn(|_| SampleSlot::default())))
}

#[inline(never)]
fn output_channel(
    outputs: &'static StaticCell<[OutputSlot; deadlines::OUTPUTS_WAITING]>,
) -> Channel<'static, RawMutex, OutputSlot> {
    Channel::new(outputs.init_with(|| core::array::from_fn(|_| OutputSlot::default())))
}

#[inline(never)]
fn acquisition(place: &'static StaticCell<Acquisition>) -> &'static mut Acquisition {
    place.init_with(|| Acquisition::new(Mains::default()))
}

#[inline(never)]
fn producer<E: Encoders>(
    place: &'static StaticCell<Producer<&'static mut E>>,
    encoders: &'static mut E,
) -> &'static mut Producer<&'static mut E> {
    place.init_with(|| Producer::new(encoders))
}

#[inline(never)]
fn frames(place: &'static StaticCell<Frames>) -> &'static mut Frames {
    place.init_with(|| Sender::new(FrameRing::new()))
}
