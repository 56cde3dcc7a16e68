//! The streaming encoder returns the same codes as model-gen's batch reference, which has other
//! loops and another order of the weights.

use std::{path::Path, sync::LazyLock};

use int8_nn::Pair;
use model::{
    CODE, ConvWeights, ELECTRODES, HAS_CONVOLUTIONS, HAS_SHORTCUT, HIDDEN, MARGIN, Network, POOLED,
    POOLED_STEPS, STEPS,
};
use model_gen::{
    IntegerLayer, IntegerModel,
    memory::parts,
    pack::{self, UnsignedInput},
};
use pipeline::{CELLS, Encoder, Plane, Step};
use proptest::prelude::*;

static BUILT_IN: LazyLock<IntegerModel> = LazyLock::new(|| {
    let artifact = artifact::Artifact::from_files(model::artifact_files::FILES);
    model_gen::quantise(&artifact.expect("a sound artifact")).expect("a quantisable artifact")
});

/// Asserts that every code of a stream equals the reference's code of the same window.
fn assert_equal_on(
    mut encoder: Encoder<'_>,
    hop: usize,
    reference: &IntegerModel,
    planes: &[Plane],
) {
    let mut codes = 0;
    for (index, plane) in planes.iter().enumerate() {
        let code = encoder.encode_step(&Step { plane: *plane, ..Step::default() });
        let due = index + 1 >= STEPS && (index + 1 - STEPS).is_multiple_of(hop);
        assert_eq!(code.is_some(), due, "step {index}");
        let Some(code) = code else { continue };
        let window = planes[index + 1 - STEPS..=index].as_flattened();
        let ours = (code.values.exponent(), code.values.integers().to_vec());
        let theirs = reference.encode_window(window);
        let number = code.window;
        assert_eq!(ours, (theirs.exponent, theirs.values), "window {number}");
        assert_eq!(code.window, codes);
        codes += 1;
    }
}

fn stream(value: impl Fn(usize, usize) -> i8) -> Vec<Plane> {
    (0..2 * STEPS + 8).map(|step| std::array::from_fn(|cell| value(step, cell))).collect()
}

fn planes() -> impl Strategy<Value = Vec<Plane>> {
    let plane = prop::collection::vec(any::<i8>(), CELLS)
        .prop_map(|cells| Plane::try_from(cells).expect("a number for each cell"));
    prop::collection::vec(plane, STEPS..3 * STEPS)
}

#[test]
fn zeros_rails_and_impulses_have_the_reference_s_codes() {
    let check = |planes: &[Plane]| assert_equal_on(Encoder::new(), model::HOP, &BUILT_IN, planes);
    check(&stream(|_, _| 0));
    check(&stream(|_, _| 127));
    check(&stream(|_, _| -128));
    check(&stream(|step, cell| if (step + cell) % 2 == 0 { 127 } else { -128 }));
    check(&stream(|step, cell| if (step, cell) == (20, CELLS / 2) { 127 } else { 0 }));
}

#[test]
fn the_golden_windows_have_the_golden_codes() {
    if option_env!("CORTICODE_ARTIFACT").is_some() {
        eprintln!("SKIPPED: CORTICODE_ARTIFACT names another model than the checked-in one");
        return;
    }
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../model/artifact");
    let golden = artifact::Golden::read(&folder).expect("the checked-in golden is readable");
    assert!(!golden.windows.is_empty(), "the golden file has no windows");
    for (window, code) in golden.windows.iter().zip(&golden.codes) {
        assert_eq!(&BUILT_IN.encode_window(window), code);
        let (planes, _) = window.as_chunks::<CELLS>();
        assert_equal_on(Encoder::new(), model::HOP, &BUILT_IN, planes);
    }
}

/// Pseudo-random numbers for dense weights: the linear congruential generator of Numerical Recipes.
struct Noise(u32);

impl Noise {
    fn next(&mut self) -> i32 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        self.0.cast_signed()
    }

    fn bytes(&mut self, length: usize) -> Vec<i8> {
        (0..length)
            .map(|_| i8::try_from(self.next() >> 24).expect("the top byte").max(-127))
            .collect()
    }

    fn words(&mut self, length: usize, shift: u32) -> Vec<i32> {
        (0..length).map(|_| self.next() >> shift).collect()
    }
}

/// Returns a model in which every weight affects the code. It has dense random weights and, after
/// the pool, factors of both signs; all other factors are chosen so that activations and codes stay
/// mostly within their range.
fn dense_model(seed: u32) -> IntegerModel {
    let mut noise = Noise(seed);
    let mut model = BUILT_IN.clone();
    let positive = |words: Vec<i32>| words.into_iter().map(|w| w.abs() + 1_000_000).collect();
    let linear = |noise: &mut Noise, inputs: usize, shift| IntegerLayer {
        weights: noise.bytes(inputs * CODE),
        bias: vec![0; CODE],
        multipliers: noise.words(CODE, shift),
    };
    if HAS_CONVOLUTIONS {
        model.conv1 = IntegerLayer {
            weights: noise.bytes(27 * HIDDEN.channels),
            bias: noise.words(HIDDEN.channels, 17),
            multipliers: positive(noise.words(HIDDEN.channels, 6)),
        };
        model.conv2 = IntegerLayer {
            weights: noise.bytes(27 * HIDDEN.channels * POOLED.channels),
            bias: noise.words(POOLED.channels, 16),
            multipliers: noise.words(POOLED.channels, 9),
        };
        if MARGIN != 0 {
            model.hidden_padding = std::array::from_fn(|_| noise.bytes(1)[0].into());
        }
        model.fc = linear(&mut noise, POOLED_STEPS * POOLED.len(), 11);
        model.fc.bias = noise.words(CODE, 12);
    }
    if HAS_SHORTCUT {
        model.shortcut = linear(&mut noise, STEPS * ELECTRODES, 13);
    }
    model
}

