//! The streaming encoder against model-gen's batch reference: other loops, other layout, same
//! integers.

use std::{path::Path, sync::LazyLock};

use int8_nn::{InputConv, Linear, Pair, Winograd};
use model::{CODE, ELECTRODE_PAIRS, HIDDEN, Network, POOLED, POOLED_PAIRS, ROWS, STEPS};
use model_gen::{IntegerConv, IntegerLinear, IntegerModel, pack};
use pipeline::{CELLS, Encoder, Plane, Step};
use proptest::prelude::*;

/// The folder of the built-in model.
fn artifact_folder() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../model/artifact")
}

static BUILT_IN: LazyLock<IntegerModel> = LazyLock::new(|| {
    let artifact =
        artifact::Artifact::read(&artifact_folder()).expect("the checked-in artifact is readable");
    model_gen::quantise(&artifact).expect("the checked-in artifact is quantisable")
});

/// Every code of a stream, and the reference's code of the window that it belongs to.
fn assert_equal_on(
    mut encoder: Encoder<'_>,
    hop: usize,
    reference: &IntegerModel,
    planes: &[Plane],
) {
    let mut codes = 0;
    for (index, plane) in planes.iter().enumerate() {
        let code = encoder.push(&Step {
            plane: *plane,
            ..Step::default()
        });
        let due = index + 1 >= STEPS && (index + 1 - STEPS).is_multiple_of(hop);
        assert_eq!(code.is_some(), due, "step {index}");
        let Some(code) = code else { continue };
        let window: &[Plane; STEPS] = planes[index + 1 - STEPS..=index]
            .try_into()
            .expect("a window has 16 steps");
        assert_eq!(
            code.values,
            reference.encode_window(window),
            "window {}",
            code.window
        );
        assert_eq!(code.window, codes);
        codes += 1;
    }
}

fn stream(value: impl Fn(usize, usize) -> i8) -> Vec<Plane> {
    (0..40)
        .map(|step| std::array::from_fn(|cell| value(step, cell)))
        .collect()
}

fn planes() -> impl Strategy<Value = Vec<Plane>> {
    let plane = prop::collection::vec(any::<i8>(), CELLS)
        .prop_map(|cells| Plane::try_from(cells).expect("90 cells"));
    prop::collection::vec(plane, 16..48)
}

#[test]
fn silence_rails_and_impulses_give_the_reference_s_codes() {
    let check = |planes: &[Plane]| assert_equal_on(Encoder::new(), model::HOP, &BUILT_IN, planes);
    check(&stream(|_, _| 0));
    check(&stream(|_, _| 127));
    check(&stream(|_, _| -128));
    check(&stream(
        |step, cell| if (step + cell) % 2 == 0 { 127 } else { -128 },
    ));
    check(&stream(
        |step, cell| if (step, cell) == (20, 40) { 127 } else { 0 },
    ));
}

#[test]
fn the_golden_codes_come_out_again() {
    let golden =
        artifact::Golden::read(&artifact_folder()).expect("the checked-in golden is readable");
    assert!(
        !golden.windows.is_empty(),
        "a golden without windows proves nothing"
    );
    for (window, code) in golden.windows.iter().zip(&golden.codes) {
        assert_eq!(&BUILT_IN.encode_window(window), code);
        assert_equal_on(Encoder::new(), model::HOP, &BUILT_IN, window);
    }
}

/// Pseudo-random numbers for dense weights (a linear congruential generator, Numerical Recipes).
struct Noise(u32);

impl Noise {
    fn next(&mut self) -> i32 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        self.0.cast_signed()
    }

    fn bytes(&mut self, length: usize) -> Vec<i8> {
        (0..length)
            .map(|_| {
                i8::try_from(self.next() >> 24)
                    .expect("the top byte")
                    .max(-127)
            })
            .collect()
    }

    fn words(&mut self, length: usize, shift: u32) -> Vec<i32> {
        (0..length).map(|_| self.next() >> shift).collect()
    }
}

