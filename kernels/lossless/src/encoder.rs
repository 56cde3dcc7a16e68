//! Compresses blocks of samples.

use crate::block::{Block, Count, Kind, MAX_SAMPLES, SUM_BYTES, number, sum};
use crate::channel::{Channel, Order, Past};
use crate::rice;

/// Number of samples, after the first sample of a key block, that the choice of the order ignores,
/// because their differences would reach back before the block.
const WARM_UP: usize = 2;

/// Encoder for blocks of samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Encoder {
    /// Number of blocks from one key block to the next; with 0 or 1, every block is a key block.
    pub key_blocks: u16,
}

/// State of an encoder for `CHANNELS` channels between blocks.
#[derive(Clone, Debug)]
pub struct EncoderState<const CHANNELS: usize> {
    channels: [Channel; CHANNELS],
    /// Sum of absolute differences in key blocks for each channel and order; older blocks count
    /// less.
    sizes: [[u32; 4]; CHANNELS],
    /// Number of blocks before the next key block; 0 if the next block is a key block.
    until_key: u16,
}

impl<const CHANNELS: usize> EncoderState<CHANNELS> {
    /// State before the first block, which will be a key block.
    pub const NEW: Self =
        Self { channels: [Channel::NEW; CHANNELS], sizes: [[0; 4]; CHANNELS], until_key: 0 };

    /// Makes the next block a key block. Call this before a block that does not directly follow the
    /// previous one.
    pub const fn require_key(&mut self) {
        self.until_key = 0;
    }
}

impl Encoder {
    /// Compresses samples to a block in `room`. Only the first [`MAX_SAMPLES`] samples are used.
    ///
    /// # Timing
    /// Bounded: one pass over the counts, a second one in a key block, and a copy of the samples if
    /// compression does not make them shorter.
    pub fn encode<'r, const CHANNELS: usize>(
        self,
        state: &mut EncoderState<CHANNELS>,
        samples: &[[Count; CHANNELS]],
        room: &'r mut [[Count; CHANNELS]; MAX_SAMPLES],
    ) -> Block<'r> {
        let samples = &samples[..samples.len().min(MAX_SAMPLES)];
        let kind = if state.until_key == 0 { Kind::Key } else { Kind::Continuing };
        state.until_key = match kind {
            Kind::Key => self.key_blocks.saturating_sub(1),
            _ => state.until_key - 1,
        };
        // A compressed block must not be longer than its counts.
        let room = &mut room[..samples.len()];
        let Some(length) = compress(state, samples, kind, bytes_of(room)) else {
            state.require_key();
            room.copy_from_slice(samples);
            return Block { kind: Kind::Verbatim, samples: samples.len(), bytes: bytes_of(room) };
        };
        Block { kind, samples: samples.len(), bytes: &bytes_of(room)[..length] }
    }
}

fn bytes_of<const CHANNELS: usize>(room: &mut [[Count; CHANNELS]]) -> &mut [u8] {
    room.as_flattened_mut().as_flattened_mut()
}

/// Writes a compressed block and returns its length in bytes; `None` if it does not fit `room`.
fn compress<const CHANNELS: usize>(
    state: &mut EncoderState<CHANNELS>,
    samples: &[[Count; CHANNELS]],
    kind: Kind,
    room: &mut [u8],
) -> Option<usize> {
    let (sum_place, room) = room.split_first_chunk_mut::<SUM_BYTES>()?;
    let mut writer = BitWriter::new(room);
    let channels = state.channels.iter_mut().zip(&mut state.sizes);
    for (index, (channel, sizes)) in channels.enumerate() {
        let mut rest = samples;
        if kind == Kind::Key {
            let (first, after) = samples.split_first()?;
            let first = number(first[index]);
            let (order, k) = choose(sizes, first, after.iter().map(|sample| sample[index]));
            channel.start_key(first, order, k);
            let first = first.cast_unsigned() & 0x00ff_ffff;
            writer.put(first << 7 | order.bits() << 5 | k, 31);
            rest = after;
        }
        let k = channel.k();
        let counts = rest.iter().map(|sample| number(sample[index]));
        let past = &mut channel.past;
        let folded = match channel.order {
            Order::Zero => put_codes::<0>(past, k, counts, &mut writer),
            Order::One => put_codes::<1>(past, k, counts, &mut writer),
            Order::Two => put_codes::<2>(past, k, counts, &mut writer),
            Order::Three => put_codes::<3>(past, k, counts, &mut writer),
        };
        #[expect(clippy::cast_possible_truncation, reason = "at most 8 samples")]
        channel.observe(folded, rest.len() as u32);
    }
    *sum_place = sum(state.channels.iter().map(|channel| channel.past.x));
    Some(SUM_BYTES + writer.finish()?)
}

