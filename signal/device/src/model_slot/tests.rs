//! Uploads of packed models: whole, damaged, out of order and hostile.

use std::{boxed::Box, vec::Vec};

use any_model::{any_linear_for, any_packed_of};
use artifact::reconstruction::PackedDecoder;
use artifact::{Artifact, ErrorWeight, PackedModel};
use pipeline::{EncoderMemory, PackedCode, PackedEncoder, PackedMemory, Rate, Step};
use proptest::prelude::*;

use super::*;

/// Streams of a device with both encoders.
const ALL: Streams = Streams::ALL;

/// Returns the built-in model; `None` if it has no packed code.
fn built_in() -> Option<Artifact> {
    let artifact = Artifact::from_files(model::artifact_files::FILES).expect("a model");
    artifact.packed.is_some().then_some(artifact)
}

/// Returns a random packed model with the shape of the built-in one, and its upload.
fn another() -> Option<(PackedModel, Vec<u8>)> {
    another_with(|_| ())
}

/// Returns the model of [`another`] after a change, and its upload.
fn another_with(change: impl Fn(&mut PackedModel)) -> Option<(PackedModel, Vec<u8>)> {
    let artifact = built_in()?;
    let mut packed = any_packed_of(PACKED_COEFFICIENTS, 7, &artifact.description);
    change(&mut packed);
    let artifact = artifact.with_packed(Some(packed.clone())).expect("it fits");
    let bytes = model_gen::upload(&artifact).expect("it fits");
    Some((packed, packed_alone(bytes?)))
}

/// Returns an upload without its linear code, if it has one.
pub(crate) fn packed_alone(mut upload: Vec<u8>) -> Vec<u8> {
    upload.truncate(size_of::<PackedContent>());
    upload[36..40].fill(0);
    upload
}

const ID: [u8; 8] = *b"personal";

fn begin(bytes: &[u8]) -> ModelBegin {
    ModelBegin { id: ID, bytes: u32::try_from(bytes.len()).expect("short"), crc: model_crc(bytes) }
}

/// Uploads a model in chunks of the largest size; returns the slot and the outcome of `end`.
fn uploaded(bytes: &[u8]) -> (Box<ModelSlot>, UploadOutcome) {
    let mut slot = Box::new(ModelSlot::empty());
    assert_eq!(slot.begin(begin(bytes), ALL).result, AckResult::Done);
    let mut offset = 0;
    for bytes in bytes.chunks(MAX_CHUNK_BYTES) {
        let outcome = slot.store(ModelChunk { offset, bytes });
        assert_eq!(outcome.result, AckResult::Done);
        offset = outcome.received.bytes;
    }
    let end = slot.end();
    (slot, end)
}

/// Returns steps of noise with an amplitude of some ten microvolts; every eighth step is at full
/// scale if `loud`.
fn steps(count: u32, loud: bool) -> impl Iterator<Item = Step> {
    let mut noise = 1_u32;
    (0..count).map(move |number| Step {
        electrodes: core::array::from_fn(|_| {
            noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            // 2^16 in Q27.5 are 46 uV, and 2^28 is the full scale.
            let shift = if loud && number % 8 == 0 { 3 } else { 15 };
            noise.cast_signed() >> shift
        }),
        ..Step::SILENCE
    })
}

#[test]
fn the_built_in_model_uploaded_is_the_constant_and_yields_its_blocks() {
    let (Some(artifact), Some(constant)) = (built_in(), PACKED.as_ref()) else {
        return;
    };
    let bytes = model_gen::upload(&artifact).expect("it fits").expect("it has one");
    let (slot, end) = uploaded(&bytes);
    let model = UploadedModel { id: ID, code_scales: Some(*CodeScales::BUILT_IN) };
    assert_eq!((end.result, end.model), (AckResult::Done, Some(model)));
    let packed = slot.weights().expect("a model in use").packed;
    assert_eq!(packed.checksum(), constant.checksum());
    let numbers = |packed: &Packed<'_>| {
        (packed.input_multiplier, packed.input_limit, packed.misfit_energy, packed.rate)
    };
    assert_eq!(numbers(&packed), numbers(constant));
    let mut encoder = Box::new(PackedEncoder::new());
    let mut memory = Box::new(PackedMemory::EMPTY);
    let rate = PackedEncoder::DEFAULT_RATE;
    for step in steps(800, true) {
        let expected = encoder.encode_step(&step);
        assert_eq!(memory.encode_step_with(&step, rate, &packed), expected);
    }
}

