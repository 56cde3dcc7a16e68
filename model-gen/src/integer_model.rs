//! The encoder in integers, in the artifact's layout, and the reference computation of a code.

use artifact::{CONV1_CHANNELS, CodeFormat, Geometry, IntegerCode, KERNEL, Mode};

/// Integers of one layer of the encoder. Weights are in PyTorch's order:
/// `[out][in][time][row][column]` in a convolution, `[out][in]` in a fully connected layer.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct IntegerLayer {
    /// Weights, -127..=127.
    pub weights: Vec<i8>,
    /// Bias of each output, in units of the accumulator.
    pub bias: Vec<i32>,
    /// Requantisation factor of each output, Q0.32. In the convolution before the max-pool, a
    /// channel that the following batch norm multiplies by a negative number has negated weights
    /// and a negative requantisation factor.
    pub multipliers: Vec<i32>,
}

impl IntegerLayer {
    /// Returns the layer's contribution to value `output` of the code, Q32, for the layer inputs
    /// `features`; 0 if the layer is empty.
    fn contribution(&self, output: usize, features: &[i64]) -> i64 {
        let Some(&multiplier) = self.multipliers.get(output) else {
            return 0;
        };
        let weights = &self.weights[output * features.len()..];
        (dot(weights, features) + i64::from(self.bias[output])) * i64::from(multiplier)
    }
}

/// A quantised encoder. Layers that the mode lacks are empty.
#[derive(Clone, Debug, PartialEq)]
pub struct IntegerModel {
    /// Mode of the artifact, which determines whether the encoder has convolutions, a shortcut, or
    /// both.
    pub mode: Mode,
    /// Dimensions of window and code; padding, pool and sizes of the convolutions.
    pub geometry: Geometry,
    /// Size of one level of the quantised input, uV.
    pub input_scale_uv: f32,
    /// Integer format of the codes.
    pub code_format: CodeFormat,
    /// Scale of each dimension of the code: `z = (level - zero point) * scale`.
    pub code_scale: Vec<f32>,
    /// Level that stands for 0 in each dimension of the code; 0 in formats other than `Int8`.
    pub code_zero_point: Vec<i8>,
    /// Index of each electrode's cell on the scalp grid, counted row by row.
    pub cells: Vec<u8>,
    /// First convolution, padded with 0.
    pub conv1: IntegerLayer,
    /// Padding of each input channel of the second convolution: the integer that the batch norm
    /// after the first convolution turns into 0. All 0 if the model has no padding.
    pub hidden_padding: [i16; CONV1_CHANNELS],
    /// Second convolution, padded with `hidden_padding`.
    pub conv2: IntegerLayer,
    /// Fully connected layer after the pool.
    pub fc: IntegerLayer,
    /// Linear shortcut from window to code. Its input `step * electrodes + electrode` is the value
    /// of one electrode at one step; every bias is 0.
    pub shortcut: IntegerLayer,
}

impl IntegerModel {
    /// Returns the largest magnitude of an input of the second convolution: 255, or the largest
    /// magnitude of a padding value if that is larger.
    pub fn largest_hidden(&self) -> i32 {
        largest_hidden(&self.hidden_padding)
    }

    /// Returns the code of one window. `window` is the quantised input in the order step, row,
    /// column (the last fastest). The code is computed layer by layer over the whole window; the
    /// streaming encoder must return the same code bit for bit.
    ///
    /// # Panics
    /// If `window` does not have the length of the model's windows.
    pub fn encode_window(&self, window: &[i8]) -> IntegerCode {
        let dimensions = &self.geometry.dimensions;
        assert_eq!(window.len(), dimensions.window_cells(), "cells of a window");
        let features =
            if self.mode.has_convolutions() { self.features(window) } else { Vec::new() };
        let linear: Vec<i64> = window
            .chunks_exact(dimensions.cells())
            .flat_map(|plane| self.cells.iter().map(|&cell| i64::from(plane[usize::from(cell)])))
            .collect();
        let level = |j: usize| {
            let product =
                self.fc.contribution(j, &features) + self.shortcut.contribution(j, &linear);
            round_q32(product) + i64::from(self.code_zero_point[j])
        };
        let levels: Vec<i64> = (0..dimensions.numbers).map(level).collect();
        integer_code(self.code_format, &levels)
    }

