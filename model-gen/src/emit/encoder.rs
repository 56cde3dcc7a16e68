//! The encoder: weights, factors and the network that holds them.

use artifact::{CodeFormat, Description};
use int8_nn::Pair;

use super::{
    Source,
    number::{float, separated},
};
use crate::{
    DeviceModel,
    conv_kernel::ConvKernel,
    integer_model::{CODE, IntegerConv, IntegerModel},
    pack::{self, Unsigned},
};

impl Source {
    pub(super) fn convolutions(&mut self, model: &DeviceModel) {
        let IntegerModel { conv1, conv2, .. } = &model.integers;
        self.convolution("CONV1", conv1, &conv1.bias, &pack::input_convolution(conv1));
        let bias = Unsigned::of(&model.integers).bias;
        self.convolution("CONV2", conv2, &bias, &pack::convolution(&model.integers));
    }

    fn convolution(&mut self, name: &str, conv: &IntegerConv, bias: &[i32], weights: &[Pair]) {
        let outputs = bias.len();
        self.weights(&format!("Weights of {name}."), name, weights);
        self.array(
            &format!("Bias of {name}, accumulator steps."),
            &format!("static {name}_BIAS: [i32; {outputs}]"),
            bias,
        );
        self.array(
            &format!("Requantisation factors behind {name}, Q0.32."),
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
                &format!("Requantisation factors of {name} into the code, Q0.32."),
                &format!("static {name}_MULTIPLIERS: [i32; CODE]"),
                &filled(&linear.multipliers),
            );
        }
        self.array(
            "Bias of the fully connected layer, accumulator steps.",
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
        self.line("/// The integers of a code.");
        self.line(format_args!(
            "pub const CODE_FORMAT: CodeFormat = CodeFormat::{format};"
        ));
        self.array(
            "The step of a float zero: `z = (step - zero point) * scale`.",
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
            "Float code per step of the code.",
            "pub static CODE_SCALE: [f32; CODE]",
            &scales,
        );
    }

    /// Shape and kernels: what the arrays of the network are counted by.
    pub(super) fn shape(&mut self, model: &DeviceModel) {
        let Description { mode, network, .. } = &model.description;
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
                network.padding.pads_space(),
            ),
            (
                "Whether the convolutions pad the steps of a window.",
                "PADS_TIME",
                network.padding.pads_time(),
            ),
        ] {
            self.item(doc, format_args!("pub const {name}: bool = {value};"));
        }
        self.item(
            "Steps, rows and columns of the max-pool.",
            format_args!("pub const POOL: [usize; 3] = {:?};", network.pool),
        );
        let (kernel, fields) = match ConvKernel::of(&model.integers) {
            ConvKernel::Winograd => (
                "Winograd",
                "tile_rows: POOLED.rows, outputs: POOLED.channels",
            ),
            ConvKernel::Direct => ("Direct", "pool: [POOL[1], POOL[2]], pooled: POOLED"),
        };
        self.item(
            "Matrices of the fully connected layer for a pooled plane.",
            format_args!(
                "pub const FC_PIECES: usize = {};",
                pack::fc_pieces(&model.integers)
            ),
        );
        self.item(
            "The kernel of the second convolution.",
            format_args!(
                "pub type Conv2<'w> = int8_nn::{kernel}<'w, HIDDEN_PAIRS, {{ HIDDEN.columns }}>;"
            ),
        );
        self.line("const fn conv2(weights: &[Pair]) -> Conv2<'_> {");
        self.line(format_args!(
            "    int8_nn::{kernel} {{ {fields}, weights }}"
        ));
        self.line("}");
        self.line("");
    }

    pub(super) fn network(&mut self, model: &DeviceModel) {
        let unsigned = Unsigned::of(&model.integers);
        self.line("/// The encoder.");
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
            self.wrapped(&words(&Unsigned::pairs(channels)));
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

    fn weights(&mut self, doc: &str, name: &str, weights: &[Pair]) {
        let values = words(weights);
        let length = separated(weights.len());
        self.list(
            doc,
            &format!("static {name}_WEIGHTS: [Pair; {length}]"),
            &values,
        );
    }
}

/// Pairs as Rust.
fn words(pairs: &[Pair]) -> Vec<String> {
    pairs
        .iter()
        .map(|Pair(bits)| format!("Pair(0x{:04x}_{:04x})", bits >> 16, bits & 0xffff))
        .collect()
}

/// Factors into the code, zeros where the network has no such layer.
fn filled(multipliers: &[i32]) -> Vec<i32> {
    let mut filled = vec![0; CODE];
    filled[..multipliers.len()].copy_from_slice(multipliers);
    filled
}
