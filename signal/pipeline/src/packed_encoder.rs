//! Encoder of the packed code: one block of few bits for each hop.

use int8_nn::{Pair, requantise};
use model::{ELECTRODES, HOP, PACKED, PACKED_COEFFICIENTS, PACKED_INPUT_PAIRS, Packed};
use packed::{Context, Header, Magnitude, PROBE_SHIFT, PROBES, Rate, Survivors};

use crate::sample::Step;

/// Encodes each hop's steps as a block that is predicted from the block before it.
///
/// The analysis transform is accumulated as the steps arrive, and the prediction is computed when a
/// block's first step arrives, so only quantiser and range coder are left after the last step.
///
/// Without a packed model the encoder returns no blocks and takes only a few bytes of memory.
#[derive(Clone, Debug)]
pub struct PackedEncoder {
    memory: PackedMemory,
    /// Quantiser rate of the next block.
    rate: Rate,
}

impl PackedEncoder {
    /// Quantiser rate of a device until its host sets another.
    pub const DEFAULT_RATE: Rate = match PACKED {
        Some(packed) => match Rate::new(packed.rate) {
            Some(rate) => rate,
            None => Rate::MIDDLE,
        },
        None => Rate::MIDDLE,
    };

    /// Creates an encoder with the built-in model.
    pub const fn new() -> Self {
        Self { memory: PackedMemory::EMPTY, rate: Self::DEFAULT_RATE }
    }

    /// Resets the encoder in place: the next step is the first of a stream.
    pub fn restart(&mut self) {
        self.memory.restart();
    }

    /// Sets the quantiser rate, for the next block that is completed and all later ones.
    pub fn set_rate(&mut self, rate: Rate) {
        self.rate = rate;
    }

    /// Returns the coefficients that a decoder has after it has read all blocks so far. Call this
    /// before the first step of the next block, which replaces the coefficients by their prediction
    /// for that block.
    pub fn state(&self) -> &[i16] {
        &self.memory.state
    }

