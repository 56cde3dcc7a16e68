//! Tests the network against the artifact's float network and finite differences.

use super::*;
use crate::calibrate::calibrated_artifact;
use crate::card::{self, Shape};
use crate::dataset::Dataset;
use crate::parameters::TENSORS;
use crate::testing;
use artifact::{Artifact, CodeFormat, FloatDecoder, FloatEncoder, Mode, MontageFile, Padding};
use artifact::{Geometry, ScalpGrid};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::path::Path;

fn network() -> Network {
    Network::new(&testing::description())
}

/// Returns parameters for which every layer contributes to the output.
fn parameters() -> Parameters {
    changed(testing::shortcut(3))
}

/// Changes every value of the parameters, each by a different amount.
fn changed(mut parameters: Parameters) -> Parameters {
    for tensor in TENSORS {
        let values = tensor.of_mut(&mut parameters.weights);
        for (index, value) in values.iter_mut().enumerate() {
            let change = (index * 7 % 11) as f32 - 4.5;
            *value +=
                if tensor.name.ends_with("running_var") { change.abs() } else { 0.02 * change };
        }
    }
    parameters
}

/// Encodes and decodes windows with the network, and with the artifact's float encoder and decoder.
/// Returns the largest difference between the two codes or the two windows, relative to the largest
/// value in them (at least 1).
fn worst_difference(
    network: &Network,
    parameters: &Parameters,
    artifact: &Artifact,
    dataset: &Dataset,
) -> f32 {
    let windows = dataset.aligned(dataset.dimensions().steps);
    let (codes, reconstructed) = network.reconstruct(parameters, &windows);
    let encoder = FloatEncoder::new(artifact).unwrap();
    let decoder = FloatDecoder::new(artifact).unwrap();
    let grid = ScalpGrid::new(&artifact.description);
    let mut worst = 0.0_f32;
    for (index, window) in windows.iter().enumerate() {
        let code = encoder.encode(&grid.scatter(window));
        let window = decoder.decode(&code);
        let values = code.iter().chain(&window);
        let size = values.fold(1.0, |a: f32, b| a.max(b.abs()));
        let code_pairs = code.iter().zip(&codes[index * code.len()..]);
        let window_pairs = window.iter().zip(&reconstructed[index * window.len()..]);
        for (a, b) in code_pairs.chain(window_pairs) {
            worst = worst.max((a - b).abs() / size);
        }
    }
    worst
}

#[test]
fn network_and_trace_equal_the_artifacts_float_encoder_and_decoder() {
    let parameters = parameters();
    let dataset = testing::dataset(5, 16 * 20);
    let artifact = testing::model(&parameters, &testing::dataset(1, 64));
    let worst = worst_difference(&network(), &parameters, &artifact, &dataset);
    // Each implementation adds at most 1152 products in f32, in its own order, so the outputs
    // differ; the measured difference is 9e-6.
    assert!(worst < 1e-4, "{worst}");
    let encoder = FloatEncoder::new(&artifact).unwrap();
    let grid = ScalpGrid::new(&artifact.description);
    // 20 windows are more than one group, but not a whole number of groups.
    let windows = dataset.aligned(16);
    assert_eq!(windows.len(), 20);
    let trace = network().trace(&parameters, &windows);
    let traces = windows.iter().map(|window| encoder.encode_traced(&grid.scatter(window)));
    let traces: Vec<_> = traces.collect();
    let expected: Vec<f32> = traces.iter().flat_map(|trace| trace.code.clone()).collect();
    let size = expected.iter().fold(1.0_f32, |a, b| a.max(b.abs()));
    assert_eq!(trace.codes.len(), expected.len());
    for (a, b) in trace.codes.iter().zip(&expected) {
        assert!((a - b).abs() < 1e-4 * size, "{a} {b}");
    }
    let largest = |of: fn(&artifact::TracedCode) -> f32| traces.iter().map(of).fold(0.0, f32::max);
    let expected = [largest(|trace| trace.activation1_max), largest(|trace| trace.activation2_max)];
    for (a, b) in trace.activations.iter().zip(expected) {
        assert!((a - b).abs() < 1e-4 * b, "{a} {b}");
    }
}

