//! The streaming packed encoder writes the same blocks as a reference that computes each block at
//! once, in plain loops. The model is the built-in one, or the one that `CORTICODE_ARTIFACT` names.
//!
//! Quantiser and range coder come from the crate `packed`, which
//! `tests/acceptance/tests/it/packed_python.rs` compares with Python.

use std::sync::LazyLock;

use artifact::{Artifact, PackedModel};
use int8_nn::requantise;
use model::{GUARD_BITS, HOP, LSB_NV};
use packed::{Context, Header, Magnitude, Rate, Tables};
use pipeline::{ELECTRODES, MAX_PACKED_BYTES, PackedEncoder, Step};
use proptest::prelude::*;

static ARTIFACT: LazyLock<Artifact> = LazyLock::new(|| {
    Artifact::from_files(model::artifact_files::FILES).expect("the artifact is readable")
});

/// Returns whether the model is the checked-in one.
fn is_built_in() -> bool {
    option_env!("CORTICODE_ARTIFACT").is_none()
}

/// The reference encoder, which processes a whole block at a time.
struct Reference {
    model: PackedModel,
    state: Vec<i16>,
    blocks: usize,
    /// True if the newest block was quantised again at a coarser rate, and is not blank.
    coarser: bool,
}

/// Content and status of a block, as far as the test compares them.
#[derive(Debug, PartialEq)]
struct Block {
    bytes: Vec<u8>,
    clipped: u16,
    is_reset: bool,
    is_blank: bool,
    is_misfit: bool,
}

impl Reference {
    fn code(&mut self, steps: &[Step], announced: Rate) -> Block {
        let unit = f64::from(LSB_NV) / 1_000.0 / f64::from(1_u32 << GUARD_BITS);
        #[expect(clippy::cast_possible_truncation, reason = "below 1/2")]
        let multiplier = (unit / self.model.description.unit_uv * 2_f64.powi(32)).round() as i32;
        let limit = i32::from(self.model.description.input_limit);
        let mut clipped = 0;
        let values = steps.iter().flat_map(|step| step.electrodes).map(|electrode| {
            let value = requantise(electrode, multiplier);
            clipped += u16::from(value.abs() > limit);
            i16::try_from(value.clamp(-limit, limit)).expect("limited")
        });
        let values: Vec<i16> = values.collect();
        let coefficients = self.model.analyse(&values);
        let is_misfit = self.is_misfit(&values, &coefficients);
        let is_reset = self.blocks.is_multiple_of(64);
        self.state =
            if is_reset { vec![0; coefficients.len()] } else { self.model.predict(&self.state) };
        let residual: Vec<i32> = coefficients
            .iter()
            .zip(&self.state)
            .map(|(&y, &p)| i32::from(y) - i32::from(p))
            .collect();
        let (mut bytes, mut magnitudes) =
            self.write(announced, announced, is_reset, Some(&residual));
        let mut rate = announced;
        if bytes.len() > MAX_PACKED_BYTES {
            let over = (bytes.len() - MAX_PACKED_BYTES).div_ceil(22);
            rate = announced.coarser(u8::try_from(1 + over).unwrap_or(u8::MAX));
            (bytes, magnitudes) = self.write(rate, announced, is_reset, Some(&residual));
        }
        let is_blank = bytes.len() > MAX_PACKED_BYTES;
        if is_blank {
            rate = announced;
            (bytes, magnitudes) = self.write(rate, announced, is_reset, None);
        }
        packed::update_state(&magnitudes, rate, &mut self.state);
        self.blocks += 1;
        self.coarser = rate != announced;
        Block { bytes, clipped, is_reset, is_blank, is_misfit }
    }

    /// Returns whether the energy that the coefficients do not represent exceeds the sum of the
    /// model's limit and a sixty-fourth of the block's energy.
    fn is_misfit(&self, values: &[i16], coefficients: &[i16]) -> bool {
        let energy =
            |numbers: &[i16]| -> f64 { numbers.iter().map(|&n| f64::from(n).powi(2)).sum() };
        let description = &self.model.description;
        #[expect(clippy::cast_precision_loss, reason = "a few hundred values")]
        let permitted = description.misfit_uv2 / description.unit_uv.powi(2) * values.len() as f64;
        // The encoder compares integers, so the limits are rounded down; a block exactly at the
        // limit is no misfit.
        let permitted = permitted.floor() + (energy(values) / 64.0).floor();
        assert!(description.weight.is_none(), "probes are tested in the crate device");
        energy(values) - energy(coefficients) > permitted
    }

