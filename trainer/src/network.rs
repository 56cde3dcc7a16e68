//! The autoencoder: codes, reconstructions, loss and gradients.

use crate::dataset::Window;
use crate::layers::LANES;
use crate::parameters::{Parameters, Weights};
use artifact::Description;
use packed_fit::in_parallel;

mod autoencoder;
mod backward;
mod group;

use autoencoder::Autoencoder;
use group::{Group, Layout, by_window, lanes};

pub use backward::BatchGradients;

/// Weight of a new batch in the running statistics: PyTorch's default.
const MOMENTUM: f32 = 0.1;

/// The shape of the autoencoder; all methods take the parameters as an argument and run on the CPU.
#[derive(Debug)]
pub struct Network {
    layout: Layout,
}

/// Codes of windows and the largest activations, for calibration.
#[derive(Debug)]
pub struct Trace {
    /// Codes, one window after the other.
    pub codes: Vec<f32>,
    /// Largest |g| * relu(conv) of each convolution over all windows, where g = weight /
    /// sqrt(variance + 1e-5) of the batch norm after the convolution; 0 in mode `pca`.
    pub activations: [f32; 2],
}

impl Network {
    /// Creates the network for a model description.
    pub fn new(description: &Description) -> Self {
        Self { layout: Layout::new(description) }
    }

    /// Computes loss and gradients of a batch, and updates the running statistics in `parameters`.
    pub fn gradients(&self, parameters: &mut Parameters, windows: &[&Window]) -> BatchGradients {
        let groups = self.groups(windows);
        let (batch, statistics) =
            backward::gradients(&Autoencoder::new(&self.layout, parameters), &groups);
        let Weights { encoder, decoder } = &mut parameters.weights;
        let norms = [&mut encoder.norm1, &mut encoder.norm2, &mut decoder.norm1];
        for (norm, moments) in norms.into_iter().zip(statistics) {
            for (running, batch) in [
                (&mut norm.running_mean, moments.mean()),
                (&mut norm.running_var, moments.unbiased_variance()),
            ] {
                for (running, batch) in running.iter_mut().zip(batch) {
                    *running += MOMENTUM * (batch - *running);
                }
            }
        }
        batch
    }

    /// Returns the mean squared error over windows; batch norm uses the running statistics.
    pub fn mean_squared_error(&self, parameters: &Parameters, windows: &[&Window]) -> f64 {
        let autoencoder = Autoencoder::new(&self.layout, parameters);
        let sums = in_parallel::map(&self.groups(windows), |group| {
            let (_, window) = autoencoder.reconstruct(group);
            group.squared_error(&window)
        });
        sums.iter().sum::<f64>() / self.count(windows)
    }

    /// Returns the mean squared error over windows, and the mean square of the windows; batch norm
    /// uses the running statistics.
    pub fn errors(&self, parameters: &Parameters, windows: &[&Window]) -> [f64; 2] {
        let squares = |window: &&Window| window.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
        let signal: f64 = windows.iter().map(squares).sum();
        [self.mean_squared_error(parameters, windows), signal / self.count(windows)]
    }

    /// Returns codes and reconstructed windows; batch norm uses the running statistics.
    pub fn reconstruct(
        &self,
        parameters: &Parameters,
        windows: &[&Window],
    ) -> (Vec<f32>, Vec<f32>) {
        let autoencoder = Autoencoder::new(&self.layout, parameters);
        let groups = self.groups(windows);
        let results = in_parallel::map(&groups, |group| {
            let (code, window) = autoencoder.reconstruct(group);
            (by_window(&code, group.windows), by_window(&window, group.windows))
        });
        let (codes, windows): (Vec<_>, Vec<_>) = results.into_iter().unzip();
        (codes.concat(), windows.concat())
    }

    /// Returns the number of values of all windows.
    fn count(&self, windows: &[&Window]) -> f64 {
        (windows.len() * self.layout.geometry.dimensions.window_electrodes()) as f64
    }

    /// Decodes concatenated codes, and returns their windows; batch norm uses the running
    /// statistics.
    ///
    /// # Panics
    /// In mode `paper`, whose codes cannot be decoded.
    pub fn decode(&self, parameters: &Parameters, codes: &[f32]) -> Vec<f32> {
        let autoencoder = Autoencoder::new(&self.layout, parameters);
        let numbers = self.layout.geometry.dimensions.numbers;
        let codes: Vec<&[f32]> = codes.chunks_exact(numbers).collect();
        let groups: Vec<&[&[f32]]> = codes.chunks(LANES).collect();
        let windows = in_parallel::map(&groups, |codes| {
            by_window(&autoencoder.decode(&lanes(codes, numbers)), codes.len())
        });
        windows.concat()
    }

    /// Returns the codes of windows and the largest activations; batch norm uses the running
    /// statistics.
    pub fn trace(&self, parameters: &Parameters, windows: &[&Window]) -> Trace {
        let autoencoder = Autoencoder::new(&self.layout, parameters);
        let traces = in_parallel::map(&self.groups(windows), |group| {
            let (code, activations) = autoencoder.trace(group);
            (by_window(&code, group.windows), activations)
        });
        let mut trace = Trace { codes: Vec::new(), activations: [0.0; 2] };
        for (codes, activations) in traces {
            trace.codes.extend(codes);
            for (largest, activation) in trace.activations.iter_mut().zip(activations) {
                *largest = largest.max(activation);
            }
        }
        trace
    }

    fn groups(&self, windows: &[&Window]) -> Vec<Group> {
        let groups = windows.chunks(LANES);
        groups.map(|windows| Group::new(&self.layout, windows)).collect()
    }
}

#[cfg(test)]
mod tests;
