//! The autoencoder on burn's tensors: forward, loss and gradients.

use crate::adam::Gradients;
use crate::dataset::Window;
use crate::parameters::{Parameters, is_statistic};
use crate::pool::{CHANNELS, GEOMETRY, indices, max_pool, numbers, unpool};
use artifact::{CELLS, CODE, COLUMNS, NORM_EPSILON, ROWS, STEPS, ScalpGrid, WINDOW_ELECTRODES};
use burn_tensor::activation::relu;
use burn_tensor::module::{conv_transpose3d, conv3d};
use burn_tensor::ops::{ConvOptions, ConvTransposeOptions};
use burn_tensor::{Device, Int, Tensor, TensorData};
use std::collections::BTreeMap;

/// Weight of a batch in the running statistics: PyTorch's default.
const MOMENTUM: f32 = 0.1;
/// Windows that are measured at a time.
const MEASURED_AT_A_TIME: usize = 64;

/// The autoencoder on the CPU.
#[derive(Debug)]
pub struct Network {
    grid: ScalpGrid,
}

/// What one pass over a batch says.
#[derive(Debug)]
pub struct Learnt {
    /// Mean squared error over the batch's electrodes.
    pub loss: f64,
    /// Its gradient by everything but the running statistics.
    pub gradients: Gradients,
}

/// The parameters as tensors, and the statistics of the batch that passed them.
struct Pass {
    parameters: BTreeMap<&'static str, Tensor<1>>,
    /// Batch norm uses the batch's statistics and keeps them here; `None`: it uses the running ones.
    statistics: Option<Vec<(&'static str, BatchStatistics)>>,
}

/// Mean and unbiased variance of each channel of a batch.
struct BatchStatistics {
    mean: Vec<f32>,
    variance: Vec<f32>,
}

/// A batch: the same windows on the scalp grid and as electrodes alone.
struct Batch {
    cells: Tensor<5>,
    electrodes: Tensor<2>,
}

impl Network {
    /// The autoencoder for a scalp grid.
    pub fn new(grid: ScalpGrid) -> Self {
        Self { grid }
    }

    /// Loss and gradients of a batch; the running statistics of `parameters` follow the batch.
    pub fn learn(&self, parameters: &mut Parameters, windows: &[&Window]) -> Learnt {
        let device = Device::flex().autodiff();
        let mut pass = Pass::new(parameters, &device);
        pass.statistics = Some(Vec::new());
        let batch = self.batch(windows, &device);
        let code = pass.encode(&batch);
        let window = pass.decode(code, &self.cell_indices(&device));
        let loss = (window - batch.electrodes).square().mean();
        let mut found = loss.backward();
        let leaves = pass
            .parameters
            .iter()
            .filter(|(name, _)| !is_statistic(name));
        let gradients = leaves
            .map(|(name, leaf)| {
                let gradient = leaf.grad_remove(&mut found).map(numbers);
                // A parameter that this mode does not use has no gradient.
                (*name, gradient.unwrap_or_else(|| vec![0.0; leaf.dims()[0]]))
            })
            .collect();
        for (norm, batch) in pass.statistics.into_iter().flatten() {
            follow(
                parameters.values_mut(&format!("{norm}.running_mean")),
                &batch.mean,
            );
            follow(
                parameters.values_mut(&format!("{norm}.running_var")),
                &batch.variance,
            );
        }
        Learnt {
            loss: f64::from(numbers(loss)[0]),
            gradients,
        }
    }

    /// Mean squared error over windows, with the running statistics.
    pub fn measure(&self, parameters: &Parameters, windows: &[&Window]) -> f64 {
        let (_, errors) = self.run(parameters, windows, |window, batch| {
            numbers((window.clone() - batch.electrodes.clone()).square().sum())
        });
        let sum: f64 = errors.into_iter().map(f64::from).sum();
        #[expect(clippy::cast_precision_loss, reason = "far fewer than 2^53 numbers")]
        let count = (windows.len() * WINDOW_ELECTRODES) as f64;
        sum / count
    }

    /// Codes and reconstructed windows, with the running statistics.
    pub fn reconstruct(
        &self,
        parameters: &Parameters,
        windows: &[&Window],
    ) -> (Vec<f32>, Vec<f32>) {
        self.run(parameters, windows, |window, _| numbers(window.clone()))
    }

    /// Codes, and what `result` makes of each batch's reconstruction.
    fn run(
        &self,
        parameters: &Parameters,
        windows: &[&Window],
        result: impl Fn(&Tensor<2>, &Batch) -> Vec<f32>,
    ) -> (Vec<f32>, Vec<f32>) {
        let device = Device::flex();
        let mut pass = Pass::new(parameters, &device);
        let cells = self.cell_indices(&device);
        let (mut codes, mut results) = (Vec::new(), Vec::new());
        for windows in windows.chunks(MEASURED_AT_A_TIME) {
            let batch = self.batch(windows, &device);
            let code = pass.encode(&batch);
            codes.extend(numbers(code.clone()));
            results.extend(result(&pass.decode(code, &cells), &batch));
        }
        (codes, results)
    }

