//! Packed blocks, decoded to one continuous signal.

use artifact::reconstruction::{PackedHop, PackedOverlap, PackedSource};
use artifact::{Description, PackedModel};
use link::Flags;

use crate::hops::DecodedHop;

/// Decodes packed blocks in their order. Each block completes the hop of the block before it, corrected by what it says
/// about that hop; [`Self::finish`] completes the last one.
pub(crate) struct PackedHops {
    overlap: PackedOverlap<Label>,
    /// Number of rows of a hop.
    rows: u64,
    /// Index of the next block.
    next: u32,
}

/// Index and flags of a block.
#[derive(Clone, Copy)]
struct Label {
    index: u32,
    flags: Flags,
}

impl PackedHops {
    /// Creates the decoder of a file whose device has this full scale, microvolts.
    pub(crate) fn new(model: &PackedModel, description: &Description, full_scale_uv: f32) -> Self {
        Self {
            overlap: PackedOverlap::new(model, false, full_scale_uv),
            rows: description.window.hop as u64,
            next: 0,
        }
    }

    /// Decodes the block with this index. Passes the hops of missing blocks before it, and the hop that it completes, to
    /// `emit`. A malformed block is replaced like a missing one, and counted.
    ///
    /// # Errors
    /// That of `emit`.
    pub(crate) fn decode<E>(
        &mut self,
        (index, flags): (u32, Flags),
        block: (&[u8], u8),
        mut emit: impl FnMut(DecodedHop) -> Result<(), E>,
    ) -> Result<(), E> {
        while self.next < index {
            self.complete(None, Flags::empty(), &mut emit)?;
        }
        self.complete(Some(block), flags, &mut emit)
    }

    /// Passes the hop of the last block to `emit`, and returns the number of blocks that were malformed.
    ///
    /// # Errors
    /// That of `emit`.
    pub(crate) fn finish<E>(
        mut self,
        mut emit: impl FnMut(DecodedHop) -> Result<(), E>,
    ) -> Result<u64, E> {
        if let Some(hop) = self.overlap.finish() {
            self.pass_on(&hop, &mut emit)?;
        }
        Ok(self.overlap.malformed())
    }

    /// Decodes the next block, `None` for a missing one.
    fn complete<E>(
        &mut self,
        block: Option<(&[u8], u8)>,
        flags: Flags,
        emit: &mut impl FnMut(DecodedHop) -> Result<(), E>,
    ) -> Result<(), E> {
        let label = Label {
            index: self.next,
            flags,
        };
        self.next += 1;
        match self.overlap.next_hop(block, label) {
            Some(hop) => self.pass_on(&hop, emit),
            None => Ok(()),
        }
    }

    fn pass_on<E>(
        &self,
        hop: &PackedHop<Label>,
        emit: &mut impl FnMut(DecodedHop) -> Result<(), E>,
    ) -> Result<(), E> {
        let Label { index, flags } = hop.label;
        let flags = match hop.source {
            PackedSource::Block => flags,
            PackedSource::Healing => flags | Flags::HEALING,
            PackedSource::Prediction => flags | Flags::FILLER,
        };
        emit(DecodedHop {
            first_row: u64::from(index) * self.rows,
            uv: &hop.microvolts,
            flags,
        })
    }
}
