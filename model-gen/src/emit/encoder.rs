//! The encoder: weights, factors and the network that holds them.

use int8_nn::Pair;

use super::{
    Source,
    number::{float, separated},
};
use crate::{
    DeviceModel,
    integer_model::{IntegerConv, POOLED, STEPS},
    pack,
};

impl Source {
    pub(super) fn convolutions(&mut self, model: &DeviceModel) {
        let (conv1, conv2) = (&model.integers.conv1, &model.integers.conv2);
        self.convolution("CONV1", conv1, &pack::input_convolution(conv1));
        self.convolution("CONV2", conv2, &pack::convolution(conv2));
    }

    fn convolution(&mut self, name: &str, conv: &IntegerConv, weights: &[Pair]) {
        let outputs = conv.bias.len();
        self.weights(&format!("Weights of {name}."), name, weights);
        self.array(
            &format!("Bias of {name}, accumulator steps."),
            &format!("static {name}_BIAS: [i32; {outputs}]"),
            &conv.bias,
        );
        self.array(
            &format!("Requantisation factors behind {name}, Q0.32."),
            &format!("static {name}_MULTIPLIERS: [i32; {outputs}]"),
            &conv.multipliers,
        );
    }

    pub(super) fn linear(&mut self, model: &DeviceModel) {
        let integers = &model.integers;
        self.planes("FC", "pooled plane", &pack::fully_connected(&integers.fc));
        self.planes(
            "SHORTCUT",
            "time step of a window",
            &pack::shortcut(&integers.shortcut),
        );
        for (name, linear) in [("FC", &integers.fc), ("SHORTCUT", &integers.shortcut)] {
            self.array(
                &format!("Requantisation factors of {name} into the code, Q0.32."),
                &format!("static {name}_MULTIPLIERS: [i32; CODE]"),
                &linear.multipliers,
            );
        }
        self.array(
            "Bias of the fully connected layer, accumulator steps.",
            "static FC_BIAS: [i32; CODE]",
            &integers.fc_bias,
        );
    }

    fn planes(&mut self, name: &str, plane: &str, matrices: &[Vec<Pair>]) {
        for (index, weights) in matrices.iter().enumerate() {
            self.weights(
                &format!("Weights of {name} for {plane} {index}."),
                &format!("{name}_{index}"),
                weights,
            );
        }
    }

    pub(super) fn codes(&mut self, model: &DeviceModel) {
        self.array(
            "The int8 code of a float zero: `z = (q - zero point) * scale`.",
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
            "Float code per step of each int8 code.",
            "pub static CODE_SCALE: [f32; CODE]",
            &scales,
        );
    }

    pub(super) fn network(&mut self) {
        self.line("/// The encoder.");
        self.line("pub static NETWORK: Network<'static> = Network {");
        self.line("    hop: HOP,");
        self.line("    conv1: InputConv {");
        self.line("        rows: ROWS,");
        self.line("        output: HIDDEN,");
        self.line("        weights: &CONV1_WEIGHTS,");
        self.line("        bias: &CONV1_BIAS,");
        self.line("        multipliers: &CONV1_MULTIPLIERS,");
        self.line("    },");
        self.line("    conv2: Winograd {");
        self.line("        tile_rows: POOLED.rows,");
        self.line("        outputs: POOLED.channels,");
        self.line("        weights: &CONV2_WEIGHTS,");
        self.line("    },");
        self.line("    conv2_bias: &CONV2_BIAS,");
        self.line("    conv2_multipliers: &CONV2_MULTIPLIERS,");
        for (name, field, inputs, matrices) in [
            ("FC", "fc", "POOLED_PAIRS", POOLED[0]),
            ("SHORTCUT", "shortcut", "ELECTRODE_PAIRS", STEPS),
        ] {
            self.line(format_args!("    {field}: ["));
            for index in 0..matrices {
                self.line(format_args!(
                    "        Linear {{ inputs: {inputs}, outputs: CODE, weights: &{name}_{index}_WEIGHTS }},"
                ));
            }
            self.line("    ],");
            self.line(format_args!(
                "    {field}_multipliers: &{name}_MULTIPLIERS,"
            ));
        }
        self.line("    fc_bias: &FC_BIAS,");
        self.line("    code_zero_point: &CODE_ZERO_POINT,");
        self.line("};");
    }

    fn weights(&mut self, doc: &str, name: &str, weights: &[Pair]) {
        let values: Vec<String> = weights
            .iter()
            .map(|Pair(bits)| format!("Pair(0x{:04x}_{:04x})", bits >> 16, bits & 0xffff))
            .collect();
        let length = separated(weights.len());
        self.list(
            doc,
            &format!("static {name}_WEIGHTS: [Pair; {length}]"),
            &values,
        );
    }
}