    fn batch(&self, windows: &[&Window], device: &Device) -> Batch {
        let cells: Vec<f32> = windows
            .iter()
            .flat_map(|window| *self.grid.scatter(window))
            .collect();
        let electrodes: Vec<f32> = windows.iter().flat_map(|window| **window).collect();
        let shape = [windows.len(), 1, STEPS, ROWS, COLUMNS];
        Batch {
            cells: Tensor::from_data(TensorData::new(cells, shape), device),
            electrodes: Tensor::from_data(
                TensorData::new(electrodes, [windows.len(), WINDOW_ELECTRODES]),
                device,
            ),
        }
    }

    fn cell_indices(&self, device: &Device) -> Tensor<1, Int> {
        indices(self.grid.cell_of_electrode(), device)
    }
}

impl Pass {
    fn new(parameters: &Parameters, device: &Device) -> Self {
        let parameters = parameters
            .iter()
            .map(|(name, values)| {
                let data = TensorData::new(values.to_vec(), [values.len()]);
                let tensor = Tensor::from_data(data, device);
                let learns = device.is_autodiff() && !is_statistic(name);
                (
                    name,
                    if learns {
                        tensor.require_grad()
                    } else {
                        tensor
                    },
                )
            })
            .collect();
        Self {
            parameters,
            statistics: None,
        }
    }

    fn parameter<const D: usize>(&self, name: &str, shape: [usize; D]) -> Tensor<D> {
        self.parameters[name].clone().reshape(shape)
    }

    fn encode(&mut self, batch: &Batch) -> Tensor<2> {
        let x = self.convolve(batch.cells.clone(), "encoder.conv1", [CHANNELS[0], 1]);
        let x = self.normalise(relu(x), "encoder.norm1");
        let x = self.convolve(x, "encoder.conv2", [CHANNELS[1], CHANNELS[0]]);
        let x = self.normalise(relu(x), "encoder.norm2");
        let flat = max_pool(x);
        let [count, features] = flat.dims();
        let weight = self.parameter("encoder.fc.weight", [CODE, features]);
        let bias = self.parameter("encoder.fc.bias", [1, CODE]);
        let shortcut = self.parameter("encoder.shortcut.weight", [CODE, WINDOW_ELECTRODES]);
        let code = flat.matmul(weight.transpose()) + bias;
        debug_assert_eq!(code.dims(), [count, CODE]);
        code + batch.electrodes.clone().matmul(shortcut.transpose())
    }

    fn decode(&mut self, code: Tensor<2>, cells: &Tensor<1, Int>) -> Tensor<2> {
        let count = code.dims()[0];
        let features = GEOMETRY.flat();
        let weight = self.parameter("decoder.fc.weight", [features, CODE]);
        let bias = self.parameter("decoder.fc.bias", [1, features]);
        let x = unpool(code.clone().matmul(weight.transpose()) + bias);
        let x = self.convolve_transposed(x, "decoder.conv1", CHANNELS[1], CHANNELS[0]);
        let x = self.normalise(relu(x), "decoder.norm1");
        let x = self.convolve_transposed(x, "decoder.conv2", CHANNELS[0], 1);
        let x = x.reshape([count, STEPS, CELLS]).select(2, cells.clone());
        let shortcut = self.parameter("decoder.shortcut.weight", [WINDOW_ELECTRODES, CODE]);
        x.reshape([count, WINDOW_ELECTRODES]) + code.matmul(shortcut.transpose())
    }

    fn convolve(&self, x: Tensor<5>, name: &str, [outputs, inputs]: [usize; 2]) -> Tensor<5> {
        let weight = self.parameter(&format!("{name}.weight"), [outputs, inputs, 3, 3, 3]);
        let bias = self.parameter(&format!("{name}.bias"), [outputs]);
        conv3d(
            x,
            weight,
            Some(bias),
            ConvOptions::new([1; 3], [0; 3], [1; 3], 1),
        )
    }

    fn convolve_transposed(
        &self,
        x: Tensor<5>,
        name: &str,
        inputs: usize,
        outputs: usize,
    ) -> Tensor<5> {
        let weight = self.parameter(&format!("{name}.weight"), [inputs, outputs, 3, 3, 3]);
        let bias = self.parameter(&format!("{name}.bias"), [outputs]);
        let options = ConvTransposeOptions::new([1; 3], [0; 3], [0; 3], [1; 3], 1);
        conv_transpose3d(x, weight, Some(bias), options)
    }

