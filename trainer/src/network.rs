//! The autoencoder in burn's tensors: forward pass, loss and gradients.

use crate::adam::Gradients;
use crate::dataset::Window;
use crate::parameters::{Parameters, is_statistic};
use crate::pool::{indices, max_pool, numbers, unpool};
use artifact::{
    CONV1_CHANNELS, CONV2_CHANNELS, Description, Dimensions, Geometry, KERNEL, Mode, NORM_EPSILON,
    ScalpGrid,
};
use burn_tensor::activation::relu;
use burn_tensor::module::{conv_transpose3d, conv3d};
use burn_tensor::ops::{ConvOptions, ConvTransposeOptions};
use burn_tensor::{Device, Int, Tensor, TensorData};
use std::collections::BTreeMap;

/// Weight of a batch in the running statistics; PyTorch's default.
const MOMENTUM: f32 = 0.1;
const EVALUATION_BATCH: usize = 64;

/// The autoencoder, computed on the CPU.
#[derive(Debug)]
pub struct Network {
    grid: ScalpGrid,
    dimensions: Dimensions,
}

/// Loss and gradients of one batch.
#[derive(Debug)]
pub struct BatchGradients {
    /// Mean squared error over the electrodes of the batch.
    pub loss: f64,
    /// Gradients of the loss with respect to all parameters except the running statistics.
    pub gradients: Gradients,
}

/// A forward pass: the parameters as tensors, and in training the statistics of the batch.
struct ForwardPass {
    mode: Mode,
    geometry: Geometry,
    parameters: BTreeMap<&'static str, Tensor<1>>,
    /// Statistics of the batch for batch norm; `None` if it uses the running statistics.
    statistics: Option<Vec<(&'static str, BatchStatistics)>>,
}

/// Mean and unbiased variance of each channel over a batch.
struct BatchStatistics {
    mean: Vec<f32>,
    variance: Vec<f32>,
}

/// A batch of windows in two layouts: cells of the scalp grid, and electrodes.
struct Batch {
    cells: Tensor<5>,
    electrodes: Tensor<2>,
}

impl Network {
    /// Creates a network; its methods take the parameters as an argument.
    pub fn new(description: &Description) -> Self {
        Self {
            grid: ScalpGrid::new(description),
            dimensions: description.dimensions(),
        }
    }

    /// Computes loss and gradients of a batch, and updates the running statistics in `parameters`.
    pub fn gradients(&self, parameters: &mut Parameters, windows: &[&Window]) -> BatchGradients {
        let device = Device::flex().autodiff();
        let mut pass = ForwardPass::new(parameters, &device);
        pass.statistics = Some(Vec::new());
        let batch = self.batch(windows, &device);
        let code = pass.encode(&batch);
        let window = pass.decode(code, &self.cell_indices(&device));
        let loss = (window - batch.electrodes).square().mean();
        let mut computed = loss.backward();
        let leaves = pass
            .parameters
            .iter()
            .filter(|(name, _)| !is_statistic(name));
        let gradients = leaves
            .map(|(name, leaf)| {
                let gradient = leaf.grad_remove(&mut computed).map(numbers);
                // A parameter that does not affect the loss has no gradient.
                (*name, gradient.unwrap_or_else(|| vec![0.0; leaf.dims()[0]]))
            })
            .collect();
        for (norm, batch) in pass.statistics.into_iter().flatten() {
            update_running(
                parameters.values_mut(&format!("{norm}.running_mean")),
                &batch.mean,
            );
            update_running(
                parameters.values_mut(&format!("{norm}.running_var")),
                &batch.variance,
            );
        }
        BatchGradients {
            loss: f64::from(numbers(loss)[0]),
            gradients,
        }
    }

    /// Returns the mean squared error over windows; batch norm uses the running statistics.
    pub fn mean_squared_error(&self, parameters: &Parameters, windows: &[&Window]) -> f64 {
        let (_, errors) = self.run(parameters, windows, |window, batch| {
            numbers((window.clone() - batch.electrodes.clone()).square().sum())
        });
        let sum: f64 = errors.into_iter().map(f64::from).sum();
        #[expect(clippy::cast_precision_loss, reason = "far fewer than 2^53 numbers")]
        let count = (windows.len() * self.dimensions.window_electrodes()) as f64;
        sum / count
    }

    /// Returns codes and reconstructed windows; batch norm uses the running statistics.
    pub fn reconstruct(
        &self,
        parameters: &Parameters,
        windows: &[&Window],
    ) -> (Vec<f32>, Vec<f32>) {
        self.run(parameters, windows, |window, _| numbers(window.clone()))
    }

    /// Returns all codes, and the values that `result` returns for the reconstruction of each batch.
    fn run(
        &self,
        parameters: &Parameters,
        windows: &[&Window],
        result: impl Fn(&Tensor<2>, &Batch) -> Vec<f32>,
    ) -> (Vec<f32>, Vec<f32>) {
        let device = Device::flex();
        let mut pass = ForwardPass::new(parameters, &device);
        let cells = self.cell_indices(&device);
        let (mut codes, mut results) = (Vec::new(), Vec::new());
        for windows in windows.chunks(EVALUATION_BATCH) {
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
            .flat_map(|window| self.grid.scatter(window))
            .collect();
        let electrodes: Vec<f32> = windows.concat();
        let Dimensions {
            steps,
            rows,
            columns,
            ..
        } = self.dimensions;
        let shape = [windows.len(), 1, steps, rows, columns];
        let flat = [windows.len(), self.dimensions.window_electrodes()];
        Batch {
            cells: Tensor::from_data(TensorData::new(cells, shape), device),
            electrodes: Tensor::from_data(TensorData::new(electrodes, flat), device),
        }
    }

    fn cell_indices(&self, device: &Device) -> Tensor<1, Int> {
        indices(self.grid.cell_of_electrode(), device)
    }
}

impl ForwardPass {
    fn new(parameters: &Parameters, device: &Device) -> Self {
        let (mode, geometry) = (parameters.mode(), parameters.geometry());
        let parameters = parameters
            .iter()
            .map(|(name, values)| {
                let data = TensorData::new(values.to_vec(), [values.len()]);
                let tensor = Tensor::from_data(data, device);
                let is_trained = device.is_autodiff() && !is_statistic(name);
                (
                    name,
                    if is_trained {
                        tensor.require_grad()
                    } else {
                        tensor
                    },
                )
            })
            .collect();
        Self {
            mode,
            geometry,
            parameters,
            statistics: None,
        }
    }

