//! The streaming encoder computes the same codes, byte for byte, as numpy does from the integer
//! model. So does the integer reference, for networks of every mode, padding and pool.
//!
//! The numpy implementation, `encoder_numpy.py`, shares no code with the Rust implementations. It
//! reads the integers that model-gen computes from the weights, in PyTorch's order.

use acceptance::{numpy_reference, real_data};
use any_model::Stress;
use artifact::{CodeFormat, IntegerCode};
use model::{HOP, STEPS};
use pipeline::{CELLS, Encoder, Mains, Plane, Sample, Step};

use crate::inputs::{self, recorded, synthetic};

/// Number of windows that numpy encodes in all, unless `CORTICODE_WINDOWS` sets another number.
const WINDOWS: usize = 1_000;

/// Formats of the compared codes; the network with seed n uses the format at index n modulo 3.
const FORMATS: [CodeFormat; 3] = [CodeFormat::Int8, CodeFormat::Int8Exponent, CodeFormat::Int16];

#[test]
fn numpy_computes_the_codes_of_the_streaming_encoder() {
    let test = "codes against numpy";
    if !numpy_reference::available(test) {
        return;
    }
    let inputs = inputs(test);
    let codes: Vec<IntegerCode> = inputs.iter().flat_map(|planes| streamed(planes)).collect();

    let model = model_gen::quantise(&inputs::artifact()).expect("an integer model");
    let windows = inputs
        .iter()
        .flat_map(|planes| planes.windows(STEPS).step_by(HOP))
        .map(<[Plane]>::as_flattened);
    let theirs = numpy_reference::integer_codes(&model, windows).expect("numpy's codes");
    let pairs = codes.iter().zip(&theirs);
    let different = pairs.filter(|(ours, theirs)| ours != theirs).count();
    println!("{} windows, {different} different", codes.len());
    assert_eq!((theirs.len(), different), (codes.len(), 0));
    // Consecutive codes are equal only if the input is silent, and it is silent in fewer than half
    // of the windows.
    let changes = codes.windows(2).filter(|pair| pair[0] != pair[1]).count();
    assert!(changes > codes.len() / 2, "{changes} of {}", codes.len());
}

#[test]
fn numpy_computes_the_codes_of_the_reference_for_every_variant() {
    if !numpy_reference::available("codes of every variant against numpy") {
        return;
    }
    for (seed, (mode, padding, pool)) in (1..).zip(any_model::every_variant()) {
        let artifact = any_model::any_artifact(seed, mode, padding, pool, HOP);
        let mut artifact = artifact.expect("an artifact");
        artifact.description.code.format = FORMATS[seed as usize % FORMATS.len()];
        let model = model_gen::quantise(&artifact).expect("an integer model");
        let windows = any_model::windows(seed, &artifact, 2);
        let quiet = windows.iter().map(|window| any_model::quantised(&artifact, &model, window));
        // A window of cells at both ends of the input's range drives activations and codes to the
        // ends of their ranges.
        let dimensions = &model.geometry.dimensions;
        let step = |cell: usize| cell / dimensions.cells();
        let rail = |cell| if step(cell) % 5 < 3 { 127 } else { -128 };
        let rails = (0..dimensions.window_cells()).map(rail).collect();
        let windows: Vec<Vec<i8>> = quiet.chain([rails]).collect();
        let theirs = numpy_reference::integer_codes(&model, windows.iter().map(Vec::as_slice));
        let ours: Vec<IntegerCode> = windows.iter().map(|w| model.encode_window(w)).collect();
        assert_eq!(ours, theirs.expect("numpy's codes"), "{mode:?}, {padding:?}, {pool:?}");
        let [least, greatest] = model.code_format.range();
        let values = ours[0].values.iter();
        let inside = values.filter(|q| (least + 1..greatest).contains(q)).count();
        assert!(inside > 100, "{mode:?}, {padding:?}, {pool:?}: {inside} of 128 within range");
        let values = ours[0].values.iter();
        let alive = values.filter(|q| q.unsigned_abs() > 10).count();
        assert!(alive > 32, "{mode:?}, {padding:?}, {pool:?}: {alive} of 128 beyond 10");
    }
}

/// Returns the planes (scalp grids of one time step) of each input: extreme values, synthetic EEG
/// and, if available, real EEG.
fn inputs(test: &str) -> Vec<Vec<Plane>> {
    let requested = std::env::var("CORTICODE_WINDOWS").ok();
    let windows = requested.map_or(WINDOWS, |text| text.parse().expect("a number of windows"));
    let real = real_data::path(test, real_data::EDF_R12);
    let count = Stress::ALL.len() + 1 + usize::from(real.is_some());
    let steps = STEPS + HOP * (windows.div_ceil(count) - 1);

    let stress = Stress::ALL.map(|stress| {
        let planes = stress.planes(CELLS).take(steps);
        let planes = planes.map(|plane| std::array::from_fn(|cell| plane[cell]));
        planes.collect()
    });
    let mut inputs: Vec<Vec<Plane>> = stress.to_vec();
    inputs.push(acquired(Mains::Hz50, synthetic(5), steps));
    if let Some(path) = real {
        inputs.push(acquired(Mains::Hz60, recorded(&path), steps));
    }
    assert!(inputs.iter().all(|planes| planes.len() == steps));
    inputs
}

fn acquired(mains: Mains, samples: impl Iterator<Item = Sample>, steps: usize) -> Vec<Plane> {
    let made = inputs::steps(mains, samples).take(steps);
    made.map(|step| step.plane).collect()
}

fn streamed(planes: &[Plane]) -> Vec<IntegerCode> {
    let mut encoder = Encoder::new();
    let steps = planes.iter().map(|&plane| Step { plane, ..Step::default() });
    steps
        .filter_map(|step| encoder.encode_step(&step))
        .map(|code| IntegerCode {
            exponent: code.values.exponent(),
            values: code.values.integers().to_vec(),
        })
        .collect()
}