/// Writes the codes of one channel and returns the sum of its folded differences, at most 8 * 2^27.
#[inline]
fn put_codes<const ORDER: usize>(
    past: &mut Past,
    k: u32,
    counts: impl Iterator<Item = i32>,
    writer: &mut BitWriter,
) -> u32 {
    let mut sum: u32 = 0;
    let mut newest = *past;
    for count in counts {
        let folded = rice::fold(newest.append(count)[ORDER]);
        let (bits, width) = rice::code(folded, k, count);
        writer.put(bits, width);
        sum = sum.wrapping_add(folded);
    }
    *past = newest;
    sum
}

/// Chooses the order of differences and the Rice parameter k for a channel of a key block. Adds the
/// block's absolute differences to `sizes`, the fading sums of earlier key blocks, and takes the
/// order with the smallest sum. k depends only on this block.
fn choose(sizes: &mut [u32; 4], first: i32, after: impl Iterator<Item = Count>) -> (Order, u32) {
    let mut past = Past::after(first);
    let mut block = [0_u32; 4];
    // A size first loses a quarter, then grows by at most 7 * 2^26. It therefore never exceeds 4
    // times this number, which is below 2^32.
    for size in &mut *sizes {
        *size -= *size >> 2;
    }
    for (time, count) in after.enumerate() {
        let differences = past.append(number(count)).map(i32::unsigned_abs);
        for ((size, block), difference) in sizes.iter_mut().zip(&mut block).zip(differences) {
            *block = block.wrapping_add(difference);
            if time >= WARM_UP {
                *size = size.wrapping_add(difference);
            }
        }
    }
    let mut best = Order::Zero;
    for order in Order::ALL {
        if sizes[order as usize] < sizes[best as usize] {
            best = order;
        }
    }
    // A folded difference is about twice the absolute difference, and a block has 7 differences. So
    // the mean of the folded differences is 2/7 of the sum of the absolute ones; 1/4 + 1/32 is
    // close.
    let sum = block[best as usize];
    let mean = (sum >> 2) + (sum >> 5);
    (best, (mean | 1).ilog2().min(rice::MAX_K))
}

/// Writes bits to bytes, most significant bit first.
///
/// Bits that do not fit are discarded, and [`finish`](Self::finish) then returns `None`.
#[derive(Debug)]
struct BitWriter<'b> {
    room: core::slice::IterMut<'b, [u8; 4]>,
    /// Bits that are not written yet, in the most significant places.
    pending: u32,
    /// Number of unused bits of `pending`, 1 to 32.
    free: u32,
    /// Number of whole words in `room` when the writer was created.
    capacity: usize,
    /// True if bits were discarded because `room` was full.
    is_full: bool,
}

impl<'b> BitWriter<'b> {
    /// Creates a writer that fills the complete 32-bit words of `room`, but not the bytes after
    /// them.
    #[inline]
    fn new(room: &'b mut [u8]) -> Self {
        let (words, _) = room.as_chunks_mut();
        Self { capacity: words.len(), room: words.iter_mut(), pending: 0, free: 32, is_full: false }
    }

    /// Appends the lowest `width` bits of `bits`; its other bits must be 0, and `width` is 1 to 32.
    #[inline]
    fn put(&mut self, bits: u32, width: u32) {
        if width < self.free {
            self.free -= width;
            self.pending |= bits << self.free;
        } else {
            let spilled = width - self.free;
            self.write(self.pending | (bits >> spilled));
            self.free = 32 - spilled;
            // Two shifts, because a single shift by 32, for a `free` of 32, would overflow.
            self.pending = (bits << (self.free - 1)) << 1;
        }
    }

    #[inline]
    fn write(&mut self, word: u32) {
        match self.room.next() {
            Some(place) => *place = word.to_be_bytes(),
            None => self.is_full = true,
        }
    }

    /// Writes the remaining bits and returns the length in bytes; `None` if the bits did not fit.
    fn finish(mut self) -> Option<usize> {
        let whole = self.capacity - self.room.len();
        let rest = (32 - self.free).div_ceil(8);
        if rest > 0 {
            self.write(self.pending);
        }
        (!self.is_full).then_some(whole * 4 + rest as usize)
    }
}
