//! The encoder in integers, in the layout in which it was trained, and its plain-loop reference.

pub use artifact::{CELLS, CODE, ELECTRODES, STEPS};
use artifact::{COLUMNS, CodeFormat, Geometry, IntegerCode, Mode, ROWS};

use crate::integer_code;

/// Channels behind the first convolution.
pub(crate) const CONV1: usize = 16;
/// Channels behind the second convolution.
pub(crate) const CONV2: usize = 32;
/// One plane of quantised input: the scalp grid at one timestep, row-major.
pub type Plane = [i8; CELLS];

/// Integer weights of one convolution, PyTorch order `[out][in][time][row][column]`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct IntegerConv {
    /// Weights.
    pub weights: Vec<i8>,
    /// One bias per output channel, in accumulator steps.
    pub bias: Vec<i32>,
    /// One requantisation factor per output channel, Q0.32; negative for a channel whose weights
    /// are negated because its batch norm has a negative factor.
    pub multipliers: Vec<i32>,
}

/// Integer weights of a fully connected layer, PyTorch order `[out][in]`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct IntegerLinear {
    /// Weights.
    pub weights: Vec<i8>,
    /// One requantisation factor per output, Q0.32.
    pub multipliers: Vec<i32>,
}

impl IntegerLinear {
    /// The part of an output in the code, Q32; 0 where there is no such layer.
    fn output(&self, output: usize, features: &[i64], bias: i32) -> i64 {
        let Some(&multiplier) = self.multipliers.get(output) else {
            return 0;
        };
        let weights = &self.weights[output * features.len()..];
        (dot(weights, features) + i64::from(bias)) * i64::from(multiplier)
    }
}

/// A quantised encoder. What its mode lacks is empty.
#[derive(Clone, Debug, PartialEq)]
pub struct IntegerModel {
    /// Which parts it has.
    pub mode: Mode,
    /// Padding, pool and sizes of the convolutions.
    pub geometry: Geometry,
    /// Microvolt per step of the quantised input.
    pub input_scale_uv: f32,
    /// Integers of a code.
    pub code_format: CodeFormat,
    /// Float code per step of the code: `z = (step - zero point) * scale`.
    pub code_scale: [f32; CODE],
    /// The step of a float zero; 0 in the formats other than `Int8`.
    pub code_zero_point: [i8; CODE],
    /// Grid cell of each electrode.
    pub cells: [u8; ELECTRODES],
    /// First convolution; reads 0 beyond the edges.
    pub conv1: IntegerConv,
    /// What the second convolution reads beyond the edges of each channel: the integer that its
    /// batch norm turns into 0. All 0 without padding.
    pub hidden_padding: [i16; CONV1],
    /// Second convolution.
    pub conv2: IntegerConv,
    /// Fully connected layer behind the pool.
    pub fc: IntegerLinear,
    /// Its bias, in accumulator steps.
    pub fc_bias: [i32; CODE],
    /// Linear shortcut from the window, feature = step * 61 + electrode.
    pub shortcut: IntegerLinear,
}

impl IntegerModel {
    /// Largest magnitude that the second convolution reads: 255, or a padding beyond it.
    pub fn largest_hidden(&self) -> i32 {
        largest_hidden(&self.hidden_padding)
    }

    /// The code of one window, computed in plain loops: the reference that the streaming encoder
    /// must equal bit for bit.
    pub fn encode_window(&self, window: &[Plane; STEPS]) -> IntegerCode {
        let features = if self.mode.has_convolutions() {
            self.features(window)
        } else {
            Vec::new()
        };
        let linear: Vec<i64> = window
            .iter()
            .flat_map(|plane| {
                self.cells
                    .iter()
                    .map(|&cell| i64::from(plane[usize::from(cell)]))
            })
            .collect();
        let steps = std::array::from_fn(|j| {
            let product =
                self.fc.output(j, &features, self.fc_bias[j]) + self.shortcut.output(j, &linear, 0);
            round_q32(product) + i64::from(self.code_zero_point[j])
        });
        integer_code(self.code_format, &steps)
    }

