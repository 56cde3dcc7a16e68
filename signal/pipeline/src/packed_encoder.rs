//! The packed code: one block of few bits for each hop.

mod memory;

use core::borrow::BorrowMut;

use model::{HOP, PACKED, Packed};
use packed::Rate;

use crate::sample::Step;

pub use memory::PackedMemory;

/// Encodes each hop's steps as a block that is predicted from the block before it.
///
/// The products of the analysis are added as the steps arrive, and the prediction is made with the
/// first step of a block, so that only quantiser and range coder are left after the last step.
///
/// Without a packed model it returns no blocks, and its memory is a few bytes.
///
/// `M` is a [`PackedMemory`], or a mutable reference to one.
#[derive(Clone, Debug)]
pub struct PackedEncoder<M = PackedMemory> {
    memory: M,
    /// Rate of the next block.
    rate: Rate,
}

impl<M: BorrowMut<PackedMemory>> PackedEncoder<M> {
    /// Rate of a device whose host asks for no other.
    pub const DEFAULT_RATE: Rate = match PACKED {
        Some(packed) => match Rate::new(packed.rate) {
            Some(rate) => rate,
            None => Rate::MIDDLE,
        },
        None => Rate::MIDDLE,
    };

    /// Creates an encoder with the built-in model and the given memory.
    pub const fn with_memory(memory: M) -> Self {
        Self {
            memory,
            rate: Self::DEFAULT_RATE,
        }
    }

    /// Resets the encoder in place: the next step is the first of a stream.
    pub fn restart(&mut self) {
        self.memory.borrow_mut().restart();
    }

    /// Sets the rate from the next block on.
    pub fn set_rate(&mut self, rate: Rate) {
        self.rate = rate;
    }

    /// Returns the state after the newest block, that of a decoder that has read all blocks. Call
    /// it before the next block's first step, which replaces the state by its prediction.
    pub fn state(&self) -> &[i16] {
        self.memory.borrow().state()
    }

    /// Encodes the next step; returns a block if the step completes a hop.
    pub fn encode_step(&mut self, step: &Step) -> Option<PackedCode> {
        let packed: &Packed<'_> = PACKED.as_ref()?;
        let memory = self.memory.borrow_mut();
        memory.add_step(step, packed);
        if !memory.is_complete() {
            return None;
        }
        let code = memory.encode(self.rate, packed);
        memory.begin_next();
        Some(code)
    }
}

impl PackedEncoder {
    /// Creates an encoder with the built-in model.
    pub const fn new() -> Self {
        Self::with_memory(PackedMemory::EMPTY)
    }
}

impl Default for PackedEncoder {
    fn default() -> Self {
        Self::new()
    }
}

const _: () = assert!(HOP > 0);

/// Largest number of bytes of a block. A block that needs more is coded again at a coarser rate.
pub const MAX_PACKED_BYTES: usize = 118;

/// One block of the packed code, with its position in the stream and its status.
#[expect(
    clippy::struct_excessive_bools,
    reason = "each of them can be true with any other"
)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PackedCode {
    /// Index of the block in the run, from 0; wraps. Block `n` covers the steps from `n * HOP` on.
    pub block: u32,
    /// Time from the ADC sample that completed the block to its last step, microseconds; see
    /// [`Step::offset_us`](crate::Step::offset_us).
    pub offset_us: u16,
    /// Number of electrode values of the block that were clipped to the range of the inputs.
    pub clipped: u16,
    /// ADC channels that were at the rail in the block, or between the step before it and its first
    /// step; bit n is channel n.
    pub saturated: u64,
    /// True if the filters had not settled at the block's first step.
    pub settling: bool,
    /// Rate that the stream has; a block that was too long has a coarser one, which its bytes
    /// state.
    pub rate: u8,
    /// True if the block has no prediction, so that a decoder can start with it.
    pub is_reset: bool,
    /// True if the model does not represent the block well: an electrode without contact, or
    /// another cap.
    pub is_misfit: bool,
    /// True if the block was too long at two rates: all its magnitudes are 0, and a decoder shows
    /// the prediction.
    pub is_blank: bool,
    pub(super) length: u16,
    pub(super) buffer: [u8; MAX_PACKED_BYTES],
}

impl PackedCode {
    /// Returns the bytes of the block, at most [`MAX_PACKED_BYTES`].
    pub fn bytes(&self) -> &[u8] {
        self.buffer
            .get(..usize::from(self.length))
            .unwrap_or_default()
    }
}
