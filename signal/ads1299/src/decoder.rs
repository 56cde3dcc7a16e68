//! Decoder of the frames that a chain of ADS1299 chips sends: from bytes to counts.

use crate::reading::{NIBBLE, StatusWord};

/// Number of consecutive frames in the other alignment after which the decoder switches to it.
const CHANGE_OVER: u8 = 4;

/// Number of repeated counts at which a chip is reported as frozen. Repetitions are summed over the
/// chip's channels and over consecutive frames in which all of its data repeat. Channels at a rail
/// or at 0 (the value of a channel that is off) are not counted.
///
/// The noise of a shorted channel is 9.4 counts rms at gain 24 and 512 Hz (`typical_noise_uv`). So
/// two consecutive counts are equal by chance with probability `1 / (9.4 sqrt(2) sqrt(2 pi))`, 3 %.
/// In a chain of eight chips, all eight channels of some chip repeat by chance once in twelve
/// years.
///
/// A threshold of five detects the last chip of a 61-electrode cap, which has three spare channels,
/// at its first repetition. A chip with noise on five channels and a rail on three is reported by
/// mistake once a day, for one frame. EEG and mains change the counts by hundreds from sample to
/// sample.
const FROZEN: u8 = 5;

/// Number of bytes that contain a chip's part of the frame in either alignment.
const SPAN: usize = CHIP_BYTES + 1;

/// Decodes a stream of frames: finds the chips' alignment and checks each chip.
///
/// The first frame with a valid chip after chip 0 decides the [`Alignment`]: the decoder takes the
/// alignment in which more chips have a status that starts with 1100. Chip 1 alone is sufficient:
/// read with the wrong alignment, its first four bits are 100x or x110. In later frames a chip
/// whose status does not start with 1100 is only reported as bad. The alignment changes only after
/// four consecutive frames in which every chip fits the other alignment, which no fault of a single
/// chip can cause.
#[derive(Clone, Debug)]
pub struct Decoder<const CHIPS: usize> {
    /// Alignment of the stream; `None` until a frame has a valid chip after chip 0.
    alignment: Option<Alignment>,
    /// Number of consecutive frames, up to the newest, that fit the other alignment.
    against: u8,
    /// Each chip's part of the previous frame, to detect frozen chips.
    last: [Part; CHIPS],
    /// Number of repeated counts of each chip, by the rule at [`FROZEN`]; at most 13, which is
    /// `FROZEN` plus eight channels.
    repeats: [u8; CHIPS],
}

/// Result of decoding a frame: alignment, status words, and bad or frozen chips.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameStatus<const CHIPS: usize> {
    /// Alignment with which this frame was decoded.
    pub alignment: Alignment,
    /// Status word of each chip, chip 0 first.
    pub words: [StatusWord; CHIPS],
    /// Chips whose status does not start with 1100, so that their counts are invalid; one bit each.
    pub bad: u8,
    /// Frozen chips, which repeat their counts; one bit each.
    pub repeated: u8,
}

impl<const CHIPS: usize> FrameStatus<CHIPS> {
    /// Returns whether every chip is neither bad nor frozen.
    pub const fn is_sound(&self) -> bool {
        self.bad | self.repeated == 0
    }
}

impl<const CHIPS: usize> Default for Decoder<CHIPS> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const CHIPS: usize> Decoder<CHIPS> {
    /// Creates a decoder without an alignment. It compiles only for 1 to 8 chips.
    pub const fn new() -> Self {
        const { assert!(CHIPS >= 1 && CHIPS <= MAX_CHIPS, "1 to 8 chips") };
        Self { alignment: None, against: 0, last: [Part::NEVER_SENT; CHIPS], repeats: [0; CHIPS] }
    }

    /// Returns the alignment; `None` until a frame has a valid chip after chip 0.
    pub const fn alignment(&self) -> Option<Alignment> {
        self.alignment
    }

    /// Decodes a frame into `counts` by chip and channel, sign-extended: |count| <= 2^23.
    ///
    /// `BYTES` is [`frame_bytes`] for the number of chips, checked at compile time. For a bad chip,
    /// `counts` receives the bits at the chip's position in the frame, whatever they are.
    ///
    /// # Timing
    /// This is the hot path: no allocation, no panic, no division. For eight chips it extracts 14
    /// status words to check the alignment, and 72 words of 24 bits. The only branch on data is the
    /// choice of the alignment, which a locked stream always takes the same way.
    #[inline]
    pub fn decode<const BYTES: usize>(
        &mut self,
        frame: &[u8; BYTES],
        counts: &mut [[i32; CHANNELS]; CHIPS],
    ) -> FrameStatus<CHIPS> {
        const { assert!(BYTES == frame_bytes(CHIPS), "27 bytes per chip, and one") };
        let alignment = self.align(frame);
        let mut status =
            FrameStatus { alignment, words: [StatusWord(0); CHIPS], bad: 0, repeated: 0 };
        let mut bits = [0_u32; 2];
        let places = counts.iter_mut().zip(&mut self.last).zip(&mut self.repeats);
        for ((chip, span), ((counts, last), repeats)) in (0..).zip(spans(frame)).zip(places) {
            let new = Part::from_span(span, alignment.shift(chip));
            let is_bad = new.word.nibble() != NIBBLE;
            let goes_on = u8::from(!new.differs(last)) & u8::from(!is_bad);
            *repeats = ((*repeats).min(FROZEN) + new.alive()) * goes_on;
            let bad = u32::from(is_bad);
            let repeated = u32::from(*repeats >= FROZEN);
            *counts = new.counts;
            *last = new;
            bits[0] |= bad << chip;
            bits[1] |= repeated << chip;
        }
        for (word, last) in status.words.iter_mut().zip(&self.last) {
            *word = last.word;
        }
        let [bad, repeated] = bits;
        status.bad = (bad & 0xFF) as u8;
        status.repeated = (repeated & 0xFF) as u8;
        status
    }

