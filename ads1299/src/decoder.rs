//! From the bytes of a frame to counts.

use crate::CHANNELS;
use crate::CHIP_BYTES;
use crate::MAX_CHIPS;
use crate::alignment::Alignment;
use crate::frame_bytes;
use crate::status_word::NIBBLE;
use crate::status_word::{ChipFault, StatusWord};

/// Frames in a row that must speak for the other alignment before the decoder changes over.
const CHANGE_OVER: u8 = 4;

/// Channels that must have repeated themselves, one frame after the other, for a chip to be taken for
/// frozen; those that are at a rail or read 0, as a channel that is off does, say nothing.
///
/// The noise of a shorted channel is 9.4 counts rms at gain 24 and 512 Hz (`typical_noise_uv`), so
/// that two counts are equal by chance in `1 / (9.4 sqrt(2) sqrt(2 pi))` = 3 % of all cases: eight
/// channels of eight chips once in twelve years. With five, the spare channels of 61 electrodes still
/// leave the last chip to be found by its first repetition; five channels without any signal beside
/// three at a rail are equal by chance once a day, for one frame. EEG and mains move counts by
/// hundreds.
const FROZEN: u8 = 5;

/// Bytes in which a chip's bits lie, whatever the alignment.
const SPAN: usize = CHIP_BYTES + 1;

/// Finds the chips in a frame and checks each; state of a stream of frames.
///
/// The first frame decides the [`Alignment`], by the number of chips whose status begins with 1100.
/// Chip 1 alone tells the two apart for certain: taken for the other, its nibble would be 100x or
/// x110. Later frames only count misses, unless the other alignment fits every chip in
/// four frames in a row, which no fault of a single chip looks like.
#[derive(Clone, Debug)]
pub struct Decoder<const CHIPS: usize> {
    /// None before the first frame with a sound chip behind chip 0.
    alignment: Option<Alignment>,
    /// Frames in a row that spoke for the other alignment.
    against: u8,
    /// The frame before, for [`ChipFault::Repeated`].
    last: [Part; CHIPS],
    /// Channels that have repeated themselves in a row of frames, at most 13.
    repeats: [u8; CHIPS],
    counters: Counters<CHIPS>,
}

/// What a decoder has counted; every counter wraps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counters<const CHIPS: usize> {
    /// Frames decoded.
    pub frames: u32,
    /// Frames in which a chip's status did not begin with 1100, per chip.
    pub bad_status: [u32; CHIPS],
    /// Frames in which a chip was frozen, per chip.
    pub repeated: [u32; CHIPS],
    /// Changes of the alignment after the first lock.
    pub realigned: u32,
}

/// What stood beside the counts of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameStatus<const CHIPS: usize> {
    /// Where the chips stood.
    pub alignment: Alignment,
    /// Each chip's status word.
    pub words: [StatusWord; CHIPS],
    /// Chips whose status does not begin with 1100, one bit each: their counts mean nothing.
    pub bad: u8,
    /// Chips that are frozen, one bit each: they repeat themselves.
    pub repeated: u8,
}

impl<const CHIPS: usize> Counters<CHIPS> {
    /// Counts a frame with these chips bad and repeated, one bit each.
    #[inline]
    fn count(&mut self, bad: u32, repeated: u32) {
        self.frames = self.frames.wrapping_add(1);
        for (bits, counters) in [(bad, &mut self.bad_status), (repeated, &mut self.repeated)] {
            for (chip, counter) in (0..).zip(counters) {
                *counter = counter.wrapping_add(bits >> chip & 1);
            }
        }
    }
}

impl<const CHIPS: usize> FrameStatus<CHIPS> {
    /// Whether every chip is sound.
    pub const fn is_sound(&self) -> bool {
        self.bad | self.repeated == 0
    }

    /// What is wrong with a chip.
    pub fn fault(&self, chip: usize) -> Option<ChipFault> {
        let repeated = self.repeated >> chip & 1 != 0;
        let word = self.words.get(chip)?;
        word.fault().or(repeated.then_some(ChipFault::Repeated))
    }

    /// The chips with a fault, and what it is. In a chain a dead or late chip takes those behind it
    /// with it: the first one is the culprit.
    pub fn faults(&self) -> impl Iterator<Item = (usize, ChipFault)> + '_ {
        (0..CHIPS).filter_map(|chip| Some((chip, self.fault(chip)?)))
    }
}

