//! Plain-loop implementations of three-dimensional convolution, ReLU, batch norm and dense layers.

use crate::error::ArtifactError;
use crate::folder::Artifact;
use crate::geometry::KERNEL;
use crate::shapes::NORM_EPSILON;
use crate::tensors::Tensors;

/// A 4-d array in the order channel, step, row, column (the last fastest).
#[derive(Clone, Debug)]
pub(crate) struct Volume {
    pub(crate) channels: usize,
    /// Numbers of steps, rows and columns of each channel.
    pub(crate) size: [usize; 3],
    pub(crate) values: Vec<f32>,
}

impl Volume {
    /// Creates a volume with one channel for each bias. All values of a channel equal its bias.
    fn filled(size: [usize; 3], bias: &[f32]) -> Self {
        let [steps, rows, columns] = size;
        let per_channel = steps * rows * columns;
        let values = bias.iter().flat_map(|b| std::iter::repeat_n(*b, per_channel)).collect();
        Self { channels: bias.len(), size, values }
    }

    /// Returns a copy with `pads[axis]` zeros added at both ends of each axis.
    pub(crate) fn padded(&self, pads: [usize; 3]) -> Self {
        let size = std::array::from_fn(|axis| self.size[axis] + 2 * pads[axis]);
        let mut padded = Self::filled(size, &vec![0.0; self.channels]);
        for channel in 0..self.channels {
            for step in 0..self.size[0] {
                for row in 0..self.size[1] {
                    let to = padded.row_mut(channel, step + pads[0], row + pads[1]);
                    to[pads[2]..][..self.size[2]].copy_from_slice(self.row(channel, step, row));
                }
            }
        }
        padded
    }

    /// Returns a copy without the first and last `pads[axis]` positions of each axis: the inverse
    /// of [`Volume::padded`].
    pub(crate) fn cropped(&self, pads: [usize; 3]) -> Self {
        let size = std::array::from_fn(|axis| self.size[axis] - 2 * pads[axis]);
        self.part(pads, size)
    }

    /// Returns a copy of the box of `size` positions that starts at `first`, with all channels.
    fn part(&self, first: [usize; 3], size: [usize; 3]) -> Self {
        let mut values = Vec::with_capacity(self.channels * size.iter().product::<usize>());
        for channel in 0..self.channels {
            for step in 0..size[0] {
                for row in 0..size[1] {
                    let from = self.row(channel, step + first[0], row + first[1]);
                    values.extend_from_slice(&from[first[2]..][..size[2]]);
                }
            }
        }
        Self { channels: self.channels, size, values }
    }

    fn row(&self, channel: usize, step: usize, row: usize) -> &[f32] {
        let start = self.row_start(channel, step, row);
        &self.values[start..start + self.size[2]]
    }

    fn row_mut(&mut self, channel: usize, step: usize, row: usize) -> &mut [f32] {
        let start = self.row_start(channel, step, row);
        &mut self.values[start..start + self.size[2]]
    }

    fn row_start(&self, channel: usize, step: usize, row: usize) -> usize {
        let [steps, rows, columns] = self.size;
        ((channel * steps + step) * rows + row) * columns
    }

    pub(crate) fn relu(&mut self) {
        for value in &mut self.values {
            *value = value.max(0.0);
        }
    }

    fn channel_mut(&mut self, channel: usize) -> &mut [f32] {
        let length = self.values.len() / self.channels;
        &mut self.values[channel * length..(channel + 1) * length]
    }

    /// Returns the values of one channel in the order step, row, column (the last fastest).
    pub(crate) fn channel(&self, channel: usize) -> &[f32] {
        let length = self.values.len() / self.channels;
        &self.values[channel * length..(channel + 1) * length]
    }
}

/// A convolution with a 3x3x3 kernel, without padding. For a padded convolution, apply
/// [`Volume::padded`] to the input; for a padded transposed convolution, apply [`Volume::cropped`]
/// to the output.
///
/// Weights are `[out][in][step][row][column]`; in the decoder's transposed convolutions they are
/// `[in][out][step][row][column]`, as in PyTorch.
#[derive(Clone, Debug)]
pub(crate) struct Convolution {
    inputs: usize,
    pub(crate) weight: Vec<f32>,
    pub(crate) bias: Vec<f32>,
}