    /// Returns the alignment for this frame. Locks or switches the alignment of the stream by the
    /// rule stated at [`Decoder`].
    #[inline]
    fn align<const BYTES: usize>(&mut self, frame: &[u8; BYTES]) -> Alignment {
        let mut fits = [0_u32; 2];
        for (chip, span) in (0..).zip(spans(frame)).skip(1) {
            for (fits, alignment) in fits.iter_mut().zip([Alignment::Packed, Alignment::Spaced]) {
                let word = status_word(span, alignment.shift(chip));
                *fits += u32::from(word.nibble() == NIBBLE);
            }
        }
        let [packed, spaced] = fits;
        let Some(locked) = self.alignment else {
            let best = if spaced > packed { Alignment::Spaced } else { Alignment::Packed };
            self.alignment = (packed != spaced).then_some(best);
            return best;
        };
        let others = fits[locked.other() as usize] as usize;
        let speaks_against = u8::from(others + 1 == CHIPS && packed != spaced);
        self.against = (self.against + speaks_against) * speaks_against;
        if self.against < CHANGE_OVER {
            return locked;
        }
        self.against = 0;
        self.alignment = Some(locked.other());
        locked.other()
    }
}

/// Returns, for each chip k, the 27 bytes from byte 27 k of the frame on, and the byte after them.
#[inline]
fn spans(frame: &[u8]) -> impl Iterator<Item = &[u8; SPAN]> {
    frame.array_windows().step_by(CHIP_BYTES)
}

/// Status word and counts of one chip in a frame.
#[derive(Clone, Copy, Debug)]
struct Part {
    word: StatusWord,
    counts: [i32; CHANNELS],
}

impl Part {
    /// Initial value of `Decoder::last`, before the first frame. It equals no chip's data, because
    /// a status word has only 24 bits.
    const NEVER_SENT: Self = Self { word: StatusWord(u32::MAX), counts: [0; CHANNELS] };

    /// Extracts status word and counts from a chip's bytes; `shift` is the start bit in the first
    /// byte, at most 7.
    #[inline]
    fn from_span(span: &[u8; SPAN], shift: u32) -> Self {
        Self {
            word: status_word(span, shift),
            counts: core::array::from_fn(|channel| word(span, channel + 1, shift)),
        }
    }

    #[inline]
    fn differs(&self, other: &Self) -> bool {
        let counts = self.counts.iter().zip(&other.counts);
        let word = self.word.0 ^ other.word.0;
        counts.fold(word, |bits, (one, two)| bits | (one ^ two).cast_unsigned()) != 0
    }

    /// Returns the number of channels whose count is neither at a rail nor 0.
    #[inline]
    fn alive(&self) -> u8 {
        // Maps both rails to 0: -2^23 is the complement of 2^23 - 1.
        let distance = |count: i32| (count ^ (count >> 31)) ^ 0x7F_FFFF;
        let is_alive = |count: &i32| u8::from(*count != 0) & u8::from(distance(*count) != 0);
        self.counts.iter().map(is_alive).sum()
    }
}

/// Extracts the status word of a chip; `shift` is the start bit in the first byte, at most 7.
#[inline]
fn status_word(span: &[u8; SPAN], shift: u32) -> StatusWord {
    StatusWord(word(span, 0, shift).cast_unsigned() & 0xFF_FFFF)
}

/// Extracts the n-th group of 24 bits of a chip, sign-extended; `n <= 8`; `shift` is the start bit
/// in the first byte, at most 7. Every caller's `n` is known at compile time, so no bounds check
/// remains.
#[inline]
fn word(span: &[u8; SPAN], n: usize, shift: u32) -> i32 {
    // Four bytes hold the 24 bits for any start bit in the first byte.
    let bytes = [span[3 * n], span[3 * n + 1], span[3 * n + 2], span[3 * n + 3]];
    (u32::from_be_bytes(bytes) << shift).cast_signed() >> 8
}

/// Spacing of the chips' parts in a frame. The data sheet draws a don't-care bit between two chips
/// of a daisy chain (revision A, figure 41); other sources report 27 bytes per chip without it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Alignment {
    /// Without a don't-care bit: chip k starts at bit 216 k.
    Packed = 0,
    /// With a don't-care bit between two chips: chip k starts at bit 217 k.
    Spaced = 1,
}

impl Alignment {
    /// Returns the number of bits from byte `27 * chip` of the frame to the start of the part of
    /// chip `chip`: 0 to 7 for `chip` < 8.
    #[inline]
    pub(crate) const fn shift(self, chip: u32) -> u32 {
        // A product replaces a branch; the mask shows the compiler that the result is at most 7.
        (self as u32 * chip) & 7
    }

    pub(crate) const fn other(self) -> Self {
        match self {
            Self::Packed => Self::Spaced,
            Self::Spaced => Self::Packed,
        }
    }
}

/// Number of channels of an ADS1299.
pub const CHANNELS: usize = 8;

/// Bytes per chip in a frame: 24 status bits and eight 24-bit counts (data sheet section 9.4.4).
pub const CHIP_BYTES: usize = 3 + 3 * CHANNELS;

/// Longest chain, in chips. The don't-care bits of eight chips still fit the frame's extra byte.
pub const MAX_CHIPS: usize = 8;

/// Returns the number of bytes to clock per frame: 27 per chip, and one for the don't-care bits
/// that the chain may insert between chips. The result is 217 for eight chips.
pub const fn frame_bytes(chips: usize) -> usize {
    CHIP_BYTES * chips + 1
}