    /// Quantises a residual and codes it; returns the block's bytes and magnitudes. If the residual
    /// is `None`, all magnitudes are 0.
    fn write(
        &self,
        rate: Rate,
        announced: Rate,
        is_reset: bool,
        residual: Option<&[i32]>,
    ) -> (Vec<u8>, Vec<Magnitude>) {
        let levels = if is_reset { &self.model.reset_levels } else { &self.model.predicted_levels };
        let mut contexts = vec![Context::EMPTY; levels.len()];
        packed::prepare_contexts(levels, rate, &mut contexts);
        let costs = self.model.costs();
        let tables = Tables { starts: &self.model.starts, costs: &costs };
        let mut magnitudes = vec![Magnitude::ZERO; levels.len()];
        let mut survivors = vec![0; levels.len()];
        if let Some(residual) = residual {
            packed::quantise(residual, &contexts, &tables, rate, &mut survivors, &mut magnitudes);
        }
        let mut bytes = vec![0; 4_096];
        let header = Header { rate, is_reset };
        let length =
            packed::write_block(header, announced, &magnitudes, &contexts, &tables, &mut bytes);
        bytes.truncate(length);
        (bytes, magnitudes)
    }
}

/// Numbers of a stream's blocks that are blank, misfits, or coarser than the stream's rate.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    blank: usize,
    misfit: usize,
    /// Number of blocks that were quantised again at a coarser rate, and are not blank.
    coarser: usize,
}

/// Asserts that encoder and reference agree on every block of a stream and on the state after it.
/// Returns the numbers of blank, misfit and coarser blocks.
fn assert_equal_on(steps: &[Step], rate: Rate) -> Seen {
    let mut encoder = PackedEncoder::new();
    encoder.set_rate(rate);
    let Some(model) = ARTIFACT.packed.clone() else {
        assert!(steps.iter().all(|step| encoder.encode_step(step).is_none()));
        return Seen::default();
    };
    let mut reference = Reference { model, state: Vec::new(), blocks: 0, coarser: false };
    let mut seen = Seen::default();
    for (number, hop) in steps.chunks_exact(HOP).enumerate() {
        let codes: Vec<_> = hop.iter().map(|step| encoder.encode_step(step)).collect();
        let (last, earlier) = codes.split_last().expect("a hop");
        assert!(earlier.iter().all(Option::is_none), "block {number}");
        let code = last.expect("a block for each hop");
        let ours = Block {
            bytes: code.bytes().to_vec(),
            clipped: code.clipped,
            is_reset: code.is_reset,
            is_blank: code.is_blank,
            is_misfit: code.is_misfit,
        };
        assert_eq!(ours, reference.code(hop, rate), "block {number}");
        seen.blank += usize::from(ours.is_blank);
        seen.misfit += usize::from(ours.is_misfit);
        seen.coarser += usize::from(reference.coarser);
        assert_eq!(encoder.state(), reference.state, "state after block {number}");
        assert_eq!((code.block as usize, code.rate), (number, rate.index()));
    }
    seen
}

fn steps(count: usize, value: impl Fn(usize, usize) -> i32) -> Vec<Step> {
    (0..count)
        .map(|step| Step {
            electrodes: std::array::from_fn(|electrode| value(step, electrode)),
            ..Step::SILENCE
        })
        .collect()
}