impl Convolution {
    /// Reads `{name}.weight`, whose first two dimensions are `shape`, and `{name}.bias`, with one
    /// number for each of the `outputs` channels.
    pub(crate) fn read(
        weights: &Tensors,
        name: &str,
        shape: [usize; 2],
        outputs: usize,
    ) -> Result<Self, ArtifactError> {
        let [first, second] = shape;
        let kernel = [first, second, KERNEL, KERNEL, KERNEL];
        let tensor = |part: &str, shape: &[usize]| weights.tensor(&format!("{name}.{part}"), shape);
        Ok(Self {
            inputs: first * second / outputs,
            weight: tensor("weight", &kernel)?.to_vec(),
            bias: tensor("bias", &[outputs])?.to_vec(),
        })
    }

    /// Returns the convolution y[o][t][r][c] = bias[o] + sum over i, kt, kr, kc of
    /// w[o][i][kt][kr][kc] x[i][t+kt][r+kr][c+kc].
    pub(crate) fn forward(&self, x: &Volume) -> Volume {
        let size = x.size.map(|length| length - (KERNEL - 1));
        // `wide` has the input's row length, so that each weight multiplies one long slice of the
        // input. `part` then removes the positions beyond the output's rows.
        let mut wide = Volume::filled(x.size, &self.bias);
        let count = x.row_start(0, size[0] - 1, size[1] - 1) + size[2];
        let tap_rows = tap_rows(x);
        let mut weights = self.weight.as_chunks::<KERNEL>().0.iter();
        for output in 0..wide.channels {
            for input in 0..self.inputs {
                for offset in tap_rows {
                    let weights = weights.next().expect("weights of each row of taps");
                    let x = &x.channel(input)[offset..];
                    add_taps(
                        &mut wide.channel_mut(output)[..count],
                        weights,
                        [x, &x[1..], &x[2..]],
                    );
                }
            }
        }
        wide.part([0; 3], size)
    }

    /// Returns the transposed convolution: y[o][t+kt][r+kr][c+kc] = bias[o] + sum over i, kt, kr,
    /// kc of w[i][o][kt][kr][kc] x[i][t][r][c].
    pub(crate) fn forward_transposed(&self, x: &Volume) -> Volume {
        let size = x.size.map(|length| length + (KERNEL - 1));
        let mut y = Volume::filled(size, &self.bias);
        let length = y.row_start(0, x.size[0] - 1, x.size[1] - 1) + x.size[2];
        let tap_rows = tap_rows(&y);
        let mut weights = self.weight.as_chunks::<KERNEL>().0.iter();
        // One channel of the input, whose rows are spread to the output's row length, with zeros
        // before and after it. The weights at the ends of a kernel row read these zeros.
        let mut wide = vec![0.0; length + 2 * (KERNEL - 1)];
        for input in 0..self.inputs {
            for step in 0..x.size[0] {
                for row in 0..x.size[1] {
                    let start = KERNEL - 1 + y.row_start(0, step, row);
                    wide[start..][..x.size[2]].copy_from_slice(x.row(input, step, row));
                }
            }
            for output in 0..y.channels {
                for offset in tap_rows {
                    let weights = weights.next().expect("weights of each row of taps");
                    let y = &mut y.channel_mut(output)[offset..][..length + KERNEL - 1];
                    add_taps(y, weights, [&wide[2..], &wide[1..], &wide]);
                }
            }
        }
        y
    }
}

/// Returns, for each of the kernel's nine rows, where its inputs start in a channel of `volume`.
fn tap_rows(volume: &Volume) -> [usize; KERNEL * KERNEL] {
    std::array::from_fn(|index| volume.row_start(0, index / KERNEL, index % KERNEL))
}

/// Adds the products of one kernel row to `y`: for each weight of the row in turn, the weight times
/// the slice of `x` that has the weight's index.
fn add_taps(y: &mut [f32], weights: &[f32; KERNEL], x: [&[f32]; KERNEL]) {
    let [first, second, third] = x.map(|x| &x[..y.len()]);
    for (((y, a), b), c) in y.iter_mut().zip(first).zip(second).zip(third) {
        *y = *y + weights[0] * a + weights[1] * b + weights[2] * c;
    }
}