    /// Returns the values of a code in floats: `z = (level - zero point) * scale`.
    pub fn dequantise(&self, code: &IntegerCode) -> Vec<f32> {
        let levels = code.levels().into_iter();
        levels
            .zip(self.code_zero_point.iter().zip(&self.code_scale))
            .map(|(level, (&zero_point, scale))| {
                #[expect(clippy::cast_precision_loss, reason = "17 bits")]
                let level = (level - i32::from(zero_point)) as f32;
                level * scale
            })
            .collect()
    }

    /// Returns the fully connected layer's inputs for a window, `[channel][time][row][column]`.
    fn features(&self, window: &[i8]) -> Vec<i64> {
        let dimensions = &self.geometry.dimensions;
        let input = Volume {
            shape: [1, dimensions.steps, dimensions.rows, dimensions.columns],
            values: window.iter().map(|&q| i32::from(q)).collect(),
        };
        let pads = self.geometry.padding.pads();
        let hidden = convolve(&self.conv1, &input.padded(pads, &[0]))
            .map_channels(|channel, sum| scale(sum, self.conv1.multipliers[channel]).clamp(0, 255));
        let sums = convolve(&self.conv2, &hidden.padded(pads, &self.hidden_padding));
        pool(&sums, &self.geometry, &self.conv2.multipliers)
    }
}

/// Returns the code that represents `levels`, given in units of the code's scale. This is the
/// reference for the device's encoder, in every format.
///
/// The exponent is the smallest with which every `round(level / 2^exponent)`, half up, is within
/// the format's range. If no exponent is large enough, the largest is used and values out of range
/// saturate.
pub fn integer_code(format: CodeFormat, levels: &[i64]) -> IntegerCode {
    let [least, greatest] = format.range().map(i64::from);
    let rounded = |level: i64, exponent: u8| {
        let power = 2_i64.pow(exponent.into());
        (level + power / 2).div_euclid(power)
    };
    let largest = format.largest_exponent();
    let fits = |exponent: &u8| {
        levels.iter().all(|&level| (least..=greatest).contains(&rounded(level, *exponent)))
    };
    let exponent = (0..=largest).find(fits).unwrap_or(largest);
    #[expect(clippy::cast_possible_truncation, reason = "clamped to 16 bits or less")]
    let value = |&level: &i64| rounded(level, exponent).clamp(least, greatest) as i16;
    IntegerCode { exponent, values: levels.iter().map(value).collect() }
}

/// A dense 4-d array of integers, in the order `[channel][time][row][column]`.
struct Volume {
    shape: [usize; 4],
    values: Vec<i32>,
}

impl Volume {
    fn at(&self, channel: usize, time: usize, row: usize, column: usize) -> i32 {
        let [_, times, rows, columns] = self.shape;
        self.values[((channel * times + time) * rows + row) * columns + column]
    }

    /// Returns a copy with `pads` layers of padding on both sides of the time, row and column axes;
    /// `padding` holds the value of the padding for each channel.
    fn padded(&self, pads: [usize; 3], padding: &[i16]) -> Self {
        let [channels, times, rows, columns] = self.shape;
        let shape = [channels, times + 2 * pads[0], rows + 2 * pads[1], columns + 2 * pads[2]];
        let mut values = Vec::with_capacity(shape.iter().product());
        for (channel, &padding) in padding.iter().enumerate() {
            for (time, row, column) in positions(shape) {
                let inside = |at: usize, pad: usize, length: usize| {
                    at.checked_sub(pad).filter(|at| *at < length)
                };
                let value = inside(time, pads[0], times)
                    .zip(inside(row, pads[1], rows))
                    .zip(inside(column, pads[2], columns))
                    .map_or(i32::from(padding), |((time, row), column)| {
                        self.at(channel, time, row, column)
                    });
                values.push(value);
            }
        }
        Self { shape, values }
    }

    fn map_channels(mut self, f: impl Fn(usize, i32) -> i32) -> Self {
        let per_channel = self.values.len() / self.shape[0];
        for (index, value) in self.values.iter_mut().enumerate() {
            *value = f(index / per_channel, *value);
        }
        self
    }
}

