//! The encoder: weights, factors and the network that holds them.

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
    pub(super) fn convolution(&mut self, name: &str, conv: &IntegerConv) {
        let outputs = conv.bias.len();
        self.weights(
            &format!("Weights of {name}, `[time][row][column][input][output]`."),
            &format!("{name}_WEIGHTS"),
            &pack::convolution(conv),
        );
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

    fn planes(&mut self, name: &str, plane: &str, matrices: &[Vec<i8>]) {
        for (index, weights) in matrices.iter().enumerate() {
            self.weights(
                &format!("Weights of {name} for {plane} {index}, `[input][output]`."),
                &format!("{name}_{index}_WEIGHTS"),
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
        for (name, field, input, output) in [
            ("CONV1", "conv1", "CELL_PLANE", "HIDDEN"),
            ("CONV2", "conv2", "HIDDEN", "SUMS"),
        ] {
            self.line(format_args!("    {field}: Conv3d {{"));
            self.line(format_args!("        input: {input},"));
            self.line(format_args!("        output_channels: {output}.channels,"));
            self.line(format_args!("        weights: &{name}_WEIGHTS.0,"));
            self.line(format_args!("        bias: &{name}_BIAS,"));
            self.line("    },");
            self.line(format_args!(
                "    {field}_multipliers: &{name}_MULTIPLIERS,"
            ));
        }
        for (name, field, matrices) in [("FC", "fc", POOLED[0]), ("SHORTCUT", "shortcut", STEPS)] {
            self.line(format_args!("    {field}: ["));
            for index in 0..matrices {
                self.line(format_args!(
                    "        Linear {{ outputs: CODE, weights: &{name}_{index}_WEIGHTS.0 }},"
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

    fn weights(&mut self, doc: &str, name: &str, weights: &[i8]) {
        let values: Vec<String> = weights.iter().map(ToString::to_string).collect();
        let length = separated(weights.len());
        self.line(format_args!("/// {doc}"));
        self.line(format_args!("static {name}: Aligned<{length}> = Aligned(["));
        self.wrapped(&values);
        self.line("]);");
        self.line("");
    }
}