    fn parameter<const D: usize>(&self, name: &str, shape: [usize; D]) -> Tensor<D> {
        self.parameters[name].clone().reshape(shape)
    }

    fn encode(&mut self, batch: &Batch) -> Tensor<2> {
        let x = self.convolve(batch.cells.clone(), "encoder.conv1", [CONV1_CHANNELS, 1]);
        let x = self.normalise(relu(x), "encoder.norm1");
        let x = self.convolve(x, "encoder.conv2", [CONV2_CHANNELS, CONV1_CHANNELS]);
        let x = self.normalise(relu(x), "encoder.norm2");
        let flat = max_pool(x, &self.geometry);
        let numbers = self.geometry.dimensions.numbers;
        let weight = self.parameter("encoder.fc.weight", [numbers, self.geometry.flat()]);
        let bias = self.parameter("encoder.fc.bias", [1, numbers]);
        let code = flat.matmul(weight.transpose()) + bias;
        if !self.mode.has_shortcut() {
            return code;
        }
        let window = self.geometry.dimensions.window_electrodes();
        let shortcut = self.parameter("encoder.shortcut.weight", [numbers, window]);
        code + batch.electrodes.clone().matmul(shortcut.transpose())
    }

    fn decode(&mut self, code: Tensor<2>, cells: &Tensor<1, Int>) -> Tensor<2> {
        let count = code.dims()[0];
        let features = self.geometry.flat();
        let dimensions = self.geometry.dimensions;
        let (numbers, window) = (dimensions.numbers, dimensions.window_electrodes());
        let weight = self.parameter("decoder.fc.weight", [features, numbers]);
        let bias = self.parameter("decoder.fc.bias", [1, features]);
        let x = unpool(
            code.clone().matmul(weight.transpose()) + bias,
            &self.geometry,
        );
        let x = self.convolve_transposed(x, "decoder.conv1", CONV2_CHANNELS, CONV1_CHANNELS);
        let x = self.normalise(relu(x), "decoder.norm1");
        let x = self.convolve_transposed(x, "decoder.conv2", CONV1_CHANNELS, 1);
        let x = x.reshape([count, dimensions.steps, dimensions.cells()]);
        let x = x.select(2, cells.clone()).reshape([count, window]);
        if !self.mode.has_shortcut() {
            return x;
        }
        let shortcut = self.parameter("decoder.shortcut.weight", [window, numbers]);
        x + code.matmul(shortcut.transpose())
    }

    fn convolve(&self, x: Tensor<5>, name: &str, [outputs, inputs]: [usize; 2]) -> Tensor<5> {
        let weight = self.parameter(
            &format!("{name}.weight"),
            [outputs, inputs, KERNEL, KERNEL, KERNEL],
        );
        let bias = self.parameter(&format!("{name}.bias"), [outputs]);
        conv3d(
            x,
            weight,
            Some(bias),
            ConvOptions::new([1; 3], self.geometry.padding.pads(), [1; 3], 1),
        )
    }

    fn convolve_transposed(
        &self,
        x: Tensor<5>,
        name: &str,
        inputs: usize,
        outputs: usize,
    ) -> Tensor<5> {
        let weight = self.parameter(
            &format!("{name}.weight"),
            [inputs, outputs, KERNEL, KERNEL, KERNEL],
        );
        let bias = self.parameter(&format!("{name}.bias"), [outputs]);
        let pads = self.geometry.padding.pads();
        let options = ConvTransposeOptions::new([1; 3], pads, [0; 3], [1; 3], 1);
        conv_transpose3d(x, weight, Some(bias), options)
    }

    /// Applies batch norm, with statistics over all dimensions except the channels.
    fn normalise(&mut self, x: Tensor<5>, name: &'static str) -> Tensor<5> {
        let channels = x.dims()[1];
        let vector = |part: &str| self.parameter(&format!("{name}.{part}"), [1, channels, 1, 1, 1]);
        let (gain, offset) = (vector("weight"), vector("bias"));
        let (mean, variance) = if self.statistics.is_some() {
            let mean = x.clone().mean_dims(&[0, 2, 3, 4]);
            let variance = (x.clone() - mean.clone()).square().mean_dims(&[0, 2, 3, 4]);
            (mean, variance)
        } else {
            (vector("running_mean"), vector("running_var"))
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

/// Moves running statistics towards those of a batch, by [`MOMENTUM`] of the difference.
fn update_running(running: &mut [f32], batch: &[f32]) {
    for (running, batch) in running.iter_mut().zip(batch) {
        *running += MOMENTUM * (batch - *running);
    }
}

#[cfg(test)]
mod tests;