/// Encodes noise with the uploaded model; returns each hop's input values with its block.
fn blocks_of(upload: &[u8], rate: Rate) -> Vec<(Vec<i16>, PackedCode)> {
    let (slot, _) = uploaded(upload);
    let packed = slot.weights().expect("a model in use").packed;
    let mut memory = Box::new(PackedMemory::EMPTY);
    let mut values = Vec::new();
    let block = |step: Step| {
        values.extend(step.electrodes.map(|electrode| {
            let value = int8_nn::requantise(electrode, packed.input_multiplier);
            i16::try_from(value.clamp(-packed.input_limit, packed.input_limit)).expect("limited")
        }));
        let code = memory.encode_step_with(&step, rate, &packed)?;
        Some((core::mem::take(&mut values), code))
    };
    let blocks: Vec<_> = steps(400, false).filter_map(block).collect();
    assert_eq!(blocks.len(), 400 / HOP);
    blocks
}

#[test]
fn blocks_of_an_uploaded_model_decode_to_its_own_coefficients() {
    let Some((model, bytes)) = another() else {
        return;
    };
    let mut decoder = PackedDecoder::new(&model);
    let rate = Rate::new(6).expect("a rate");
    for (values, code) in blocks_of(&bytes, rate) {
        decoder.decode(code.bytes(), rate).expect("a block of this model");
        let expected = model.analyse(&values);
        for (decoded, expected) in decoder.state().iter().zip(expected) {
            let error = i32::from(*decoded) - i32::from(expected);
            assert!(error.abs() <= 2 * rate.step(), "{decoded} for {expected}");
        }
    }
}

#[test]
fn the_probes_of_a_weighted_model_find_misfits() {
    let weighted = another_with(|model| {
        model.description.weight = Some(ErrorWeight { band_hz: [8.0, 30.0], strength: 3.0 });
        model.synthesis = Some(std::vec![0.0; model.analysis.weights.len()]);
        // This limit is about the energy that the probes find in the median block of this noise, so
        // that only some of the blocks are misfits.
        model.description.misfit_uv2 = 100.0;
    });
    let Some((model, bytes)) = weighted else {
        return;
    };
    let energy = |numbers: &[i16]| -> i64 { numbers.iter().map(|&n| i64::from(n).pow(2)).sum() };
    let (mut misfits, mut count) = (0, 0);
    for (values, code) in blocks_of(&bytes, Rate::MIDDLE) {
        let coefficients = model.analyse(&values);
        let probes = &coefficients[coefficients.len() - packed::PROBES..];
        // In squares of input values: their unit is half a microvolt, so 100 uV^2 are 400.
        let permitted = 400 * i64::try_from(values.len()).expect("few") + energy(&values) / 64;
        assert_eq!(code.is_misfit, 32 * energy(probes) > permitted);
        misfits += usize::from(code.is_misfit);
        count += 1;
    }
    assert!((count / 5..4 * count / 5).contains(&misfits), "{misfits} of {count}");
}

/// Part of a session in which a host uploads a model.
#[derive(Clone, Debug)]
enum Act {
    /// Announces the model (again), or another one.
    Begin {
        other: bool,
    },
    /// Sends `count` chunks of `length` bytes each. Each chunk starts `skip` bytes after the end of
    /// the bytes that the device has received.
    Chunks {
        count: usize,
        length: usize,
        skip: i64,
    },
    /// Sends a chunk that the device already has, with different bytes.
    RepeatDamaged {
        back: u32,
    },
    /// Sends a chunk with one wrong byte.
    Damaged,
    End,
}

