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
    /// Not inlined: the first tasks run before the board's start function returns. If this function were
    /// inlined there, its temporaries would take stack from these tasks.
    ///
    /// # Panics
    /// On the second call.
    #[inline(never)]
    pub fn init(&'static self) -> TaskMemory<E> {
        let samples = self
            .samples
            .init_with(|| core::array::from_fn(|_| SampleSlot::default()));
        let (sample_sender, sample_receiver) =
            self.sample_channel.init(Channel::new(samples)).split();
        let outputs = self
            .outputs
            .init_with(|| core::array::from_fn(|_| OutputSlot::default()));
        let (output_sender, output_receiver) =
            self.output_channel.init(Channel::new(outputs)).split();
        TaskMemory {
            acquire: (
                sample_sender,
                self.acquisition
                    .init_with(|| Acquisition::new(Mains::default())),
            ),
            encode: (
                sample_receiver,
                output_sender,
                self.producer
                    .init_with(|| Producer::new(self.encoders.take())),
            ),
            converse: (
                self.frames.init_with(|| Sender::new(FrameRing::new())),
                output_receiver,
            ),
        }
    }
}
