//! The encoder in integers, in the layout in which it was trained, and its plain-loop reference.

pub use artifact::{CELLS, CODE, ELECTRODES, STEPS};
use artifact::{COLUMNS, ROWS};

/// Channels behind the first convolution.
pub(crate) const CONV1: usize = 16;
/// Channels behind the second convolution.
pub(crate) const CONV2: usize = 32;
/// Steps, rows and columns behind the pool.
pub(crate) const POOLED: [usize; 3] = [6, 3, 2];
/// Inputs of the fully connected layer.
pub(crate) const FLAT: usize = CONV2 * POOLED[0] * POOLED[1] * POOLED[2];

/// One plane of quantised input: the scalp grid at one timestep, row-major.
pub type Plane = [i8; CELLS];

/// Integer weights of one convolution, PyTorch order `[out][in][time][row][column]`.
#[derive(Clone, Debug, PartialEq, Eq)]
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
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct IntegerLinear {
    /// Weights.
    pub weights: Vec<i8>,
    /// One requantisation factor per output, Q0.32.
    pub multipliers: Vec<i32>,
}

/// A quantised encoder.
#[derive(Clone, Debug, PartialEq)]
pub struct IntegerModel {
    /// Microvolt per step of the quantised input.
    pub input_scale_uv: f32,
    /// Float code per step of each int8 code: `z = (q - zero_point) * scale`.
    pub code_scale: [f32; CODE],
    /// The int8 code of a float zero.
    pub code_zero_point: [i8; CODE],
    /// Grid cell of each electrode.
    pub cells: [u8; ELECTRODES],
    /// First convolution.
    pub conv1: IntegerConv,
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
    /// The code of one window, computed in plain loops: the reference that the streaming encoder
    /// must equal bit for bit.
    pub fn encode_window(&self, window: &[Plane; STEPS]) -> [i8; CODE] {
        let input = Volume {
            shape: [1, STEPS, ROWS, COLUMNS],
            values: window
                .as_flattened()
                .iter()
                .map(|&q| i32::from(q))
                .collect(),
        };
        let hidden = convolve(&self.conv1, &input)
            .map_channels(|channel, sum| scale(sum, self.conv1.multipliers[channel]).clamp(0, 255));
        let sums = convolve(&self.conv2, &hidden);
        let features = pool(&sums, &self.conv2.multipliers);

        let linear: Vec<i64> = window
            .iter()
            .flat_map(|plane| {
                self.cells
                    .iter()
                    .map(|&cell| i64::from(plane[usize::from(cell)]))
            })
            .collect();
        std::array::from_fn(|j| {
            let fc = dot(&self.fc.weights[j * FLAT..], &features) + i64::from(self.fc_bias[j]);
            let shortcut = dot(&self.shortcut.weights[j * linear.len()..], &linear);
            let product = fc * i64::from(self.fc.multipliers[j])
                + shortcut * i64::from(self.shortcut.multipliers[j]);
            let q = round_q32(product) + i64::from(self.code_zero_point[j]);
            saturate(q)
        })
    }
}

/// A dense 4-d array, `[channel][time][row][column]`.
struct Volume {
    shape: [usize; 4],
    values: Vec<i32>,
}

impl Volume {
    fn at(&self, channel: usize, time: usize, row: usize, column: usize) -> i32 {
        let [_, times, rows, columns] = self.shape;
        self.values[((channel * times + time) * rows + row) * columns + column]
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
    for out in 0..outputs {
        for (time, row, column) in positions(shape) {
            let mut sum = conv.bias[out];
            for channel in 0..inputs {
                for (dt, dr, dc) in positions([1, 3, 3, 3]) {
                    let tap = (((out * inputs + channel) * 3 + dt) * 3 + dr) * 3 + dc;
                    sum += i32::from(conv.weights[tap])
                        * input.at(channel, time + dt, row + dr, column + dc);
                }
            }
            values.push(sum);
        }
    }
    Volume { shape, values }
}

/// Largest of each 2x2x2 block, requantised; flattened as `[channel][time][row][column]`.
fn pool(sums: &Volume, multipliers: &[i32]) -> Vec<i64> {
    let [steps, rows, columns] = POOLED;
    let mut features = Vec::with_capacity(FLAT);
    for (channel, &multiplier) in multipliers.iter().enumerate() {
        for (time, row, column) in positions([1, steps, rows, columns]) {
            let largest = positions([1, 2, 2, 2])
                .map(|(dt, dr, dc)| sums.at(channel, 2 * time + dt, 2 * row + dr, 2 * column + dc))
                .fold(i32::MIN, i32::max);
            features.push(i64::from(scale(largest, multiplier).clamp(0, 255)));
        }
    }
    features
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

fn saturate(q: i64) -> i8 {
    i8::try_from(q.clamp(-128, 127)).expect("clamped to 8 bits")
}