    /// Batch norm over everything but the channels.
    fn normalise(&mut self, x: Tensor<5>, name: &'static str) -> Tensor<5> {
        let channels = x.dims()[1];
        let of = |part: &str| self.parameter(&format!("{name}.{part}"), [1, channels, 1, 1, 1]);
        let (gain, offset) = (of("weight"), of("bias"));
        let (mean, variance) = if self.statistics.is_some() {
            let mean = x.clone().mean_dims(&[0, 2, 3, 4]);
            let variance = (x.clone() - mean.clone()).square().mean_dims(&[0, 2, 3, 4]);
            (mean, variance)
        } else {
            (of("running_mean"), of("running_var"))
        };
        if let Some(statistics) = &mut self.statistics {
            #[expect(
                clippy::cast_precision_loss,
                reason = "a batch has far fewer than 2^24 numbers"
            )]
            let count = (x.dims().iter().product::<usize>() / channels) as f32;
            let unbiased = count / (count - 1.0).max(1.0);
            let variance = numbers(variance.clone())
                .into_iter()
                .map(|v| v * unbiased)
                .collect();
            statistics.push((
                name,
                BatchStatistics {
                    mean: numbers(mean.clone()),
                    variance,
                },
            ));
        }
        (x - mean) / (variance + NORM_EPSILON).sqrt() * gain + offset
    }
}

/// Moves running statistics towards those of a batch.
fn follow(running: &mut [f32], batch: &[f32]) {
    for (running, batch) in running.iter_mut().zip(batch) {
        *running += MOMENTUM * (batch - *running);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;
    use artifact::{FloatDecoder, FloatEncoder};

    fn network() -> Network {
        Network::new(ScalpGrid::new(&testing::description()))
    }

    /// Numbers that leave no layer at 0.
    fn parameters() -> Parameters {
        let mut parameters = Parameters::from_directions(&testing::directions(), 3);
        let names: Vec<&str> = parameters.iter().map(|(name, _)| name).collect();
        for name in names {
            for (index, value) in parameters.values_mut(name).iter_mut().enumerate() {
                #[expect(clippy::cast_precision_loss, reason = "a small number")]
                let step = (index * 7 % 11) as f32 - 4.5;
                *value += if name.ends_with("running_var") {
                    step.abs()
                } else {
                    0.02 * step
                };
            }
        }
        parameters
    }

    #[test]
    fn the_network_equals_the_artifacts_float_encoder_and_decoder() {
        let parameters = parameters();
        let dataset = testing::dataset(5, 64);
        let windows = dataset.aligned(16);
        let (codes, reconstructed) = network().reconstruct(&parameters, &windows);
        let artifact = testing::artifact(&parameters);
        let encoder = FloatEncoder::new(&artifact).unwrap();
        let decoder = FloatDecoder::new(&artifact).unwrap();
        let grid = ScalpGrid::new(&artifact.description);
        let mut worst = 0.0_f32;
        for (index, window) in windows.iter().enumerate() {
            let code = encoder.encode(&grid.scatter(window));
            let window = decoder.decode(&code);
            let size = code
                .iter()
                .chain(&window)
                .fold(1.0, |a: f32, b| a.max(b.abs()));
            let code_pairs = code.iter().zip(&codes[index * CODE..]);
            let window_pairs = window
                .iter()
                .zip(&reconstructed[index * WINDOW_ELECTRODES..]);
            for (a, b) in code_pairs.chain(window_pairs) {
                worst = worst.max((a - b).abs() / size);
            }
        }
        // Both sum up to 1152 products in f32, in another order; measured 9e-6.
        assert!(worst < 1e-4, "{worst}");
    }

    #[test]
    fn gradients_are_the_slope_of_the_loss() {
        let parameters = parameters();
        let dataset = testing::dataset(6, 64);
        let windows = dataset.aligned(16);
        let network = network();
        let learnt = network.learn(&mut parameters.clone(), &windows);
        let loss_with = |name: &str, index: usize, change: f32| {
            let mut changed = parameters.clone();
            changed.values_mut(name)[index] += change;
            network.learn(&mut changed, &windows).loss
        };
        for (name, index) in [
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
        ] {
            let step = 1e-2;
            let slope = (loss_with(name, index, step) - loss_with(name, index, -step))
                / (2.0 * f64::from(step));
            let gradient = f64::from(learnt.gradients[name][index]);
            // Central differences of a piecewise smooth loss in f32: measured within 2 %.
            assert!(
                (slope - gradient).abs() < 0.05 * gradient.abs() + 1e-3,
                "{name}: {slope} {gradient}"
            );
        }
    }

    #[test]
    fn running_statistics_follow_the_batch_by_a_tenth() {
        let mut parameters = parameters();
        let mean = |parameters: &mut Parameters| {
            parameters.values_mut("encoder.norm1.running_mean").to_vec()
        };
        let before = mean(&mut parameters);
        let dataset = testing::dataset(6, 64);
        let windows = dataset.aligned(16);
        network().learn(&mut parameters, &windows);
        let first = mean(&mut parameters);
        network().learn(&mut parameters, &windows);
        let second = mean(&mut parameters);
        for ((before, first), second) in before.iter().zip(first).zip(second) {
            // The same batch twice: each time a tenth of what is left.
            assert!(((second - first) - 0.9 * (first - before)).abs() < 1e-5);
        }
    }
}
