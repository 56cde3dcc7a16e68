//! Convolution and transposed convolution with 3 x 3 x 3 kernels, forward and backward.

use artifact::KERNEL;

use super::correlation::{Kernels, TAPS, correlate};
use super::total;
use super::volume::Volume;
use super::weight_gradient::weight_gradient;

/// Kernels and bias of a layer, in PyTorch's order.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Layer<'a> {
    /// Kernels: \[output, input, step, row, column\] of a convolution, \[input, output, step, row, column\]
    /// of a transposed one.
    pub(crate) weight: &'a [f32],
    /// A number for each output channel.
    pub(crate) bias: &'a [f32],
    /// Zeros at both ends of each axis, 0 or 1; a transposed convolution leaves out as many places.
    pub(crate) pads: [usize; 3],
}

/// Gradients of a layer's kernels and bias, in the order of the kernels and of the bias.
#[derive(Clone, Debug)]
pub(crate) struct LayerGradient {
    pub(crate) weight: Vec<f32>,
    pub(crate) bias: Vec<f32>,
}

impl Layer<'_> {
    /// Returns the convolution of `x`.
    pub(crate) fn convolve(&self, x: &Volume) -> Volume {
        correlate(
            x,
            &self.kernels(self.bias.len(), x.channels),
            self.bias,
            self.pads,
        )
    }

    /// Returns the gradient at the input of a convolution with `inputs` channels, from that at its output.
    pub(crate) fn convolve_gradient(&self, inputs: usize, gradient: &Volume) -> Volume {
        let kernels = self.turned_kernels(inputs, gradient.channels);
        correlate(gradient, &kernels, &vec![0.0; inputs], self.turned_pads())
    }

    /// Returns the transposed convolution of `x`.
    pub(crate) fn convolve_transposed(&self, x: &Volume) -> Volume {
        let kernels = self.turned_kernels(self.bias.len(), x.channels);
        correlate(x, &kernels, self.bias, self.turned_pads())
    }

    /// Returns the gradient at the input of a transposed convolution with `inputs` channels, from that at its
    /// output.
    pub(crate) fn convolve_transposed_gradient(&self, inputs: usize, gradient: &Volume) -> Volume {
        let kernels = self.kernels(inputs, gradient.channels);
        correlate(gradient, &kernels, &vec![0.0; inputs], self.pads)
    }

    /// Returns the gradients of a convolution's kernels and bias from its input and the gradient at its
    /// output.
    pub(crate) fn parameter_gradient(&self, x: &Volume, gradient: &Volume) -> LayerGradient {
        LayerGradient {
            weight: weight_gradient(gradient, &x.padded(self.pads)),
            bias: channel_sums(gradient),
        }
    }

    /// Returns the gradients of a transposed convolution's kernels and bias from its input and the gradient
    /// at its output.
    pub(crate) fn transposed_parameter_gradient(
        &self,
        x: &Volume,
        gradient: &Volume,
    ) -> LayerGradient {
        LayerGradient {
            weight: weight_gradient(x, &gradient.padded(self.pads)),
            bias: channel_sums(gradient),
        }
    }

    /// Returns the kernels as they are: \[first, second, tap\], from the second index to the first.
    fn kernels(&self, first: usize, second: usize) -> Kernels {
        Kernels::new(first, second, |output, input, tap| {
            self.weight[(output * second + input) * TAPS + tap]
        })
    }

    /// Returns the kernels turned around: from the first index to the second, taps in reverse.
    fn turned_kernels(&self, second: usize, first: usize) -> Kernels {
        Kernels::new(second, first, |output, input, tap| {
            self.weight[(input * second + output) * TAPS + TAPS - 1 - tap]
        })
    }

    fn turned_pads(&self) -> [usize; 3] {
        self.pads.map(|pad| KERNEL - 1 - pad)
    }
}

/// Returns the sum of each channel over all places and windows.
fn channel_sums(volume: &Volume) -> Vec<f32> {
    let channels = volume.by_channel();
    let sum = |values: &[super::Lanes]| values.iter().map(total).sum();
    channels.map(sum).collect()
}

#[cfg(test)]
mod tests;