/// Weights of all layers, packed for the kernels.
struct Packed {
    conv1: Vec<Pair>,
    conv2: Vec<Pair>,
    unsigned: UnsignedInput,
    fc: Vec<Vec<Vec<Pair>>>,
    shortcut: Vec<Vec<Pair>>,
}

/// Factors of a layer that the network does not have.
const NONE: [i32; CODE] = [0; CODE];

/// Converts a slice to an array of the length that the shapes require.
fn exactly<T, const LENGTH: usize>(values: &[T]) -> &[T; LENGTH] {
    values.try_into().expect("the length that the shapes require")
}

impl Packed {
    fn new(model: &IntegerModel) -> Self {
        Self {
            conv1: pack::input_convolution(&model.conv1),
            conv2: pack::convolution(model),
            unsigned: UnsignedInput::from_model(model),
            fc: pack::fully_connected(model),
            shortcut: pack::shortcut(model),
        }
    }

    fn network<'w>(&'w self, model: &'w IntegerModel, hop: usize) -> Network<'w> {
        let words = |words: &'w [i32]| words.try_into().unwrap_or(&NONE);
        Network {
            hop,
            conv1: ConvWeights {
                weights: exactly(&self.conv1),
                bias: exactly(&model.conv1.bias),
                multipliers: exactly(&model.conv1.multipliers),
            },
            conv2: ConvWeights {
                weights: exactly(&self.conv2),
                bias: exactly(&self.unsigned.bias),
                multipliers: exactly(&model.conv2.multipliers),
            },
            hidden_padding: UnsignedInput::to_pairs(self.unsigned.padding),
            hidden_offset: UnsignedInput::to_pairs(self.unsigned.offset),
            fc: std::array::from_fn(|plane| {
                std::array::from_fn(|piece| exactly(&self.fc[plane][piece]))
            }),
            fc_bias: words(&model.fc.bias),
            fc_multipliers: words(&model.fc.multipliers),
            shortcut: std::array::from_fn(|step| exactly(&self.shortcut[step])),
            shortcut_multipliers: words(&model.shortcut.multipliers),
            code_zero_point: exactly(&model.code_zero_point),
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(10))]

    #[test]
    fn any_stream_has_the_reference_s_codes(planes in planes()) {
        assert_equal_on(Encoder::new(), model::HOP, &BUILT_IN, &planes);
    }

    #[test]
    fn any_network_has_the_reference_s_codes_at_its_hop_and_without_overlap(
        seed in any::<u32>(),
        hop in prop_oneof![Just(model::HOP), Just(STEPS)],
        planes in planes(),
    ) {
        let model = dense_model(seed);
        let packed = Packed::new(&model);
        let network = packed.network(&model, hop);
        prop_assert!(network.is_consistent());
        assert_equal_on(Encoder::with_network(&network), hop, &model, &planes);
    }
}

#[test]
fn the_state_has_the_size_in_the_manifest() {
    let parts: usize = parts(&BUILT_IN, model::HOP).iter().map(|part| part.ram_bytes).sum();
    // In addition to these parts, the encoder has the status of the windows, the indices of the
    // rings, and padding for alignment.
    let rest = size_of::<Encoder<'_>>() - parts;
    let limit = 128 + 64 * model::OPEN_WINDOWS;
    assert!(rest < limit, "{rest} bytes in addition to {parts}");
}

#[test]
fn a_change_of_weights_in_any_layer_changes_the_codes() {
    let model = dense_model(1);
    let noise = |step| Noise(u32::try_from(step).expect("few steps")).bytes(CELLS);
    let window: Vec<i8> = (0..STEPS).flat_map(noise).collect();
    let code = |change: fn(&mut IntegerModel)| {
        let mut changed = model.clone();
        change(&mut changed);
        changed.encode_window(&window)
    };
    let unchanged = code(|_| {});
    assert!(
        unchanged.values.iter().filter(|q| q.unsigned_abs() < 127).count() > CODE / 4,
        "codes within their range"
    );
    if HAS_CONVOLUTIONS {
        let flat = POOLED_STEPS * POOLED.len();
        assert_ne!(unchanged, code(|m| m.conv1.weights[..108].reverse()));
        assert_ne!(unchanged, code(|m| m.conv2.multipliers[..8].reverse()));
        assert_ne!(unchanged, code(|m| m.conv2.weights.iter_mut().take(432).for_each(|w| *w = 1)));
        let mut changed = model.clone();
        changed.fc.weights[..flat].reverse();
        assert_ne!(unchanged, changed.encode_window(&window));
    }
    if HAS_SHORTCUT {
        assert_ne!(unchanged, code(|m| m.shortcut.weights.reverse()));
    }
}
