//! Batch norm: statistics over a batch, the layer, and its gradients.

use artifact::NORM_EPSILON;

use super::{LANES, Lanes, Volume};

/// Count, mean and sum of squared deviations of the values of each channel.
#[derive(Clone, Debug)]
pub(crate) struct Moments {
    /// Number of values of a channel.
    count: f64,
    mean: Vec<f64>,
    /// Sums of the squared deviations from the mean.
    squares: Vec<f64>,
}

impl Moments {
    /// Returns the moments of the first `windows` windows of a group.
    pub(crate) fn new(x: &Volume, windows: usize) -> Self {
        let count = (x.places() * windows) as f64;
        let (mean, squares) = x
            .by_channel()
            .map(|values| {
                let mean = sum(values, windows, |value| value) / count;
                #[expect(clippy::cast_possible_truncation, reason = "the values are f32")]
                let center = mean as f32;
                (mean, sum(values, windows, |value| (value - center).powi(2)))
            })
            .unzip();
        Self { count, mean, squares }
    }

    /// Returns the moments of the values of `self` and `other` combined (Chan, Golub and LeVeque
    /// 1979).
    pub(crate) fn merge(mut self, other: &Self) -> Self {
        let count = self.count + other.count;
        for channel in 0..self.mean.len() {
            let difference = other.mean[channel] - self.mean[channel];
            self.mean[channel] += difference * other.count / count;
            self.squares[channel] +=
                other.squares[channel] + difference.powi(2) * self.count * other.count / count;
        }
        self.count = count;
        self
    }

    #[expect(clippy::cast_possible_truncation, reason = "the statistics are f32")]
    pub(crate) fn mean(&self) -> Vec<f32> {
        self.mean.iter().map(|mean| *mean as f32).collect()
    }

    /// Returns the biased variance of each channel, with which a batch is normalised.
    pub(crate) fn variance(&self) -> Vec<f32> {
        self.variance_with(self.count)
    }

    /// Returns the unbiased variance of each channel, for the running statistics.
    pub(crate) fn unbiased_variance(&self) -> Vec<f32> {
        self.variance_with((self.count - 1.0).max(1.0))
    }

    #[expect(clippy::cast_possible_truncation, reason = "the statistics are f32")]
    fn variance_with(&self, divisor: f64) -> Vec<f32> {
        let squares = self.squares.iter();
        squares.map(|squares| (squares / divisor) as f32).collect()
    }
}

/// A batch norm with given statistics.
#[derive(Clone, Debug)]
pub(crate) struct BatchNorm<'a> {
    gain: &'a [f32],
    offset: &'a [f32],
    mean: Vec<f32>,
    /// Reciprocal of the standard deviation of each channel.
    inverse: Vec<f32>,
}

/// Gradients of gain and offset of each channel.
#[derive(Clone, Debug)]
pub(crate) struct NormGradient {
    gain: Vec<f64>,
    offset: Vec<f64>,
}