fn acts() -> impl Strategy<Value = Vec<Act>> {
    let chunks = (0..200_usize, 1..=MAX_CHUNK_BYTES, prop_oneof![8 => Just(0), 1 => -500..500_i64]);
    let act = prop_oneof![
        1 => any::<bool>().prop_map(|other| Act::Begin { other }),
        6 => chunks.prop_map(|(count, length, skip)| Act::Chunks { count, length, skip }),
        1 => (1..2_000_u32).prop_map(|back| Act::RepeatDamaged { back }),
        1 => Just(Act::Damaged),
        2 => Just(Act::End),
    ];
    prop::collection::vec(act, 1..12)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn a_model_is_used_only_if_all_its_bytes_arrived_in_order(acts in acts()) {
        let Some((_, bytes)) = another() else { return Ok(()) };
        let mut slot = Box::new(ModelSlot::empty());
        // Expected content of the slot: the announcement, and the acknowledged bytes.
        let mut announced: Option<ModelBegin> = None;
        let mut stored: Vec<u8> = Vec::new();
        let mut in_use = false;
        let whole = begin(&bytes);
        let acts = [Act::Begin { other: false }].into_iter().chain(acts);
        for act in acts.chain([Act::Begin { other: false }, Act::Chunks { count: 200, length: 1024, skip: 0 }, Act::End]) {
            let mut send = |slot: &mut ModelSlot, offset: u32, bytes: &[u8]| {
                let outcome = slot.store(ModelChunk { offset, bytes });
                let end = offset as usize + bytes.len();
                let fits = announced.is_some_and(|begin| end <= begin.bytes as usize);
                let expected = if fits && offset as usize <= stored.len() {
                    if end > stored.len() {
                        stored.truncate(offset as usize);
                        stored.extend(bytes);
                    }
                    AckResult::Done
                } else {
                    AckResult::BadArgument
                };
                assert_eq!(outcome.result, expected);
                assert_eq!(outcome.received.bytes as usize, stored.len());
            };
            match act {
                Act::Begin { other } => {
                    let begin = ModelBegin { crc: whole.crc ^ u32::from(other), ..whole };
                    if announced != Some(begin) {
                        announced = Some(begin);
                        stored.clear();
                        in_use = false;
                    }
                    prop_assert_eq!(slot.begin(begin, ALL).received.bytes as usize, stored.len());
                }
                Act::Chunks { count, length, skip } => for _ in 0..count {
                    let next = i64::from(slot.received) + skip;
                    let first = usize::try_from(next.max(0)).unwrap_or(0).min(bytes.len());
                    let end = (first + length).min(bytes.len());
                    if first < end {
                        send(&mut slot, u32::try_from(first).unwrap_or(0), &bytes[first..end]);
                    }
                },
                Act::RepeatDamaged { back } => {
                    let offset = slot.received.saturating_sub(back);
                    let length = (slot.received - offset).min(1024) as usize;
                    if length > 0 {
                        send(&mut slot, offset, &[0xAA; 1024][..length]);
                    }
                }
                Act::Damaged => {
                    let first = slot.received as usize;
                    let end = (first + 100).min(bytes.len());
                    let mut damaged = bytes[first..end].to_vec();
                    if let Some(last) = damaged.last_mut() {
                        *last ^= 0x10;
                        let offset = slot.received;
                        send(&mut slot, offset, &damaged);
                    }
                }
                Act::End => {
                    let is_whole = announced.is_some_and(|begin| begin.bytes as usize == stored.len());
                    let is_sound = announced == Some(whole) && stored == bytes;
                    let expected = match (is_whole, is_sound) {
                        (false, _) => AckResult::BadArgument,
                        (true, false) => AckResult::Failed,
                        (true, true) => AckResult::Done,
                    };
                    prop_assert_eq!(slot.end().result, expected);
                    if is_whole {
                        in_use = is_sound;
                    }
                    if is_whole && !is_sound {
                        announced = None;
                        stored.clear();
                    }
                }
            }
            prop_assert_eq!(slot.weights().is_some(), in_use);
        }
    }
}

/// Returns a model with the bytes from `at` on replaced by `new`, as a host without checks might
/// send it.
fn with_bytes(bytes: &[u8], at: usize, new: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    bytes[at..at + new.len()].copy_from_slice(new);
    bytes
}

#[test]
fn a_model_of_another_layout_or_shape_or_with_numbers_out_of_range_is_refused() {
    let Some((_, bytes)) = another() else {
        return;
    };
    let starts = bytes.len() - 2 * PACKED_COEFFICIENTS - size_of::<(Starts, Costs)>();
    let cases: [(usize, &[u8]); 11] = [
        (0, &1_u32.to_le_bytes()),
        (4, &[1]),
        (6, &[1]),
        (8, &[1]),
        (10, &[1]),
        (24, &i64::MIN.to_le_bytes()),
        (24, &i64::MAX.to_le_bytes()),
        (32, &(-1_i32).to_le_bytes()),
        (32, &32_768_i32.to_le_bytes()),
        (36, &1_u32.to_le_bytes()),
        (starts + 4, &[0xff, 0xff]),
    ];
    for (at, new) in cases {
        let (slot, end) = uploaded(&with_bytes(&bytes, at, new));
        assert_eq!((end.result, end.model), (AckResult::Failed, None), "{at} {new:?}");
        assert!(slot.weights().is_none());
        assert_eq!(end.received, ModelReceived::default());
    }
    let mut slot = ModelSlot::empty();
    let longer = if HAS_SHORTCUT { AckResult::BadArgument } else { AckResult::NotSupported };
    for (length, expected) in [
        (0, AckResult::BadArgument),
        (bytes.len() - 1, AckResult::BadArgument),
        (bytes.len() + 1, longer),
    ] {
        let begin = ModelBegin { bytes: u32::try_from(length).expect("short"), ..begin(&bytes) };
        assert_eq!(slot.begin(begin, ALL).result, expected, "{length}");
    }
    assert_eq!(slot.end().result, AckResult::BadArgument);
}