    /// What the fully connected layer reads, `[channel][time][row][column]`.
    fn features(&self, window: &[Plane; STEPS]) -> Vec<i64> {
        let input = Volume {
            shape: [1, STEPS, ROWS, COLUMNS],
            values: window
                .as_flattened()
                .iter()
                .map(|&q| i32::from(q))
                .collect(),
        };
        let pads = self.geometry.padding.pads();
        let hidden = convolve(&self.conv1, &input.padded(pads, &[0]))
            .map_channels(|channel, sum| scale(sum, self.conv1.multipliers[channel]).clamp(0, 255));
        let sums = convolve(&self.conv2, &hidden.padded(pads, &self.hidden_padding));
        pool(&sums, &self.geometry, &self.conv2.multipliers)
    }
}

/// A dense 4-d array, `[channel][time][row][column]`.
struct Volume {
    shape: [usize; 4],
    values: Vec<i32>,
}

impl Volume {
    fn at(&self, channel: usize, time: usize, row: usize, column: usize) -> i32 {
        self.row(channel, time, row)[column]
    }

    fn row(&self, channel: usize, time: usize, row: usize) -> &[i32] {
        let [_, times, rows, columns] = self.shape;
        &self.values[((channel * times + time) * rows + row) * columns..][..columns]
    }

    /// With `pads` values of the channel's own on either side of each axis.
    fn padded(&self, pads: [usize; 3], padding: &[i16]) -> Self {
        let [channels, times, rows, columns] = self.shape;
        let shape = [
            channels,
            times + 2 * pads[0],
            rows + 2 * pads[1],
            columns + 2 * pads[2],
        ];
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

/// Unpadded 3x3x3 convolution.
fn convolve(conv: &IntegerConv, input: &Volume) -> Volume {
    let outputs = conv.bias.len();
    let [inputs, times, rows, columns] = input.shape;
    let shape = [outputs, times - 2, rows - 2, columns - 2];
    let mut values = Vec::with_capacity(shape.iter().product());
    for (out, &bias) in conv.bias.iter().enumerate() {
        for (time, row) in (0..shape[1]).flat_map(|time| (0..shape[2]).map(move |row| (time, row)))
        {
            let mut sums = [bias; COLUMNS];
            for channel in 0..inputs {
                for (dt, dr, dc) in positions([1, 3, 3, 3]) {
                    let tap = (((out * inputs + channel) * 3 + dt) * 3 + dr) * 3 + dc;
                    let weight = i32::from(conv.weights[tap]);
                    let x = &input.row(channel, time + dt, row + dr)[dc..];
                    for (sum, x) in sums.iter_mut().zip(x) {
                        *sum += weight * x;
                    }
                }
            }
            values.extend_from_slice(&sums[..shape[3]]);
        }
    }
    Volume { shape, values }
}

/// Largest of each pool, requantised; flattened as `[channel][time][row][column]`.
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

/// Largest magnitude that the second convolution reads with these values beyond the edges.
pub(crate) fn largest_hidden(padding: &[i16]) -> i32 {
    let magnitudes = padding.iter().map(|x| i32::from(*x).abs());
    magnitudes.fold(255, i32::max)
}

fn positions([_, times, rows, columns]: [usize; 4]) -> impl Iterator<Item = (usize, usize, usize)> {
    (0..times).flat_map(move |time| {
        (0..rows).flat_map(move |row| (0..columns).map(move |column| (time, row, column)))
    })
}

fn dot(weights: &[i8], features: &[i64]) -> i64 {
    weights
        .iter()
        .zip(features)
        .map(|(&w, &x)| i64::from(w) * x)
        .sum()
}

fn scale(sum: i32, multiplier: i32) -> i32 {
    i32::try_from(round_q32(i64::from(sum) * i64::from(multiplier)))
        .expect("the product of two 32-bit numbers over 2^32 has 31 bits")
}

/// Rounds a Q32 number half up.
fn round_q32(product: i64) -> i64 {
    (product + (1 << 31)) >> 32
}
