//! Consecutive blocks of the packed code to one continuous signal.

use crate::PackedModel;
use packed::{Malformed, Rate};

use super::packed_decoder::PackedDecoder;

/// Decodes blocks to hops, one for each block: with low latency that of the block itself, otherwise
/// that of the block before, corrected by what the newer block says about it.
///
/// `T` is a label that the caller passes with each block and gets back with its hop, such as its
/// time.
#[derive(Clone, Debug)]
pub struct PackedOverlap<T> {
    decoder: PackedDecoder,
    low_latency: bool,
    full_scale_uv: f32,
    /// The newest hop, without correction.
    newest: Option<PackedHop<T>>,
    /// Number of received blocks that were malformed.
    malformed: u64,
}

/// Signals of the steps of one block.
#[derive(Clone, Debug, PartialEq)]
pub struct PackedHop<T> {
    /// Microvolts in the order step, electrode.
    pub microvolts: Vec<f32>,
    /// Where the values come from.
    pub source: PackedSource,
    /// What the caller passed with the block.
    pub label: T,
}

/// Where the values of a hop come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PackedSource {
    /// The block.
    Block,
    /// The block, whose error is larger because blocks before it are lost.
    Healing,
    /// The blocks before it: the block is lost or malformed, and the values are the model's
    /// prediction.
    Prediction,
}

impl<T: Clone> PackedOverlap<T> {
    /// Creates an overlap that waits for a block without prediction. Hops are limited to the range
    /// of plus and minus `full_scale_uv`.
    pub fn new(model: &PackedModel, low_latency: bool, full_scale_uv: f32) -> Self {
        Self {
            decoder: PackedDecoder::new(model),
            low_latency,
            full_scale_uv,
            newest: None,
            malformed: 0,
        }
    }

    /// Forgets all blocks: the next one is the first of another recording.
    pub fn restart(&mut self) {
        self.decoder.restart();
        self.newest = None;
    }

    /// Takes over the newest hop and the count of malformed blocks from `before`, whose stream
    /// another device continues.
    pub fn continue_from(&mut self, before: &mut Self) {
        self.newest = before.newest.take();
        self.malformed = before.malformed;
    }

    /// Decodes the next block, `None` for a lost one, and returns the hop that it completes; `None`
    /// if there is none. The block's rate is the index of that of the stream, as on the wire. A
    /// malformed block, and one whose rate does not exist, is replaced like a lost one, and
    /// counted.
    pub fn next_hop(&mut self, block: Option<(&[u8], u8)>, label: T) -> Option<PackedHop<T>> {
        let received = block.map(|(bytes, rate)| {
            let rate = Rate::new(rate).ok_or(Malformed)?;
            self.decoder.decode(bytes, rate)
        });
        self.malformed += u64::from(matches!(received, Some(Err(_))));
        let (microvolts, smoothed, source) = match received {
            Some(Ok(block)) if block.is_sound => {
                (block.microvolts, block.smoothed, PackedSource::Block)
            }
            Some(Ok(block)) => (block.microvolts, block.smoothed, PackedSource::Healing),
            Some(Err(_)) | None => (self.decoder.skip(), None, PackedSource::Prediction),
        };
        let newest = PackedHop {
            microvolts,
            source,
            label,
        };
        self.complete(newest, smoothed)
    }

    /// Takes `newest` for the hop of the next block, which is not decoded, and returns the hop that
    /// it completes. For a caller that needs no signals; what is decoded afterwards is wrong.
    pub fn pass(&mut self, newest: PackedHop<T>) -> Option<PackedHop<T>> {
        self.complete(newest, None)
    }

    /// Returns the hop that `newest` completes, with the signals `smoothed` if it corrects the hop
    /// before it.
    fn complete(
        &mut self,
        newest: PackedHop<T>,
        smoothed: Option<Vec<f32>>,
    ) -> Option<PackedHop<T>> {
        let completed = if self.low_latency {
            self.newest = Some(newest.clone());
            Some(newest)
        } else {
            let before = self.newest.replace(newest);
            before.map(|before| PackedHop {
                microvolts: smoothed.unwrap_or(before.microvolts),
                ..before
            })
        };
        completed.map(|hop| self.limited(hop))
    }

    /// Returns the hop that waits for the next block, as it is without that block; `None` with low
    /// latency, because it was returned at once.
    pub fn finish(&mut self) -> Option<PackedHop<T>> {
        let newest = self.newest.take().filter(|_| !self.low_latency);
        newest.map(|hop| self.limited(hop))
    }

    /// Returns the newest hop as decoded from its own block: neither corrected by the next block
    /// nor limited to full scale.
    pub fn newest(&self) -> Option<&PackedHop<T>> {
        self.newest.as_ref()
    }

    /// Number of received blocks that were malformed: their bytes are no block of this model.
    pub fn malformed(&self) -> u64 {
        self.malformed
    }

    fn limited(&self, mut hop: PackedHop<T>) -> PackedHop<T> {
        for value in &mut hop.microvolts {
            *value = value.clamp(-self.full_scale_uv, self.full_scale_uv);
        }
        hop
    }
}
