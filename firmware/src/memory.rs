//! Static memory of the tasks and of the queues between them.

use device::{Encoders, FrameRing, Producer, Sender};
use embassy_sync::zerocopy_channel::Channel;
use heapless::Vec;
use pipeline::{Acquisition, Mains};
use static_cell::{ConstStaticCell, StaticCell};

use crate::{
    deadlines,
    queues::{
        BulkSlot, OutputReceiver, OutputSender, OutputSlot, RawMutex, SampleReceiver, SampleSender,
        SampleSlot, output_queue,
    },
};

/// Queue that numbers frames and stores them until the port accepts them.
pub type Frames = Sender<FrameRing<{ deadlines::FRAME_BYTES_WAITING }>>;

/// Memory of a board's tasks and queues; a board declares one static of this type.
///
/// A static takes as much flash as RAM unless its initial value is all zeros. Only the encoders'
/// memory `E`, by far the largest part, and the frames start as zeros, so only they are initialised
/// at compile time; [`init`](Self::init) initialises the rest.
pub struct Memory<E: 'static> {
    frames: ConstStaticCell<Frames>,
    acquisition: StaticCell<Acquisition>,
    encoders: ConstStaticCell<E>,
    producer: StaticCell<Producer<&'static mut E>>,
    samples: ConstStaticCell<Vec<SampleSlot, { deadlines::SAMPLES_WAITING }>>,
    sample_channel: StaticCell<Channel<'static, RawMutex, SampleSlot>>,
    outputs: StaticCell<[OutputSlot; deadlines::OUTPUTS_WAITING]>,
    output_channel: StaticCell<Channel<'static, RawMutex, OutputSlot>>,
    bulk: StaticCell<[BulkSlot; deadlines::BULK_WAITING]>,
    bulk_channel: StaticCell<Channel<'static, RawMutex, BulkSlot>>,
}

/// References into a [`Memory`], grouped by the task that owns them.
pub struct TaskMemory<E: 'static> {
    /// Sending end of the sample queue, and the filters, for [`acquire`](fn@crate::acquire).
    pub acquire: (SampleSender, &'static mut Acquisition),
    /// Receiving end of the sample queue, sending end of the output queue, and the producer, for
    /// [`encode`](fn@crate::encode).
    pub encode: (SampleReceiver, OutputSender, &'static mut Producer<&'static mut E>),
    /// Frames, and the receiving end of the output queue, for [`converse`](fn@crate::converse).
    pub converse: (&'static mut Frames, OutputReceiver),
}

impl<E: Encoders + 'static> Memory<E> {
    /// Creates the memory for a static; [`init`](Self::init) initialises it. `encoders` is the
    /// encoders' memory before the first step, such as
    /// [`BothEncoders::EMPTY`](device::BothEncoders::EMPTY).
    pub const fn new(encoders: E) -> Self {
        Self {
            frames: ConstStaticCell::new(Sender::new(FrameRing::new())),
            acquisition: StaticCell::new(),
            encoders: ConstStaticCell::new(encoders),
            producer: StaticCell::new(),
            samples: ConstStaticCell::new(Vec::new()),
            sample_channel: StaticCell::new(),
            outputs: StaticCell::new(),
            output_channel: StaticCell::new(),
            bulk: StaticCell::new(),
            bulk_channel: StaticCell::new(),
        }
    }

    /// Initialises the memory and splits it among the tasks.
    ///
    /// Not inlined: the first tasks run before the board's start function returns, and temporaries
    /// on that function's stack frame would take stack from these tasks.
    ///
    /// # Panics
    /// On the second call.
    #[inline(never)]
    pub fn init(&'static self) -> TaskMemory<E> {
        // Push one slot at a time: an array of all slots, 10 KB, would be built on the stack.
        let samples = self.samples.take();
        while samples.push(SampleSlot::default()).is_ok() {}
        let samples = self.sample_channel.init(Channel::new(samples));
        let (sample_sender, sample_receiver) = samples.split();
        let outputs = Channel::new(self.outputs.init_with(|| [OutputSlot::EMPTY; _]));
        let bulk =
            Channel::new((self.bulk).init_with(|| core::array::from_fn(|_| BulkSlot::empty())));
        let (output_sender, output_receiver) =
            output_queue(self.output_channel.init(outputs), self.bulk_channel.init(bulk));
        let acquisition = (self.acquisition).init_with(|| Acquisition::new(Mains::default()));
        let producer = (self.producer).init_with(|| Producer::new(self.encoders.take()));
        TaskMemory {
            acquire: (sample_sender, acquisition),
            encode: (sample_receiver, output_sender, producer),
            converse: (self.frames.take(), output_receiver),
        }
    }
}
