//! One block as bytes: its header (rate and kind), then its magnitudes.

use crate::context::{Context, Place, symbols};
use crate::quantiser::Magnitude;
use crate::range_coder::{RangeDecoder, RangeEncoder};
use crate::rate::Rate;
use crate::tables::{ESCAPE, FREQUENCY_BITS, Frequencies, MAGNITUDES, Tables};

/// Largest number of ones at the start of an Elias gamma code, because magnitudes are below 2^16.
const MAX_GAMMA_BITS: u32 = 15;

/// Cumulative frequencies at which the three symbols that can start a block begin, and at which the
/// last one ends. Symbol 0 means: announced rate, predicted. Symbol 1: announced rate, reset.
/// Symbol 2: another rate; four bits with the rate and one bit for a reset follow.
const START_SYMBOLS: [u16; 4] = [0, 30_720, 32_256, 32_768];

/// Rate and kind of a block, which its first bits state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Rate with which this block was quantised.
    pub rate: Rate,
    /// True if the block was coded with a prediction of 0, so that decoding needs no earlier block.
    pub is_reset: bool,
}

/// Writes a block. `announced` is the rate that the decoder expects; a block with another rate
/// takes up to 11 bits more.
///
/// Returns the length of the block in bytes. If it is larger than `bytes`, the block did not fit,
/// and the content of `bytes` is useless.
///
/// # Timing
/// Depends on the magnitudes: about 100 instructions for a magnitude of 0 and 70 more for each
/// byte, on a Cortex-M4.
pub fn write_block(
    header: Header,
    announced: Rate,
    magnitudes: &[Magnitude],
    contexts: &[Context],
    tables: &Tables<'_>,
    bytes: &mut [u8],
) -> usize {
    let mut encoder = RangeEncoder::new(bytes);
    write_header(header, announced, &mut encoder);
    for symbol in symbols(magnitudes, contexts) {
        let starts = &tables.starts[symbol.quantiser][symbol.level];
        write_magnitude(symbol.magnitude, starts, &mut encoder);
    }
    encoder.finish()
}

fn write_header(header: Header, announced: Rate, encoder: &mut RangeEncoder<'_>) {
    let symbol = match (header.rate == announced, header.is_reset) {
        (true, false) => 0,
        (true, true) => 1,
        (false, _) => 2,
    };
    let [start, end] = [START_SYMBOLS[symbol], START_SYMBOLS[symbol + 1]].map(u32::from);
    let frequencies = Frequencies { start, count: end - start };
    encoder.put(frequencies, FREQUENCY_BITS);
    if symbol == 2 {
        for bit in (0..4).rev() {
            encoder.put_bit(header.rate.index() >> bit & 1 != 0);
        }
        encoder.put_bit(header.is_reset);
    }
}

#[inline(always)]
fn write_magnitude(
    magnitude: Magnitude,
    starts: &[u16; MAGNITUDES],
    encoder: &mut RangeEncoder<'_>,
) {
    let symbol = magnitude.value.min(ESCAPE);
    let frequencies = Frequencies::of_magnitude(starts, symbol.into());
    encoder.put(frequencies, FREQUENCY_BITS);
    if symbol == ESCAPE {
        write_gamma(u32::from(magnitude.value - ESCAPE) + 1, encoder);
    }
    if symbol > 0 {
        encoder.put_bit(magnitude.is_negative);
    }
}

/// Writes the Elias gamma code of a number of at least 1: a 1 for each bit after the number's
/// leading bit, then a 0, then the bits after the leading bit.
#[cold]
fn write_gamma(number: u32, encoder: &mut RangeEncoder<'_>) {
    let bits = number.ilog2();
    for _ in 0..bits {
        encoder.put_bit(true);
    }
    encoder.put_bit(false);
    for bit in (0..bits).rev() {
        encoder.put_bit(number >> bit & 1 != 0);
    }
}

/// Reads a block: first its header, which tells the caller which contexts to prepare, then its
/// magnitudes.
#[derive(Clone, Debug)]
pub struct BlockReader<'b> {
    decoder: RangeDecoder<'b>,
    header: Header,
}

impl<'b> BlockReader<'b> {
    /// Reads the header of a block. `announced` must be the rate that was passed to
    /// [`write_block`].
    ///
    /// # Errors
    /// If the last byte is 0, which no encoder sends, or the header is invalid.
    pub fn new(bytes: &'b [u8], announced: Rate) -> Result<Self, Malformed> {
        if bytes.last() == Some(&0) {
            return Err(Malformed);
        }
        let mut decoder = RangeDecoder::new(bytes);
        let [first, second, third, end] = START_SYMBOLS;
        let mut starts = [u16::MAX; MAGNITUDES];
        starts[..4].copy_from_slice(&[first, second, third, end]);
        let header = match decoder.symbol(&starts) {
            symbol @ (0 | 1) => Header { rate: announced, is_reset: symbol == 1 },
            2 => {
                let index = (0..4).fold(0, |index, _| index << 1 | u8::from(decoder.bit()));
                Header { rate: Rate::new(index).ok_or(Malformed)?, is_reset: decoder.bit() }
            }
            _ => return Err(Malformed),
        };
        Ok(Self { decoder, header })
    }

    /// Returns the rate and kind of the block.
    pub fn header(&self) -> Header {
        self.header
    }

    /// Reads the magnitudes; `contexts` must be prepared for the header's rate and kind.
    ///
    /// # Errors
    /// If bytes are left over, or a magnitude is too large for an encoder to have written it.
    pub fn read_magnitudes(
        mut self,
        contexts: &[Context],
        tables: &Tables<'_>,
        magnitudes: &mut [Magnitude],
    ) -> Result<(), Malformed> {
        let mut place = Place::START;
        for (context, magnitude) in contexts.iter().zip(magnitudes) {
            let starts = &tables.starts[place.quantiser()][place.level(*context)];
            *magnitude = self.read_magnitude(starts)?;
            place.advance(*magnitude);
        }
        if self.decoder.has_unread_bytes() {
            return Err(Malformed);
        }
        Ok(())
    }

    fn read_magnitude(&mut self, starts: &[u16; MAGNITUDES]) -> Result<Magnitude, Malformed> {
        #[expect(clippy::cast_possible_truncation, reason = "at most 15")]
        let mut value = self.decoder.symbol(starts) as u16;
        if value == ESCAPE {
            value = self.read_gamma()?;
        }
        let is_negative = value > 0 && self.decoder.bit();
        Ok(Magnitude { value, is_negative })
    }

    fn read_gamma(&mut self) -> Result<u16, Malformed> {
        let mut bits = 0;
        while self.decoder.bit() {
            bits += 1;
            if bits > MAX_GAMMA_BITS {
                return Err(Malformed);
            }
        }
        let number = (0..bits).fold(1_u32, |number, _| number << 1 | u32::from(self.decoder.bit()));
        u16::try_from(number - 1 + u32::from(ESCAPE)).map_err(|_| Malformed)
    }
}

/// Error: no encoder with these tables and contexts writes these bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Malformed;

impl core::fmt::Display for Malformed {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("the bytes are no block of this model and rate")
    }
}

impl core::error::Error for Malformed {}
