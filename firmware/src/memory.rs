//! The memory of the tasks.

use device::{FrameRing, Producer, Sender};
use embassy_sync::zerocopy_channel::{self, Channel};
use pipeline::{Acquisition, EncoderMemory, Mains};
use static_cell::{ConstStaticCell, StaticCell};

use crate::{Handed, Mutex, Stamped, deadlines};

/// Frames on their way to the port.
pub type Frames = Sender<FrameRing<{ deadlines::FRAMES_WAITING }>>;

/// The memory of a board's tasks and of the queues between them, a static of the board. It is made
/// when it is [taken](Self::take), on the stack and then moved, but for the largest part, which is zero
/// as long as nobody needs it: what lies in it costs no flash.
pub struct Memory {
    frames: StaticCell<Frames>,
    acquisition: StaticCell<Acquisition>,
    encoder: ConstStaticCell<EncoderMemory>,
    producer: StaticCell<Producer>,
    stamped: StaticCell<[Stamped; deadlines::SAMPLES_WAITING]>,
    stamped_channel: StaticCell<Channel<'static, Mutex, Stamped>>,
    handed: StaticCell<[Handed; deadlines::MADE_WAITING]>,
    handed_channel: StaticCell<Channel<'static, Mutex, Handed>>,
}

/// What each task gets of it.
pub struct Shares {
    /// For [`acquire`](crate::acquire).
    pub acquire: (StampedIn, &'static mut Acquisition),
    /// For [`encode`](crate::encode).
    pub encode: (StampedOut, HandedIn, &'static mut Producer),
    /// For [`converse`](crate::converse).
    pub converse: (&'static mut Frames, HandedOut),
}

/// Where samples go in.
pub type StampedIn = zerocopy_channel::Sender<'static, Mutex, Stamped>;
/// Where samples come out.
pub type StampedOut = zerocopy_channel::Receiver<'static, Mutex, Stamped>;
/// Where what is made goes in.
pub type HandedIn = zerocopy_channel::Sender<'static, Mutex, Handed>;
/// Where what is made comes out.
pub type HandedOut = zerocopy_channel::Receiver<'static, Mutex, Handed>;

impl Memory {
    /// Not taken.
    pub const fn new() -> Self {
        Self {
            frames: StaticCell::new(),
            acquisition: StaticCell::new(),
            encoder: ConstStaticCell::new(EncoderMemory::EMPTY),
            producer: StaticCell::new(),
            stamped: StaticCell::new(),
            stamped_channel: StaticCell::new(),
            handed: StaticCell::new(),
            handed_channel: StaticCell::new(),
        }
    }

    /// Makes everything and shares it out.
    ///
    /// No part of its caller: the first tasks run before a start has returned, and what is moved here
    /// would lie below them.
    ///
    /// # Panics
    /// When it is taken twice.
    #[inline(never)]
    pub fn take(&'static self) -> Shares {
        let stamped = self
            .stamped
            .init_with(|| core::array::from_fn(|_| Stamped::default()));
        let (stamped_in, stamped_out) = self.stamped_channel.init(Channel::new(stamped)).split();
        let handed = self
            .handed
            .init_with(|| core::array::from_fn(|_| Handed::default()));
        let (handed_in, handed_out) = self.handed_channel.init(Channel::new(handed)).split();
        Shares {
            acquire: (
                stamped_in,
                self.acquisition
                    .init_with(|| Acquisition::new(Mains::default())),
            ),
            encode: (
                stamped_out,
                handed_in,
                self.producer
                    .init_with(|| Producer::new(self.encoder.take())),
            ),
            converse: (
                self.frames.init_with(|| Sender::new(FrameRing::new())),
                handed_out,
            ),
        }
    }
}

impl Default for Memory {
    fn default() -> Self {
        Self::new()
    }
}