    /// Encodes the next step; returns a block if the step completes a hop.
    pub fn encode_step(&mut self, step: &Step) -> Option<PackedCode> {
        self.memory.encode_step(step, self.rate)
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
#[expect(clippy::struct_excessive_bools, reason = "each of them can be true with any other")]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PackedCode {
    /// Index of the block in the run, from 0; wraps. Block `n` covers the steps from `n * HOP` on.
    pub block: u32,
    /// Time by which the block's last step follows the ADC sample that completed the block, in
    /// microseconds; see [`Step::offset_us`](crate::Step::offset_us).
    pub offset_us: u16,
    /// Number of electrode values of the block that were clipped to the range of the inputs.
    pub clipped: u16,
    /// ADC channels at the rail in any sample since the step before the block; bit n is channel n.
    pub saturated: u64,
    /// True if the filters had not settled at the block's first step.
    pub settling: bool,
    /// Quantiser rate of the stream, 0 (finest) to 15. A block that was too long has a coarser
    /// rate, which its bytes state.
    pub rate: u8,
    /// True if the block has no prediction, so that a decoder can start with it.
    pub is_reset: bool,
    /// True if the model does not represent the block well, for example because an electrode has no
    /// contact or the cap is not the model's.
    pub is_misfit: bool,
    /// True if the block was too long at both rates that were tried: all its magnitudes are 0, and
    /// a decoder uses the prediction as the block's coefficients.
    pub is_blank: bool,
    length: u16,
    buffer: [u8; MAX_PACKED_BYTES],
}

impl PackedCode {
    /// Returns the bytes of the block, at most [`MAX_PACKED_BYTES`].
    pub fn bytes(&self) -> &[u8] {
        self.buffer.get(..usize::from(self.length)).unwrap_or_default()
    }
}

/// Interval between blocks without prediction, in blocks: 4 s with a hop of 8 steps. The missing
/// predictions cost 0.5 % of the bits.
const RESET_BLOCKS: u8 = 64;

/// Number of excess bytes per additional rate: a block that is n bytes too long is quantised again
/// `1 + n / BYTES_PER_RATE` rates coarser, rounded up. This was measured on 28,693 blocks of the
/// default model that were too long (EEG, EEG up to ten times as large, noise and impulses): at the
/// coarser rate all of them fit, and that rate was on average 1.4 rates coarser than necessary.
/// With 26 instead of 22, four blocks did not fit.
const BYTES_PER_RATE: usize = 22;

/// Share of a block's energy that the coefficients may fail to represent before the block counts as
/// a misfit, as a right shift: a sixty-fourth. The analysis loses some energy because its weights
/// are rounded.
const MISFIT_SHIFT: u32 = 6;

/// State and scratch memory of a [`PackedEncoder`], about 6 KB: place it in a static, not on a
/// stack. All of it is initially zero, so that it takes no flash.
#[derive(Clone, Debug)]
pub struct PackedMemory {
    /// Input values of the block, step by step, in the order of the electrodes; then zeros.
    inputs: [Pair; PACKED_INPUT_PAIRS],
    /// Sum of the analysis products so far, for each coefficient.
    sums: [i32; PACKED_COEFFICIENTS],
    /// Coefficients that a decoder has after the previous block; from the first step of a block on,
    /// the prediction of that block's coefficients.
    state: [i16; PACKED_COEFFICIENTS],
    /// Each coefficient minus its prediction; the quantiser's input.
    residual: [i32; PACKED_COEFFICIENTS],
    contexts: [Context; PACKED_COEFFICIENTS],
    survivors: [Survivors; PACKED_COEFFICIENTS],
    magnitudes: [Magnitude; PACKED_COEFFICIENTS],
    /// Sum of the squares of the block's input values so far.
    energy: i64,
    /// Number of steps of the block so far.
    steps: u8,
    /// Number of blocks since the last block without prediction.
    since_reset: u8,
    block: u32,
    offset_us: u16,
    clipped: u16,
    saturated: u64,
    settling: bool,
}

impl PackedMemory {
    /// Memory of an encoder before its first step, all zeros.
    pub const EMPTY: Self = Self {
        inputs: [Pair::ZERO; PACKED_INPUT_PAIRS],
        sums: [0; PACKED_COEFFICIENTS],
        state: [0; PACKED_COEFFICIENTS],
        residual: [0; PACKED_COEFFICIENTS],
        contexts: [Context::EMPTY; PACKED_COEFFICIENTS],
        survivors: [0; PACKED_COEFFICIENTS],
        magnitudes: [Magnitude::ZERO; PACKED_COEFFICIENTS],
        energy: 0,
        steps: 0,
        since_reset: 0,
        block: 0,
        offset_us: 0,
        clipped: 0,
        saturated: 0,
        settling: false,
    };

    /// Resets the memory in place: the next step is the first of a stream.
    pub fn restart(&mut self) {
        *self = Self::EMPTY;
    }

    /// Encodes the next step with the built-in model; returns a block at `rate` if the step
    /// completes a hop.
    pub fn encode_step(&mut self, step: &Step, rate: Rate) -> Option<PackedCode> {
        self.encode_step_with(step, rate, PACKED.as_ref()?)
    }

    /// Encodes the next step with the model `packed`; returns a block at `rate` if the step
    /// completes a hop. All steps of a stream need the same model.
    pub fn encode_step_with(
        &mut self,
        step: &Step,
        rate: Rate,
        packed: &Packed<'_>,
    ) -> Option<PackedCode> {
        self.add_step(step, packed);
        if usize::from(self.steps) < HOP {
            return None;
        }
        let code = self.encode(rate, packed);
        self.begin_next();
        Some(code)
    }