#[test]
fn silence_rails_impulses_and_slow_waves_have_the_references_blocks() {
    let rate = Rate::MIDDLE;
    // More than 64 blocks, so that the stream contains a second block without prediction.
    let count = 67 * HOP;
    assert_equal_on(&steps(count, |_, _| 0), rate);
    assert_equal_on(&steps(8 * HOP, |_, _| i32::MAX), rate);
    assert_equal_on(
        &steps(8 * HOP, |step, _| if step % 3 == 0 { i32::MIN } else { i32::MAX }),
        rate,
    );
    assert_equal_on(
        &steps(count, |step, electrode| if step % 37 == electrode { 1 << 20 } else { 0 }),
        rate,
    );
    let wave = |step: usize, electrode: usize| {
        let phase = i32::try_from((step * (electrode + 3)) % 64).expect("below 64");
        (phase - 32).abs() * 3_000 - 48_000
    };
    for index in [0, 4, 9, 15] {
        assert_equal_on(&steps(count, wave), Rate::new(index).expect("a rate"));
    }
}

/// Generates pseudo-random numbers over the whole range of `i32` (a linear congruential generator,
/// Numerical Recipes).
fn noise(seed: u32) -> impl FnMut() -> i32 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        state.cast_signed()
    }
}

#[test]
fn noise_of_any_size_has_the_references_blocks_among_them_coarser_and_blank_ones() {
    let mut seen = Seen::default();
    // In Q27.5, full scale is 2^28, and 2 mV, where input values are clipped, is about 2^21.5.
    for shift in [3, 8, 9, 10, 11, 13, 15] {
        let mut next = noise(shift);
        let signal: Vec<i32> = (0..20 * HOP * ELECTRODES).map(|_| next() >> shift).collect();
        let steps = steps(20 * HOP, |step, electrode| signal[step * ELECTRODES + electrode]);
        for rate in [0, 4] {
            let of_this = assert_equal_on(&steps, Rate::new(rate).expect("a rate"));
            seen.blank += of_this.blank;
            seen.coarser += of_this.coarser;
        }
    }
    // Checked for the built-in model only: with few electrodes, blocks are never too long.
    if is_built_in() {
        assert!(seen.coarser > 0 && seen.blank > 0, "{seen:?}");
    }
}

#[test]
fn one_electrode_with_noise_is_a_misfit_from_the_size_that_the_model_permits() {
    // The coefficients represent only a part of white noise at one electrode.
    let misfits = |shift| {
        let mut next = noise(5);
        let signal: Vec<i32> = (0..20 * HOP).map(|_| next() >> shift).collect();
        let on_one = |step: usize, electrode| if electrode == 1 { signal[step] } else { 0 };
        assert_equal_on(&steps(20 * HOP, on_one), Rate::MIDDLE).misfit
    };
    let by_size: Vec<usize> = (4..20).rev().map(misfits).collect();
    // These numbers hold for the built-in model; another model is only compared with the reference.
    if is_built_in() {
        assert!(by_size.is_sorted(), "{by_size:?}");
        assert_eq!((by_size[0], by_size[15]), (0, 20), "{by_size:?}");
        assert!(by_size.iter().any(|count| (1..20).contains(count)), "{by_size:?}");
    }
}

#[test]
fn a_restarted_encoder_equals_a_new_one() {
    let noise = steps(20 * HOP, |step, electrode| {
        let [a, b] = [step, electrode].map(|n| i32::try_from(n * 7_919 % 1_009).expect("small"));
        a * b % 90_001 - 45_000
    });
    let blocks = |encoder: &mut PackedEncoder| -> Vec<_> {
        noise.iter().filter_map(|step| encoder.encode_step(step)).collect()
    };
    let expected = blocks(&mut PackedEncoder::new());
    let mut encoder = PackedEncoder::new();
    for steps in [1, HOP, 3 * HOP + 1] {
        for step in &noise[..steps] {
            let _ = encoder.encode_step(step);
        }
        encoder.restart();
        assert_eq!(blocks(&mut encoder), expected);
        encoder.restart();
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]
    #[test]
    fn any_signal_at_any_rate_has_the_references_blocks(
        values in prop::collection::vec(prop_oneof![
            6 => -200_000_i32..200_000,
            1 => any::<i32>(),
        ], 5 * HOP * ELECTRODES),
        rate in 0_u8..16,
    ) {
        let value = |step: usize, electrode: usize| values[step * ELECTRODES + electrode];
        assert_equal_on(&steps(5 * HOP, value), Rate::new(rate).expect("a rate"));
    }
}
