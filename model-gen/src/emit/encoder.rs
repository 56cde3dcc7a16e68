//! Writes the encoder as Rust constants: weights, factors and the network that refers to them.

use artifact::{CodeFormat, Description, Padding};
use int8_nn::Pair;

use super::{
    number::{float, separated},
    source::Source,
};
use crate::{
    device_model::DeviceModel,
    integer_model::{IntegerConv, IntegerModel},
    pack::{self, ConvKernel, UnsignedInput},
};

impl Source {
    pub(super) fn convolutions(&mut self, model: &DeviceModel) {
        let IntegerModel { conv1, conv2, .. } = &model.integers;
        self.convolution("CONV1", conv1, &conv1.bias, &pack::input_convolution(conv1));
        let bias = UnsignedInput::from_model(&model.integers).bias;
        self.convolution("CONV2", conv2, &bias, &pack::convolution(&model.integers));
    }

    fn convolution(&mut self, name: &str, conv: &IntegerConv, bias: &[i32], weights: &[Pair]) {
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
            &integers.fc_bias,
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
        self.line(format_args!(
            "pub const CODE_FORMAT: CodeFormat = CodeFormat::{format};"
        ));
        self.array(
            "Level of a float zero in each dimension: `z = (level - zero point) * scale`.",
            "pub static CODE_ZERO_POINT: [i8; CODE]",
            &model.integers.code_zero_point,
        );
        let scales: Vec<String> = model
            .integers
            .code_scale
            .iter()
            .map(|&s| float(s))
            .collect();
        self.list(
            "Scale of each dimension of the code: `z = (level - zero point) * scale`.",
            "pub static CODE_SCALE: [f32; CODE]",
            &scales,
        );
    }

    /// Writes the constants from which `model` derives the lengths of the network's arrays, and its
    /// convolution kernel.
    pub(super) fn shape(&mut self, model: &DeviceModel) {
        let Description { mode, network, .. } = &model.description;
        // A network without convolutions has neither padding nor pool, whatever its description states.
        let (padding, pool) = if mode.has_convolutions() {
            (network.padding, network.pool)
        } else {
            (Padding::None, [1, 1, 1])
        };
        for (doc, name, value) in [
            (
                "Whether the network has convolutions.",
                "HAS_CONVOLUTIONS",
                mode.has_convolutions(),
            ),
            (
                "Whether the network has a linear shortcut.",
                "HAS_SHORTCUT",
                mode.has_shortcut(),
            ),
            (
                "Whether the convolutions pad rows and columns.",
                "PADS_SPACE",
                padding.pads_space(),
            ),
            (
                "Whether the convolutions pad steps.",
                "PADS_TIME",
                padding.pads_time(),
            ),
        ] {
            self.item(doc, format_args!("pub const {name}: bool = {value};"));
        }
        self.item(
            "Steps, rows and columns of the max-pool.",
            format_args!("pub const POOL: [usize; 3] = {pool:?};"),
        );
        self.item(
            "Matrices of the fully connected layer for each pooled plane.",
            format_args!(
                "pub const FC_PIECES: usize = {};",
                pack::fc_pieces(&model.integers)
            ),
        );
        let (kernel, fields) = match ConvKernel::select(&model.integers) {
            ConvKernel::Winograd => (
                "Winograd",
                "tile_rows: pooled.rows, outputs: pooled.channels",
            ),
            ConvKernel::Direct => ("Direct", "pool: [POOL[1], POOL[2]], pooled"),
        };
        let columns = "const PAIRS: usize, const COLUMNS: usize";
        self.item(
            "Kernel of the second convolution, for pairs of input channels and columns of the input.",
            format_args!(
                "pub type ConvKernel<'w, {columns}> = int8_nn::{kernel}<'w, PAIRS, COLUMNS>;"
            ),
        );
        self.line("/// Returns the second convolution, with the shape of a pooled plane.");
        self.line(format_args!("pub(crate) const fn conv_kernel<{columns}>("));
        self.line("    pooled: PlaneShape,");
        self.line("    weights: &[Pair],");
        self.line(") -> ConvKernel<'_, PAIRS, COLUMNS> {");
        self.line(format_args!(
            "    int8_nn::{kernel} {{ {fields}, weights }}"
        ));
        self.line("}");
    }

    pub(super) fn network(&mut self, model: &DeviceModel) {
        let unsigned = UnsignedInput::from_model(&model.integers);
        self.line("/// Network of the encoder.");
        self.line("pub static NETWORK: Network<'static> = Network {");
        self.line("    hop: HOP,");
        for (field, name) in [("conv1", "CONV1"), ("conv2", "CONV2")] {
            self.line(format_args!("    {field}: ConvWeights {{"));
            self.line(format_args!("        weights: &{name}_WEIGHTS,"));
            self.line(format_args!("        bias: &{name}_BIAS,"));
            self.line(format_args!("        multipliers: &{name}_MULTIPLIERS,"));
            self.line("    },");
        }
        for (field, channels) in [
            ("hidden_padding", unsigned.padding),
            ("hidden_offset", unsigned.offset),
        ] {
            self.line(format_args!("    {field}: ["));
            self.wrapped(&words(&UnsignedInput::to_pairs(channels)));
            self.line("    ],");
        }
        self.line("    fc: [");
        let pieces = pack::fully_connected(&model.integers);
        for (plane, pieces) in pieces.iter().enumerate() {
            let matrices: Vec<String> = (0..pieces.len())
                .map(|piece| format!("&FC_{plane}_{piece}_WEIGHTS"))
                .collect();
            self.line(format_args!("        [{}],", matrices.join(", ")));
        }
        self.line("    ],");
        self.line("    fc_bias: &FC_BIAS,");
        self.line("    fc_multipliers: &FC_MULTIPLIERS,");
        self.line("    shortcut: [");
        for step in 0..pack::shortcut(&model.integers).len() {
            self.line(format_args!("        &SHORTCUT_{step}_WEIGHTS,"));
        }
        self.line("    ],");
        self.line("    shortcut_multipliers: &SHORTCUT_MULTIPLIERS,");
        self.line("    code_zero_point: &CODE_ZERO_POINT,");
        self.line("};");
    }

    pub(super) fn weights(&mut self, doc: &str, name: &str, weights: &[Pair]) {
        let values = words(weights);
        let length = separated(weights.len());
        self.list(
            doc,
            &format!("static {name}_WEIGHTS: [Pair; {length}]"),
            &values,
        );
    }
}

/// Formats pairs as Rust expressions.
fn words(pairs: &[Pair]) -> Vec<String> {
    pairs
        .iter()
        .map(|Pair(bits)| format!("Pair(0x{:04x}_{:04x})", bits >> 16, bits & 0xffff))
        .collect()
}

/// Returns the factors of a layer, one for each number of a code, or zeros if the network does not have
/// the layer.
fn filled(multipliers: &[i32], numbers: usize) -> Vec<i32> {
    let mut filled = multipliers.to_vec();
    filled.resize(numbers, 0);
    filled
}