impl<const CHIPS: usize> Default for Decoder<CHIPS> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const CHIPS: usize> Decoder<CHIPS> {
    /// Before the first frame; 1 to 8 chips, checked when it is compiled.
    pub const fn new() -> Self {
        const { assert!(CHIPS >= 1 && CHIPS <= MAX_CHIPS, "1 to 8 chips") };
        Self {
            alignment: None,
            against: 0,
            last: [Part::NEVER_SENT; CHIPS],
            repeats: [0; CHIPS],
            counters: Counters {
                frames: 0,
                bad_status: [0; CHIPS],
                repeated: [0; CHIPS],
                realigned: 0,
            },
        }
    }

    /// What has been counted since the start.
    pub const fn counters(&self) -> &Counters<CHIPS> {
        &self.counters
    }

    /// The alignment, once known.
    pub const fn alignment(&self) -> Option<Alignment> {
        self.alignment
    }

    /// Counts of a frame, 24-bit two's complement in 32, |count| <= 2^23, by chip and channel.
    ///
    /// `BYTES` is [`frame_bytes`] of the chips, checked when it is compiled. A chip that is flagged
    /// as bad still gives what stands in its place.
    ///
    /// # Timing
    /// The hot path: no allocation, no panic, no division; 16 nibbles and 72 words for eight chips.
    /// The only branch on data is the choice of the alignment, which a locked stream always takes
    /// the same way.
    #[inline]
    pub fn decode<const BYTES: usize>(
        &mut self,
        frame: &[u8; BYTES],
        counts: &mut [[i32; CHANNELS]; CHIPS],
    ) -> FrameStatus<CHIPS> {
        const { assert!(BYTES == frame_bytes(CHIPS), "27 bytes per chip, and one") };
        let alignment = self.align(frame);
        let mut status = FrameStatus {
            alignment,
            words: [StatusWord(0); CHIPS],
            bad: 0,
            repeated: 0,
        };
        let mut bits = [0_u32; 2];
        let places = counts.iter_mut().zip(&mut self.last).zip(&mut self.repeats);
        for ((chip, span), ((counts, last), repeats)) in (0..).zip(spans(frame)).zip(places) {
            let new = Part::of(span, alignment.shift(chip));
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
        self.counters.count(bad, repeated);
        status.bad = (bad & 0xFF) as u8;
        status.repeated = (repeated & 0xFF) as u8;
        status
    }

    /// The alignment for this frame; changes the locked one as [`Decoder`] says.
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
            let best = if spaced > packed {
                Alignment::Spaced
            } else {
                Alignment::Packed
            };
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
        self.counters.realigned = self.counters.realigned.wrapping_add(1);
        locked.other()
    }
}

/// The bytes of each chip, and the one behind them.
#[inline]
fn spans(frame: &[u8]) -> impl Iterator<Item = &[u8; SPAN]> {
    frame.array_windows().step_by(CHIP_BYTES)
}

/// A chip's part of a frame.
#[derive(Clone, Copy, Debug)]
struct Part {
    word: StatusWord,
    counts: [i32; CHANNELS],
}

impl Part {
    /// What no chip sends.
    const NEVER_SENT: Self = Self {
        word: StatusWord(u32::MAX),
        counts: [0; CHANNELS],
    };

    /// From its bytes; `shift <= 7`.
    #[inline]
    fn of(span: &[u8; SPAN], shift: u32) -> Self {
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

    /// Channels that are neither at a rail nor at 0.
    #[inline]
    fn alive(&self) -> u8 {
        // -2^23 is the complement of 2^23 - 1.
        let distance = |count: i32| (count ^ (count >> 31)) ^ 0x7F_FFFF;
        let is_alive = |count: &i32| u8::from(*count != 0) & u8::from(distance(*count) != 0);
        self.counts.iter().map(is_alive).sum()
    }
}

/// The status word of a chip; `shift <= 7`.
#[inline]
fn status_word(span: &[u8; SPAN], shift: u32) -> StatusWord {
    StatusWord(word(span, 0, shift).cast_unsigned() & 0xFF_FFFF)
}

/// The n-th 24 bits of a chip, sign-extended; `n <= 8`, and every caller's n is known when it is
/// compiled, so that no check is left; `shift <= 7`.
#[inline]
fn word(span: &[u8; SPAN], n: usize, shift: u32) -> i32 {
    // Four bytes hold 24 bits wherever in the first byte they begin.
    let bytes = [
        span[3 * n],
        span[3 * n + 1],
        span[3 * n + 2],
        span[3 * n + 3],
    ];
    (u32::from_be_bytes(bytes) << shift).cast_signed() >> 8
}