/// A model in which every weight matters: dense random weights, factors of both signs behind the
/// pool, and factors that keep activations and codes mostly within their range.
fn dense_model(seed: u32) -> IntegerModel {
    let mut noise = Noise(seed);
    let mut model = BUILT_IN.clone();
    let positive = |words: Vec<i32>| words.into_iter().map(|w| w.abs() + 1_000_000).collect();
    model.conv1 = IntegerConv {
        weights: noise.bytes(27 * HIDDEN.channels),
        bias: noise.words(HIDDEN.channels, 17),
        multipliers: positive(noise.words(HIDDEN.channels, 6)),
    };
    model.conv2 = IntegerConv {
        weights: noise.bytes(27 * HIDDEN.channels * POOLED.channels),
        bias: noise.words(POOLED.channels, 16),
        multipliers: noise.words(POOLED.channels, 9),
    };
    let linear = |noise: &mut Noise, inputs: usize, shift| IntegerLinear {
        weights: noise.bytes(inputs * CODE),
        multipliers: noise.words(CODE, shift),
    };
    model.fc = linear(&mut noise, 1_152, 11);
    model.fc_bias = noise.words(CODE, 12).try_into().expect("128 biases");
    model.shortcut = linear(&mut noise, 976, 13);
    model
}

/// Weights in the kernels' layout.
struct Packed {
    conv1: Vec<Pair>,
    conv2: Vec<Pair>,
    fc: Vec<Vec<Pair>>,
    shortcut: Vec<Vec<Pair>>,
}

impl Packed {
    fn new(model: &IntegerModel) -> Self {
        Self {
            conv1: pack::input_convolution(&model.conv1),
            conv2: pack::convolution(&model.conv2),
            fc: pack::fully_connected(&model.fc),
            shortcut: pack::shortcut(&model.shortcut),
        }
    }

    fn network<'w>(&'w self, model: &'w IntegerModel, hop: usize) -> Network<'w> {
        let words = |words: &'w [i32]| words.try_into().expect("128 words");
        Network {
            hop,
            conv1: InputConv {
                rows: ROWS,
                output: HIDDEN,
                weights: &self.conv1,
                bias: &model.conv1.bias,
                multipliers: &model.conv1.multipliers,
            },
            conv2: Winograd {
                tile_rows: POOLED.rows,
                outputs: POOLED.channels,
                weights: &self.conv2,
            },
            conv2_bias: &model.conv2.bias,
            conv2_multipliers: &model.conv2.multipliers,
            fc: std::array::from_fn(|p| Linear {
                inputs: POOLED_PAIRS,
                outputs: CODE,
                weights: &self.fc[p],
            }),
            fc_bias: &model.fc_bias,
            fc_multipliers: words(&model.fc.multipliers),
            shortcut: std::array::from_fn(|s| Linear {
                inputs: ELECTRODE_PAIRS,
                outputs: CODE,
                weights: &self.shortcut[s],
            }),
            shortcut_multipliers: words(&model.shortcut.multipliers),
            code_zero_point: &model.code_zero_point,
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(10))]

    #[test]
    fn any_stream_gives_the_reference_s_codes(planes in planes()) {
        assert_equal_on(Encoder::new(), model::HOP, &BUILT_IN, &planes);
    }

    #[test]
    fn any_network_gives_the_reference_s_codes_at_either_hop(
        seed in any::<u32>(),
        hop in prop_oneof![Just(8), Just(16)],
        planes in planes(),
    ) {
        let model = dense_model(seed);
        let packed = Packed::new(&model);
        let network = packed.network(&model, hop);
        prop_assert!(network.is_consistent());
        assert_equal_on(Encoder::with(&network), hop, &model, &planes);
    }
}

#[test]
fn a_single_weight_of_any_layer_changes_the_codes() {
    let model = dense_model(1);
    let window: [Plane; STEPS] = std::array::from_fn(|step| {
        Noise(u32::try_from(step).expect("16 steps"))
            .bytes(CELLS)
            .try_into()
            .expect("90 cells")
    });
    let code = |change: fn(&mut IntegerModel)| {
        let mut changed = model.clone();
        change(&mut changed);
        changed.encode_window(&window)
    };
    let unchanged = code(|_| {});
    assert!(
        unchanged.iter().filter(|q| q.unsigned_abs() < 127).count() > 32,
        "codes within their range"
    );
    assert_ne!(unchanged, code(|m| m.conv1.weights[100] ^= 0x55));
    assert_ne!(
        unchanged,
        code(|m| m.conv2.multipliers[5] = -m.conv2.multipliers[5])
    );
    assert_ne!(
        unchanged,
        code(|m| m.conv2.weights.iter_mut().take(432).for_each(|w| *w = 1))
    );
    assert_ne!(unchanged, code(|m| m.fc.weights[..1_152].reverse()));
    assert_ne!(unchanged, code(|m| m.shortcut.weights[..976].reverse()));
}