impl<'a> BatchNorm<'a> {
    /// Creates a batch norm from gain, offset, mean and variance of each channel.
    pub(crate) fn new([gain, offset]: [&'a [f32]; 2], mean: Vec<f32>, variance: &[f32]) -> Self {
        let inverse = variance.iter().map(|v| 1.0 / (v + NORM_EPSILON).sqrt());
        Self { gain, offset, mean, inverse: inverse.collect() }
    }

    /// Returns the volume after batch norm.
    pub(crate) fn apply(&self, x: &Volume) -> Volume {
        let mut y = x.clone();
        for (channel, values) in y.by_channel_mut().enumerate() {
            let factor = self.inverse[channel] * self.gain[channel];
            let (mean, offset) = (self.mean[channel], self.offset[channel]);
            for value in values.as_flattened_mut() {
                *value = (*value - mean) * factor + offset;
            }
        }
        y
    }

    /// Returns the largest product of a value and the magnitude of its channel's factor (gain times
    /// `inverse`) in the first `windows` windows.
    pub(crate) fn largest_scaled(&self, x: &Volume, windows: usize) -> f32 {
        let channels = x.by_channel().enumerate();
        let largest = channels.map(|(channel, values)| {
            let values = values.iter().flat_map(|lanes| &lanes[..windows]);
            let largest = values.fold(0.0_f32, |largest, value| largest.max(*value));
            largest * (self.inverse[channel] * self.gain[channel]).abs()
        });
        largest.fold(0.0, f32::max)
    }

    /// Returns the gradients of gain and offset from the layer's input `x` and `gradient`, the
    /// gradient at its output. A window whose gradient is 0 contributes nothing.
    pub(crate) fn parameter_gradient(&self, x: &Volume, gradient: &Volume) -> NormGradient {
        let pairs = x.by_channel().zip(gradient.by_channel()).enumerate();
        let (gain, offset) = pairs
            .map(|(channel, (x, gradient))| {
                let (mut products, mut sums) = ([0.0; LANES], [0.0; LANES]);
                let mean = self.mean[channel];
                for (x, gradient) in x.iter().zip(gradient) {
                    for lane in 0..LANES {
                        products[lane] += (x[lane] - mean) * gradient[lane];
                        sums[lane] += gradient[lane];
                    }
                }
                let total = |lanes: Lanes| lanes.into_iter().map(f64::from).sum::<f64>();
                (total(products) * f64::from(self.inverse[channel]), total(sums))
            })
            .unzip();
        NormGradient { gain, offset }
    }

    /// Returns the gradient at the input. `total` holds the gradients of gain and offset over all
    /// groups of the batch, and `values` is the number of values of a channel in the batch. Only
    /// the first `windows` windows of this group belong to the batch.
    pub(crate) fn input_gradient(
        &self,
        x: &Volume,
        mut gradient: Volume,
        total: &NormGradient,
        values: f64,
        windows: usize,
    ) -> Volume {
        for (channel, (gradient, x)) in gradient.by_channel_mut().zip(x.by_channel()).enumerate() {
            let inverse = self.inverse[channel];
            #[expect(clippy::cast_possible_truncation, reason = "gradients are f32")]
            let [of_gain, of_offset] =
                [total.gain[channel], total.offset[channel]].map(|sum| (sum / values) as f32);
            let factor = inverse * self.gain[channel];
            let slope = of_gain * inverse;
            let mean = self.mean[channel];
            for (gradient, x) in gradient.iter_mut().zip(x) {
                for lane in 0..LANES {
                    gradient[lane] -= of_offset + slope * (x[lane] - mean);
                    gradient[lane] *= factor;
                }
                gradient[windows..].fill(0.0);
            }
        }
        gradient
    }
}

impl NormGradient {
    /// Returns the sum of these gradients and the gradients of another group of the batch.
    pub(crate) fn add(mut self, other: &Self) -> Self {
        let sums = self.gain.iter_mut().chain(&mut self.offset);
        for (sum, value) in sums.zip(other.gain.iter().chain(&other.offset)) {
            *sum += value;
        }
        self
    }

    #[expect(clippy::cast_possible_truncation, reason = "gradients are f32")]
    pub(crate) fn to_numbers(&self) -> [Vec<f32>; 2] {
        [&self.gain, &self.offset].map(|sums| sums.iter().map(|sum| *sum as f32).collect())
    }
}

/// Returns the sum of `function` over all values of the first `windows` windows.
fn sum(values: &[Lanes], windows: usize, function: impl Fn(f32) -> f32) -> f64 {
    let mut sums = [0.0; LANES];
    for value in values {
        for lane in 0..LANES {
            sums[lane] += function(value[lane]);
        }
    }
    sums[..windows].iter().copied().map(f64::from).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn volume(first: f32) -> Volume {
        let mut next = first;
        let mut values = vec![[0.0; LANES]; 2 * 12];
        for value in values.as_flattened_mut() {
            next = (next * 1.7 + 0.3) % 5.0;
            *value = next;
        }
        Volume::from_values(2, [3, 2, 2], values)
    }

    #[test]
    fn moments_of_two_groups_are_those_of_all_their_windows() {
        let (first, second) = (volume(1.0), volume(2.5));
        let merged = Moments::new(&first, LANES).merge(&Moments::new(&second, 3));
        for channel in 0..2 {
            let values = |volume: &Volume, windows: usize| -> Vec<f64> {
                let values = volume.by_channel().nth(channel).unwrap().iter();
                let values = values.flat_map(|lanes| lanes[..windows].to_vec());
                values.map(f64::from).collect()
            };
            let all = [values(&first, LANES), values(&second, 3)].concat();
            let count = all.len() as f64;
            let mean = all.iter().sum::<f64>() / count;
            let squares: f64 = all.iter().map(|value| (value - mean).powi(2)).sum();
            assert!((f64::from(merged.mean()[channel]) - mean).abs() < 1e-5);
            let variance = f64::from(merged.variance()[channel]);
            assert!((variance - squares / count).abs() < 1e-4);
            let unbiased = f64::from(merged.unbiased_variance()[channel]);
            assert!((unbiased - squares / (count - 1.0)).abs() < 1e-4);
        }
    }
}
