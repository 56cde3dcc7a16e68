//! Packed blocks, decoded to one continuous signal.

use artifact::{Description, PackedModel};
use link::Flags;
use packed::Rate;
use reconstruction::PackedDecoder;

use crate::hops::DecodedHop;

/// Decodes packed blocks in their order. Each block completes the hop of the block before it, corrected by what it says
/// about that hop; [`Self::finish`] completes the last one.
pub(crate) struct Blocks {
    decoder: PackedDecoder,
    full_scale_uv: f32,
    /// Number of rows of a hop.
    rows: u64,
    /// Index of the next block.
    next: u32,
    /// Number of blocks that were malformed.
    malformed: u64,
    /// Signals and flags of the newest block.
    held: Option<(Vec<f32>, Flags)>,
}

impl Blocks {
    /// Creates the decoder of a file whose device has this full scale, microvolts.
    pub(crate) fn new(model: &PackedModel, description: &Description, full_scale_uv: f32) -> Self {
        Self {
            decoder: PackedDecoder::new(model),
            full_scale_uv,
            rows: description.window.hop as u64,
            next: 0,
            malformed: 0,
            held: None,
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
        (bytes, rate): (&[u8], u8),
        mut emit: impl FnMut(DecodedHop) -> Result<(), E>,
    ) -> Result<(), E> {
        while self.next < index {
            self.lose(&mut emit)?;
        }
        let decoded = Rate::new(rate).and_then(|rate| self.decoder.decode(bytes, rate).ok());
        let Some(decoded) = decoded else {
            self.malformed += 1;
            return self.lose(&mut emit);
        };
        let healing = if decoded.is_sound {
            Flags::empty()
        } else {
            Flags::HEALING
        };
        let next = (decoded.microvolts, flags | healing);
        self.complete(decoded.smoothed, next, &mut emit)
    }

    /// Passes the hop of the last block to `emit`, and returns the number of blocks that were malformed.
    ///
    /// # Errors
    /// That of `emit`.
    pub(crate) fn finish<E>(
        mut self,
        mut emit: impl FnMut(DecodedHop) -> Result<(), E>,
    ) -> Result<u64, E> {
        self.emit_held(None, &mut emit)?;
        Ok(self.malformed)
    }

    /// Replaces a missing block by its prediction.
    fn lose<E>(&mut self, emit: &mut impl FnMut(DecodedHop) -> Result<(), E>) -> Result<(), E> {
        let predicted = (self.decoder.skip(), Flags::FILLER);
        self.complete(None, predicted, emit)
    }

    fn complete<E>(
        &mut self,
        smoothed: Option<Vec<f32>>,
        next: (Vec<f32>, Flags),
        emit: &mut impl FnMut(DecodedHop) -> Result<(), E>,
    ) -> Result<(), E> {
        self.emit_held(smoothed, emit)?;
        self.held = Some(next);
        self.next += 1;
        Ok(())
    }

    fn emit_held<E>(
        &mut self,
        smoothed: Option<Vec<f32>>,
        emit: &mut impl FnMut(DecodedHop) -> Result<(), E>,
    ) -> Result<(), E> {
        let Some((microvolts, flags)) = self.held.take() else {
            return Ok(());
        };
        let mut uv = smoothed.unwrap_or(microvolts);
        for value in &mut uv {
            *value = value.clamp(-self.full_scale_uv, self.full_scale_uv);
        }
        emit(DecodedHop {
            first_row: u64::from(self.next - 1) * self.rows,
            uv: &uv,
            flags,
        })
    }
}