/// Batch norm with the statistics saved in training: y = gain * x + offset, per channel.
#[derive(Clone, Debug)]
pub(crate) struct Norm {
    /// Gain of each channel: weight / sqrt(running variance + 1e-5).
    gain: Vec<f32>,
    /// Offset of each channel: bias - gain * running mean.
    offset: Vec<f32>,
}

impl Norm {
    /// Reads `{name}.weight`, `.bias`, `.running_mean` and `.running_var`, and computes gain and
    /// offset.
    pub(crate) fn read(
        weights: &Tensors,
        name: &str,
        channels: usize,
    ) -> Result<Self, ArtifactError> {
        let tensor = |part: &str| weights.tensor(&format!("{name}.{part}"), &[channels]);
        let (weight, bias) = (tensor("weight")?, tensor("bias")?);
        let (mean, variance) = (tensor("running_mean")?, tensor("running_var")?);
        let gain: Vec<f32> =
            weight.iter().zip(variance).map(|(w, v)| w / (v + NORM_EPSILON).sqrt()).collect();
        let offset = bias.iter().zip(&gain).zip(mean).map(|((b, g), mean)| b - g * mean).collect();
        Ok(Self { gain, offset })
    }

    pub(crate) fn apply(&self, x: &mut Volume) {
        let length = x.values.len() / x.channels;
        for ((values, gain), offset) in
            x.values.chunks_exact_mut(length).zip(&self.gain).zip(&self.offset)
        {
            for value in values {
                *value = gain * *value + offset;
            }
        }
    }

    /// Returns the largest |gain| * value over all values of `x`, the input of [`Norm::apply`].
    pub(crate) fn largest_scaled(&self, x: &Volume) -> f32 {
        let channels = self.gain.iter().enumerate().map(|(channel, gain)| {
            let largest = x.channel(channel).iter().fold(0.0, |a: f32, b| a.max(*b));
            gain.abs() * largest
        });
        channels.fold(0.0, f32::max)
    }
}

/// A fully connected layer.
#[derive(Clone, Debug)]
pub(crate) struct Dense {
    /// Weights in the order `[output][input]`.
    weight: Vec<f32>,
    bias: Vec<f32>,
}

impl Dense {
    /// Reads `{name}.weight`, whose shape is `[outputs, inputs]`, and `{name}.bias`.
    pub(crate) fn read(
        weights: &Tensors,
        name: &str,
        shape: [usize; 2],
    ) -> Result<Self, ArtifactError> {
        let tensor = |part: &str, shape: &[usize]| weights.tensor(&format!("{name}.{part}"), shape);
        Ok(Self {
            weight: tensor("weight", &shape)?.to_vec(),
            bias: tensor("bias", &shape[..1])?.to_vec(),
        })
    }

    pub(crate) fn forward(&self, x: &[f32]) -> Vec<f32> {
        let mut y = self.bias.clone();
        add_product(&mut y, &self.weight, x);
        y
    }
}

/// Reads the weights of the linear shortcut `name`, whose shape is `[outputs, inputs]`. Returns
/// `None` if the model's mode has no shortcut.
pub(crate) fn read_shortcut(
    artifact: &Artifact,
    name: &str,
    shape: [usize; 2],
) -> Result<Option<Vec<f32>>, ArtifactError> {
    if !artifact.description.mode.has_shortcut() {
        return Ok(None);
    }
    let weights = artifact.weights.tensor(name, &shape)?;
    Ok(Some(weights.to_vec()))
}

/// Adds `matrix * x` to `y`; the matrix is stored row by row.
pub(crate) fn add_product(y: &mut [f32], matrix: &[f32], x: &[f32]) {
    for (y, row) in y.iter_mut().zip(matrix.chunks_exact(x.len())) {
        *y += dot(row, x);
    }
}

/// Returns the dot product, computed in eight partial sums so that the compiler can vectorise it.
fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0; 8];
    let (a8, a_rest) = a.as_chunks::<8>();
    let (b8, b_rest) = b.as_chunks::<8>();
    for (a, b) in a8.iter().zip(b8) {
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            *sum += a * b;
        }
    }
    let rest: f32 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f32>() + rest
}