    /// Adds a step to the block: the step's inputs, its status, and the products of the groups of
    /// inputs that the step completes.
    fn add_step(&mut self, step: &Step, packed: &Packed<'_>) {
        let index = usize::from(self.steps);
        if index == 0 {
            self.predict(packed);
            self.settling = step.settling;
        }
        self.saturated |= step.saturated;
        self.offset_us = step.offset_us;
        self.add_inputs(index * ELECTRODES, step, packed);
        let slice = &packed.analysis[index % HOP];
        let inputs = self.inputs.get(slice.first..).unwrap_or_default();
        // `try_accumulate` returns false for a slice without inputs, which has nothing to add.
        // Every other slice fits, as an assertion at compile time checks.
        let _ = slice.matrix.try_accumulate(inputs, &mut self.sums);
        self.steps += 1;
    }

    /// Replaces the state by the prediction of the next block, and clears the sums.
    #[inline(never)]
    fn predict(&mut self, packed: &Packed<'_>) {
        let mut inputs = [Pair::ZERO; PACKED_COEFFICIENTS / 2];
        Pair::fill(&mut inputs, self.state.iter().map(|&state| rounded(state)));
        self.sums.fill(0);
        let _ = packed.prediction.try_accumulate(&inputs, &mut self.sums);
        let factors = packed.prediction_factors;
        for ((state, sum), &factor) in self.state.iter_mut().zip(&self.sums).zip(factors) {
            *state = saturate_i16(requantise(*sum, factor));
        }
        if self.is_reset() {
            self.state.fill(0);
        }
        self.sums.fill(0);
    }

    fn is_reset(&self) -> bool {
        self.since_reset == 0
    }

    /// Stores a step's electrodes as the input values `first..first + ELECTRODES` of the block, and
    /// adds up their energy and the number of clipped values.
    #[inline(never)]
    fn add_inputs(&mut self, first: usize, step: &Step, packed: &Packed<'_>) {
        let mut clipped = 0;
        // The sum of at most 64 squares of 15-bit values, which cannot overflow.
        let mut energy = 0_u64;
        let mut values = step.electrodes.iter().map(|&electrode| {
            let value = requantise(electrode, packed.input_multiplier);
            let limited = value.clamp(-packed.input_limit, packed.input_limit);
            clipped += u16::from(limited != value);
            energy += u64::from((limited * limited).cast_unsigned());
            saturate_i16(limited)
        });
        let Some(places) = self.inputs.get_mut(first / 2..) else {
            return;
        };
        // If an odd number of values is already stored, the first new value fills the second half
        // of the last pair.
        let places = match places {
            [half, rest @ ..] if first % 2 == 1 => {
                *half = half.with(1, values.next().unwrap_or(0));
                rest
            }
            whole => whole,
        };
        Pair::fill(places, values);
        self.clipped = self.clipped.saturating_add(clipped);
        self.energy += energy.cast_signed();
    }

    /// Quantises and writes the complete block; repeats both at a coarser rate if the result is too
    /// long. Then computes the state after the block.
    fn encode(&mut self, announced: Rate, packed: &Packed<'_>) -> PackedCode {
        let unrepresented = self.take_residual(packed);
        let is_reset = self.is_reset();
        let mut buffer = [0; MAX_PACKED_BYTES];
        let header = |rate| Header { rate, is_reset };
        let mut rate = announced;
        let mut length = self.write(header(rate), announced, packed, &mut buffer);
        if length > MAX_PACKED_BYTES {
            let coarser = 1 + (length - MAX_PACKED_BYTES).div_ceil(BYTES_PER_RATE);
            rate = announced.coarser(u8::try_from(coarser).unwrap_or(u8::MAX));
            length = self.write(header(rate), announced, packed, &mut buffer);
        }
        let is_blank = length > MAX_PACKED_BYTES;
        if is_blank {
            rate = announced;
            self.magnitudes.fill(Magnitude::ZERO);
            self.prepare_contexts(header(rate), packed);
            length = self.write_prepared(header(rate), announced, packed, &mut buffer);
        }
        packed::update_state(&self.magnitudes, rate, &mut self.state);
        PackedCode {
            block: self.block,
            offset_us: self.offset_us,
            clipped: self.clipped,
            saturated: self.saturated,
            settling: self.settling,
            rate: announced.index(),
            is_reset,
            is_misfit: unrepresented
                > packed.misfit_energy.wrapping_abs() + (self.energy >> MISFIT_SHIFT),
            is_blank,
            length: u16::try_from(length).unwrap_or(0),
            buffer,
        }
    }