/// Returns the sums of a 3x3x3 convolution of `input`, which must already be padded.
///
/// # Panics
/// When the input has fewer than three steps, rows or columns, or a value does not fit 16 bits.
fn convolve(conv: &IntegerLayer, input: &Volume) -> Volume {
    /// Number of steps, rows or columns by which the output of the convolution is smaller than its
    /// input.
    const SHRINK: usize = KERNEL - 1;
    let outputs = conv.bias.len();
    let [inputs, times, rows, columns] = input.shape;
    let shape = [outputs, times - SHRINK, rows - SHRINK, columns - SHRINK];
    // Use 16 bits: SSE2 computes eight 16-bit products at once; 32-bit products need SSE4.1.
    let narrow = |value: &i32| i16::try_from(*value).expect("quantised, or padding of 16 bits");
    let narrowed: Vec<i16> = input.values.iter().map(narrow).collect();
    let mut values = Vec::with_capacity(shape.iter().product());
    for (out, &bias) in conv.bias.iter().enumerate() {
        for time in 0..shape[1] {
            // Sums of an output plane, computed with rows as long as the input's. The last `SHRINK`
            // sums of each row mix two rows of the input and are dropped below.
            let mut sums = vec![bias; shape[2] * columns - SHRINK];
            for channel in 0..inputs {
                for (dt, dr, dc) in positions([1, KERNEL, KERNEL, KERNEL]) {
                    let tap = ((out * inputs + channel) * KERNEL + dt) * KERNEL + dr;
                    let weight = i32::from(conv.weights[tap * KERNEL + dc]);
                    let row = (channel * times + time + dt) * rows + dr;
                    let taken = &narrowed[row * columns + dc..];
                    for (sum, x) in sums.iter_mut().zip(taken) {
                        *sum += weight * i32::from(*x);
                    }
                }
            }
            let kept = sums.chunks(columns).flat_map(|row| &row[..shape[3]]);
            values.extend(kept);
        }
    }
    Volume { shape, values }
}

/// Returns the requantised maximum of each pool, in the order `[channel][time][row][column]`.
fn pool(sums: &Volume, geometry: &Geometry, multipliers: &[i32]) -> Vec<i64> {
    let ([steps, rows, columns], [t, r, c]) = (geometry.pooled, geometry.pool);
    let mut features = Vec::with_capacity(geometry.flat());
    for (channel, &multiplier) in multipliers.iter().enumerate() {
        for (time, row, column) in positions([1, steps, rows, columns]) {
            let largest = positions([1, t, r, c])
                .map(|(dt, dr, dc)| sums.at(channel, t * time + dt, r * row + dr, c * column + dc))
                .fold(i32::MIN, i32::max);
            features.push(i64::from(scale(largest, multiplier).clamp(0, 255)));
        }
    }
    features
}

/// Returns the largest magnitude of an input of the second convolution: 255, the largest quantised
/// output of the first convolution, or the largest magnitude of a padding value if that is larger.
pub(crate) fn largest_hidden(padding: &[i16]) -> i32 {
    let magnitudes = padding.iter().map(|x| i32::from(*x).abs());
    magnitudes.fold(255, i32::max)
}

/// Iterates over all positions (time, row, column) of a shape, the column fastest.
fn positions([_, times, rows, columns]: [usize; 4]) -> impl Iterator<Item = (usize, usize, usize)> {
    (0..times).flat_map(move |time| {
        (0..rows).flat_map(move |row| (0..columns).map(move |column| (time, row, column)))
    })
}

fn dot(weights: &[i8], features: &[i64]) -> i64 {
    weights.iter().zip(features).map(|(&w, &x)| i64::from(w) * x).sum()
}

/// Multiplies a sum by a Q0.32 factor, and rounds half up to an integer.
fn scale(sum: i32, multiplier: i32) -> i32 {
    i32::try_from(round_q32(i64::from(sum) * i64::from(multiplier)))
        .expect("the product of two 32-bit numbers over 2^32 has 31 bits")
}

/// Rounds a Q32 number half up to an integer.
fn round_q32(product: i64) -> i64 {
    (product + (1 << 31)) >> 32
}
