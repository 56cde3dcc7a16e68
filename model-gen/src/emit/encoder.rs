//! Writes the encoder as Rust constants: weights, factors, and the network that refers to them.

use artifact::CodeFormat;
use int8_nn::Pair;

use super::source::{Source, float, separated};
use crate::{
    device_model::DeviceModel,
    integer_model::{IntegerLayer, IntegerModel},
    pack::{self, UnsignedInput},
};

impl Source {
    pub(super) fn convolutions(&mut self, model: &DeviceModel) {
        let IntegerModel { conv1, conv2, .. } = &model.integers;
        self.convolution("CONV1", conv1, &conv1.bias, &pack::input_convolution(conv1));
        let bias = UnsignedInput::from_model(&model.integers).bias;
        self.convolution("CONV2", conv2, &bias, &pack::convolution(&model.integers));
    }

    fn convolution(&mut self, name: &str, conv: &IntegerLayer, bias: &[i32], weights: &[Pair]) {
        let outputs = bias.len();
        self.weights(&format!("Weights of {name}."), name, weights);
        self.array(
            &format!("Bias of {name}, in units of the accumulator."),
            &format!("static {name}_BIAS: [i32; {outputs}]"),
            bias,
        );
        self.array(
            &format!("Requantisation factors of {name}, Q0.32."),
            &format!("static {name}_MULTIPLIERS: [i32; {outputs}]"),
            &conv.multipliers,
        );
    }

    pub(super) fn linear(&mut self, model: &DeviceModel) {
        let integers = &model.integers;
        for (plane, pieces) in pack::fully_connected(integers).iter().enumerate() {
            self.matrices(&format!("FC_{plane}"), pieces);
        }
        self.matrices("SHORTCUT", &pack::shortcut(integers));
        for (name, linear) in [("FC", &integers.fc), ("SHORTCUT", &integers.shortcut)] {
            self.array(
                &format!("Requantisation factors from {name} to the code, Q0.32."),
                &format!("static {name}_MULTIPLIERS: [i32; CODE]"),
                &filled(&linear.multipliers, model.description.code.numbers),
            );
        }
        self.array(
            "Bias of the fully connected layer, in units of the accumulator.",
            "static FC_BIAS: [i32; CODE]",
            &filled(&integers.fc.bias, model.description.code.numbers),
        );
    }

    fn matrices(&mut self, name: &str, matrices: &[Vec<Pair>]) {
        for (index, weights) in matrices.iter().enumerate() {
            let name = format!("{name}_{index}");
            self.weights(&format!("Weights of {name}."), &name, weights);
        }
    }

    pub(super) fn codes(&mut self, model: &DeviceModel) {
        let format = match model.integers.code_format {
            CodeFormat::Int8 => "Int8",
            CodeFormat::Int8Exponent => "Int8Exponent",
            CodeFormat::Int16 => "Int16",
        };
        self.line("/// Integer format of the codes.");
        self.line(format_args!("pub const CODE_FORMAT: CodeFormat = CodeFormat::{format};"));
        self.array(
            "Level of a float zero in each dimension: `z = (level - zero point) * scale`.",
            "pub static CODE_ZERO_POINT: [i8; CODE]",
            &model.integers.code_zero_point,
        );
        let scales: Vec<String> = model.integers.code_scale.iter().map(|&s| float(s)).collect();
        self.list(
            "Scale of each dimension of the code: `z = (level - zero point) * scale`.",
            "pub static CODE_SCALE: [f32; CODE]",
            &scales,
        );
    }

    pub(super) fn network(&mut self, model: &DeviceModel) {
        self.line(
            "\
/// Network of the encoder.
pub static NETWORK: Network<'static> = Network {
    hop: HOP,
    conv1: ConvWeights {
        weights: &CONV1_WEIGHTS,
        bias: &CONV1_BIAS,
        multipliers: &CONV1_MULTIPLIERS,
    },
    conv2: ConvWeights {
        weights: &CONV2_WEIGHTS,
        bias: &CONV2_BIAS,
        multipliers: &CONV2_MULTIPLIERS,
    },",
        );
        let unsigned = UnsignedInput::from_model(&model.integers);
        for (field, channels) in
            [("hidden_padding", unsigned.padding), ("hidden_offset", unsigned.offset)]
        {
            self.line(format_args!("    {field}: ["));
            self.wrapped(&words(&UnsignedInput::to_pairs(channels)));
            self.line("    ],");
        }
        self.line("    fc: [");
        let pieces = pack::fully_connected(&model.integers);
        for (plane, pieces) in pieces.iter().enumerate() {
            let matrices: Vec<String> =
                (0..pieces.len()).map(|piece| format!("&FC_{plane}_{piece}_WEIGHTS")).collect();
            self.line(format_args!("        [{}],", matrices.join(", ")));
        }
        self.line(
            "    ],
    fc_bias: &FC_BIAS,
    fc_multipliers: &FC_MULTIPLIERS,
    shortcut: [",
        );
        for step in 0..pack::shortcut(&model.integers).len() {
            self.line(format_args!("        &SHORTCUT_{step}_WEIGHTS,"));
        }
        self.line(
            "    ],
    shortcut_multipliers: &SHORTCUT_MULTIPLIERS,
    code_zero_point: &CODE_ZERO_POINT,
};",
        );
    }

    pub(super) fn weights(&mut self, doc: &str, name: &str, weights: &[Pair]) {
        let values = words(weights);
        let length = separated(weights.len());
        self.list(doc, &format!("static {name}_WEIGHTS: [Pair; {length}]"), &values);
    }
}

/// Formats pairs of 16-bit numbers as Rust expressions.
fn words(pairs: &[Pair]) -> Vec<String> {
    pairs
        .iter()
        .map(|Pair(bits)| format!("Pair(0x{:04x}_{:04x})", bits >> 16, bits & 0xffff))
        .collect()
}

/// Returns one integer for each value of a code: the factors or biases of a layer, or zeros if the
/// network lacks the layer.
fn filled(integers: &[i32], numbers: usize) -> Vec<i32> {
    let mut filled = integers.to_vec();
    filled.resize(numbers, 0);
    filled
}