    /// Stores coefficients minus prediction as the residual, and returns the part of the inputs'
    /// energy that the coefficients do not represent. In a weighted model, marked by a negative
    /// `misfit_energy`, this energy is estimated from the probes, which are the last coefficients.
    #[inline(never)]
    fn take_residual(&mut self, packed: &Packed<'_>) -> i64 {
        let mut energy = self.energy;
        let sums = self.sums.iter().zip(packed.analysis_factors);
        let places = self.residual.iter_mut().zip(&self.state);
        for ((sum, &factor), (residual, &prediction)) in sums.zip(places) {
            let coefficient = saturate_i16(requantise(*sum, factor));
            energy -= i64::from(i32::from(coefficient) * i32::from(coefficient));
            *residual = i32::from(coefficient) - i32::from(prediction);
        }
        if packed.misfit_energy < 0 {
            let probes = self.residual.iter().zip(&self.state).rev().take(PROBES);
            let squares = probes.map(|(&residual, &prediction)| {
                let probe = residual + i32::from(prediction);
                i64::from(probe * probe)
            });
            energy = squares.sum::<i64>() << PROBE_SHIFT;
        }
        energy
    }

    /// Quantises the residual at the header's rate and writes the block to `bytes`; returns the
    /// length of the block in bytes.
    #[inline(never)]
    fn write(
        &mut self,
        header: Header,
        announced: Rate,
        packed: &Packed<'_>,
        bytes: &mut [u8],
    ) -> usize {
        self.prepare_contexts(header, packed);
        packed::quantise(
            &self.residual,
            &self.contexts,
            &packed.tables,
            header.rate,
            &mut self.survivors,
            &mut self.magnitudes,
        );
        self.write_prepared(header, announced, packed, bytes)
    }

    /// Prepares each magnitude's context for the range coder, for a block with this header.
    #[inline(never)]
    fn prepare_contexts(&mut self, header: Header, packed: &Packed<'_>) {
        let levels = if header.is_reset { packed.reset_levels } else { packed.predicted_levels };
        packed::prepare_contexts(levels, header.rate, &mut self.contexts);
    }

    /// Writes the block's magnitudes with the prepared contexts; returns the number of bytes.
    #[inline(never)]
    fn write_prepared(
        &self,
        header: Header,
        announced: Rate,
        packed: &Packed<'_>,
        bytes: &mut [u8],
    ) -> usize {
        packed::write_block(
            header,
            announced,
            &self.magnitudes,
            &self.contexts,
            &packed.tables,
            bytes,
        )
    }

    /// Advances to the next block, and clears the counters and status of the completed one.
    fn begin_next(&mut self) {
        self.block = self.block.wrapping_add(1);
        self.since_reset = (self.since_reset + 1) % RESET_BLOCKS;
        self.steps = 0;
        self.energy = 0;
        self.clipped = 0;
        self.saturated = 0;
    }
}

/// Returns a coefficient of the state as the prediction reads it: divided by 8, rounded half up.
#[expect(clippy::cast_possible_truncation, reason = "an eighth of 16 bits")]
fn rounded(coefficient: i16) -> i16 {
    ((i32::from(coefficient) + 4) >> 3) as i16
}

#[expect(clippy::cast_possible_truncation, reason = "clamped to 16 bits")]
fn saturate_i16(value: i32) -> i16 {
    value.clamp(i16::MIN.into(), i16::MAX.into()) as i16
}