/// Compares gradients with finite differences of the loss. Each entry of `places` is the name of a
/// tensor and the index of one of its elements.
fn compare_gradients(network: &Network, parameters: &Parameters, places: &[(&str, usize)]) {
    let dataset = testing::dataset(6, 64);
    let windows = dataset.aligned(16);
    let batch = network.gradients(&mut parameters.clone(), &windows);
    for &(name, index) in places {
        let tensor = TENSORS.iter().find(|tensor| tensor.name == name).unwrap();
        let change = 1e-2;
        let loss = |change: f32| {
            let mut changed = parameters.clone();
            tensor.of_mut(&mut changed.weights)[index] += change;
            network.gradients(&mut changed, &windows).loss
        };
        let slope = (loss(change) - loss(-change)) / (2.0 * f64::from(change));
        let gradient = f64::from(tensor.of(&batch.gradients)[index]);
        // The loss is in f32 and only piecewise smooth, so slope and gradient differ by up to 2 %.
        assert!(
            (slope - gradient).abs() < 0.05 * gradient.abs() + 1e-3,
            "{name}: {slope} {gradient}"
        );
    }
}

#[test]
fn gradients_of_index_unpooling_equal_finite_differences() {
    let mut description = testing::description();
    description.mode = Mode::Paper;
    let parameters = changed(Parameters::initial(Mode::Paper, testing::geometry(), &[], 3));
    // The loss jumps where a pool's maximum moves to another position, so layers before the pool
    // are left out.
    let places =
        [("encoder.fc.weight", 5000), ("decoder.fc.bias", 100), ("decoder.conv1.weight", 700)];
    compare_gradients(&Network::new(&description), &parameters, &places);
}

#[test]
fn gradients_equal_finite_differences_of_the_loss() {
    let places = [
        ("encoder.conv1.weight", 30),
        ("encoder.norm1.weight", 3),
        ("encoder.conv2.weight", 1000),
        ("encoder.fc.weight", 5000),
        ("encoder.shortcut.weight", 70_000),
        ("decoder.fc.bias", 100),
        ("decoder.conv1.weight", 700),
        ("decoder.norm1.bias", 5),
        ("decoder.conv2.weight", 40),
        ("decoder.shortcut.weight", 300),
    ];
    compare_gradients(&network(), &parameters(), &places);
}

#[test]
fn running_statistics_move_a_tenth_towards_the_batch() {
    let mut parameters = parameters();
    let mean = |parameters: &Parameters| parameters.weights.encoder.norm1.running_mean.clone();
    let before = mean(&parameters);
    let dataset = testing::dataset(6, 64);
    let windows = dataset.aligned(16);
    network().gradients(&mut parameters, &windows);
    let first = mean(&parameters);
    network().gradients(&mut parameters, &windows);
    let second = mean(&parameters);
    for ((before, first), second) in before.iter().zip(first).zip(second) {
        // Both batches are equal. Each update removes a tenth of the difference between the running
        // mean and the batch mean.
        assert!(((second - first) - 0.9 * (first - before)).abs() < 1e-5);
    }
}

#[test]
fn networks_of_other_shapes_equal_the_artifacts_float_encoder_and_decoder() {
    let text = include_str!("../../../files/montages/cyton-16.toml");
    let montage = MontageFile::parse(Path::new("cyton-16.toml"), text).unwrap();
    for (mode, padding, steps) in [
        (Mode::PaperCodeOnly, Padding::Space, 16),
        (Mode::PaperCodeOnly, Padding::All, 32),
        (Mode::Shortcut, Padding::Space, 32),
    ] {
        let shape = Shape { mode, numbers: 20, steps, hop: 4, padding, format: CodeFormat::Int8 };
        let description = card::description(&montage, shape);
        let geometry = Geometry::new(&description);
        let window = geometry.dimensions.window_electrodes();
        let element = |index, at| f32::from(u8::from(at == index));
        let direction = |index| (0..window).map(|at| element(index, at)).collect();
        let directions: Vec<Vec<f32>> = (0..20).map(direction).collect();
        let parameters = changed(Parameters::initial(mode, geometry, &directions, 3));
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        let values = (0..3 * window).map(|_| rng.random_range(-2.0..2.0));
        let dataset = Dataset::from_segments(vec![values.collect()], description.dimensions());
        let artifact = calibrated_artifact(description.clone(), &parameters, &dataset).unwrap();
        let network = Network::new(&description);
        let worst = worst_difference(&network, &parameters, &artifact, &dataset);
        // The same bound as in the test of the paper's network. That network adds more products, so
        // its rounding errors are larger.
        assert!(worst < 1e-4, "{mode:?} {padding:?}: {worst}");
    }
}
