//! Joins consecutive blocks of the packed code to one continuous signal.

use crate::PackedModel;
use packed::{Malformed, Rate};

use super::packed_decoder::PackedDecoder;

/// Decodes blocks to hops, and returns one hop for each block. With low latency, it is the hop of
/// the block itself; otherwise it is the hop of the previous block, corrected with the new block.
///
/// `T` is a label, such as a time, that the caller passes with a block and gets back with its hop.
#[derive(Clone, Debug)]
pub struct PackedOverlap<T> {
    decoder: PackedDecoder,
    low_latency: bool,
    full_scale_uv: f32,
    /// Hop of the newest block, not yet corrected by a later block.
    newest: Option<PackedHop<T>>,
    /// Number of received blocks that could not be decoded: malformed bytes or an invalid rate.
    malformed: u64,
}

/// The signals of one block.
#[derive(Clone, Debug, PartialEq)]
pub struct PackedHop<T> {
    /// Signals in microvolts, in the order step, electrode.
    pub microvolts: Vec<f32>,
    /// What the values were computed from.
    pub source: PackedSource,
    /// Label that the caller passed with the block.
    pub label: T,
}

/// What the values of a hop were computed from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PackedSource {
    /// Decoded from the block of this hop.
    Block,
    /// Decoded from the block of this hop, with a larger error because blocks before it were lost.
    Healing,
    /// Predicted from earlier blocks, because the block of this hop is lost or malformed.
    Prediction,
}

impl<T: Clone> PackedOverlap<T> {
    /// Creates an overlap that has seen no block. Values are clipped to
    /// -`full_scale_uv`..=`full_scale_uv`.
    pub fn new(model: &PackedModel, low_latency: bool, full_scale_uv: f32) -> Self {
        Self {
            decoder: PackedDecoder::new(model),
            low_latency,
            full_scale_uv,
            newest: None,
            malformed: 0,
        }
    }

    /// Forgets all blocks. Call this when the next block belongs to another recording.
    pub fn restart(&mut self) {
        self.decoder.restart();
        self.newest = None;
    }

    /// Takes over the newest hop and the count of malformed blocks from `before`. Call this when
    /// another device continues the stream that `before` decoded.
    pub fn continue_from(&mut self, before: &mut Self) {
        self.newest = before.newest.take();
        self.malformed = before.malformed;
    }

    /// Decodes the next block (its bytes and its rate as on the wire), or replaces a lost block
    /// (`None`) by its prediction. Returns the hop that is now complete, if any: without low
    /// latency, the first block completes no hop. A malformed block, or one with an invalid rate,
    /// is counted and replaced like a lost one.
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
        let newest = PackedHop { microvolts, source, label };
        self.complete(newest, smoothed)
    }

    /// Stores `newest` as the hop of the next block, without decoding the block, and returns the
    /// hop that [`Self::next_hop`] would return, but uncorrected. Only for callers that need no
    /// signals, because blocks decoded after this call yield wrong signals.
    pub fn pass(&mut self, newest: PackedHop<T>) -> Option<PackedHop<T>> {
        self.complete(newest, None)
    }

    /// Stores `newest` and returns the complete hop: with low latency `newest`, otherwise the
    /// previous hop, with the signals `smoothed` if there are any.
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

    /// Returns the last hop, which still waits for a next block; `None` with low latency, where
    /// [`Self::next_hop`] has already returned it.
    pub fn finish(&mut self) -> Option<PackedHop<T>> {
        let newest = self.newest.take().filter(|_| !self.low_latency);
        newest.map(|hop| self.limited(hop))
    }

    /// Returns the newest hop as decoded from its own block: neither corrected by a later block nor
    /// clipped to full scale.
    pub fn newest(&self) -> Option<&PackedHop<T>> {
        self.newest.as_ref()
    }

    /// Returns the number of received blocks that were malformed: their bytes are not a block of
    /// this model, or their rate is invalid.
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