/// Returns a model with a random linear code and a random packed code, which take the same input as
/// the built-in model, and the model's upload; `None` if this build accepts no linear code.
fn another_linear() -> Option<(Artifact, Vec<u8>)> {
    let (packed, _) = another().filter(|_| HAS_SHORTCUT)?;
    let artifact = any_linear_for(8, &built_in()?).expect("a model");
    let artifact = artifact.with_packed(Some(packed)).expect("it fits");
    let bytes = model_gen::upload(&artifact).expect("it fits");
    Some((artifact, bytes?))
}

#[test]
fn codes_of_an_uploaded_linear_code_are_those_of_its_own_integers() {
    let Some((artifact, bytes)) = another_linear() else {
        return;
    };
    let integers = model_gen::quantise(&artifact).expect("it fits");
    let (slot, end) = uploaded(&bytes);
    let scales = end.model.expect("a model in use").code_scales;
    let scales = scales.expect("scales of the linear code");
    assert_eq!(scales.scale.as_slice(), integers.code_scale);
    assert_eq!(scales.zero_point.as_slice(), integers.code_zero_point);
    let network = slot.weights().expect("a model in use").network;
    let network = network.expect("a linear code");
    let mut memory = Box::new(EncoderMemory::EMPTY);
    let mut planes: Vec<i8> = Vec::new();
    let mut codes = 0;
    for step in steps(100, true) {
        let (plane, _) = pipeline::quantise(&step.electrodes);
        planes.extend(plane);
        let Some(code) = memory.encode_step_with(&Step { plane, ..step }, &network) else {
            continue;
        };
        let window = &planes[planes.len() - STEPS * model::CELLS..];
        let expected = integers.encode_window(window);
        assert_eq!(code.values.integers().as_slice(), expected.values);
        assert_eq!(code.values.exponent(), expected.exponent);
        codes += 1;
    }
    assert_eq!(codes, (100 - STEPS) / HOP + 1);
}

#[test]
fn a_linear_code_for_another_input_or_code_is_refused_and_no_content_of_it_panics() {
    let (Some((_, packed)), Some((_, bytes))) = (another(), another_linear()) else {
        return;
    };
    let start = packed.len();
    for (at, new) in [
        (36, [0; 4]),
        (start, [1, 0, 0, 0]),
        (start + 4, [1, 0, 0, 0]),
        (start + 8, [1; 4]),
        (start + 12, [0; 4]),
        (start + 12, f32::NAN.to_le_bytes()),
        (start + 12, (-1.0_f32).to_le_bytes()),
    ] {
        let (_, end) = uploaded(&with_bytes(&bytes, at, &new));
        assert_eq!(end.result, AckResult::Failed, "{at} {new:?}");
    }
    let mut slot = ModelSlot::empty();
    let without_codes = slot.begin(begin(&bytes), Streams::PACKED);
    assert_eq!(without_codes.result, AckResult::NotSupported);
    for fill in [0x7f, 0x80, 0xff] {
        let mut bytes = bytes.clone();
        bytes[start + 12 + 4 * CODE..].fill(fill);
        let (slot, _) = uploaded(&bytes);
        let weights = slot.weights().expect("a model in use");
        let network = weights.network.expect("a linear code");
        let mut memory = Box::new(EncoderMemory::EMPTY);
        for plane in [i8::MIN, i8::MAX, 0] {
            let step = Step { plane: [plane; model::CELLS], ..Step::SILENCE };
            for _ in 0..STEPS {
                memory.encode_step_with(&step, &network);
            }
        }
    }
}

#[test]
fn the_network_of_another_artifact_is_told_apart() {
    let Some((_, bytes)) = another() else {
        return;
    };
    let (_, end) = uploaded(&with_bytes(&bytes, 12, b"notthis1"));
    let model = end.model.expect("a model in use");
    assert_eq!(model.code_scales, None);
}

#[test]
fn extreme_weights_and_tables_neither_panic_nor_make_longer_blocks() {
    let Some((_, bytes)) = another() else {
        return;
    };
    let header = 40;
    let factors = header + 4 * (ANALYSIS_PAIRS + PREDICTION_PAIRS);
    let starts = factors + 8 * PACKED_COEFFICIENTS;
    let tables = starts + size_of::<Starts>();
    for fill in [0x00, 0x7f, 0x80, 0xff] {
        let mut bytes = bytes.clone();
        bytes[20..24].fill(fill);
        bytes[header..starts].fill(fill);
        bytes[tables..].fill(fill);
        let (slot, end) = uploaded(&bytes);
        assert_eq!(end.result, AckResult::Done, "{fill:#x}");
        let packed = slot.weights().expect("a model in use").packed;
        for rate in [0, 4, 15].map(|rate| Rate::new(rate).expect("a rate")) {
            let mut memory = Box::new(PackedMemory::EMPTY);
            let codes = steps(24 * 8, true)
                .filter_map(|step| memory.encode_step_with(&step, rate, &packed));
            assert!(codes.map(|code| code.bytes().len()).all(|length| length <= 118));
        }
    }
}
