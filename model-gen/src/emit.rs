//! Rust text for the `model` crate: integers with their meaning, for people to read.

use std::fmt::{Display, Write as _};

use fixed_dsp::{Coefficient, Section};

use crate::{
    device_model::{DeviceModel, MainsFilter},
    headroom::GUARD_BITS,
    integer_model::{IntegerConv, POOLED, STEPS},
    pack,
    resampler::ResamplerTable,
};

/// The generated part of the `model` crate.
pub fn rust(model: &DeviceModel) -> String {
    let mut out = Source::default();
    out.constants(model);
    out.montage(model);
    out.resampler(&model.resampler);
    for filter in &model.filters {
        out.mains_filter(filter);
    }
    out.convolution("CONV1", &model.integers.conv1);
    out.convolution("CONV2", &model.integers.conv2);
    out.linear(model);
    out.codes(model);
    out.network();
    out.text
}

#[derive(Default)]
struct Source {
    text: String,
}

impl Source {
    fn line(&mut self, line: impl Display) {
        // Writing to a String cannot fail.
        let _ = writeln!(self.text, "{line}");
    }

    fn item(&mut self, doc: &str, line: impl Display) {
        for doc in doc.lines() {
            self.line(format_args!("/// {doc}"));
        }
        self.line(line);
        self.line("");
    }

    fn constants(&mut self, model: &DeviceModel) {
        let description = &model.description;
        self.item(
            "First 8 bytes of the SHA-256 over the artifact.",
            format_args!("pub const MODEL_ID: [u8; 8] = {:?};", model.id.0),
        );
        self.item(
            "Sampling rate of the ADC, Hz.",
            format_args!("pub const ADC_RATE_HZ: u16 = {};", description.adc.rate_hz),
        );
        self.item(
            "Channels of the ADC chain; a sample has as many counts.",
            format_args!("pub const CHANNELS: usize = {};", description.adc.channels),
        );
        self.item(
            "Nanovolt per ADC count: 2 * reference / gain / 2^24.",
            format_args!("pub const LSB_NV: f32 = {};", float(model.lsb_nv())),
        );
        self.item(
            "Rate of the encoder's time steps, Hz.",
            format_args!(
                "pub const STEP_RATE_HZ: u16 = {};",
                description.window.rate_hz
            ),
        );
        self.item(
            "Time steps from one window to the next.",
            format_args!("pub const HOP: usize = {};", description.window.hop),
        );
        self.item(
            "From the middle of a window to its last step, microseconds.",
            format_args!(
                "pub const WINDOW_CENTRE_US: u32 = {};",
                separated(model.window_centre_us())
            ),
        );
        self.item(
            "Bits below a count that a filtered sample carries.",
            format_args!("pub const GUARD_BITS: u32 = {GUARD_BITS};"),
        );
        self.item(
            "From a filtered sample (counts, Q28.4) to a step of the int8 input, Q0.32.",
            format_args!(
                "pub const INPUT_MULTIPLIER: i32 = {};",
                separated(model.input_multiplier)
            ),
        );
        self.item(
            "Microvolt per step of the int8 input.",
            format_args!(
                "pub const INPUT_SCALE_UV: f32 = {};",
                float(model.integers.input_scale_uv)
            ),
        );
        self.item(
            "Sections of each filter cascade.",
            format_args!(
                "pub const SECTIONS: usize = {};",
                model.filters[0].sections.len()
            ),
        );
    }

    fn montage(&mut self, model: &DeviceModel) {
        let labels = &model.description.montage.electrodes;
        self.item(
            "Electrode labels, blank-separated; the index is the ADC channel.",
            format_args!("pub const LABELS: &str = {:?};", labels.join(" ")),
        );
        self.array(
            "Cell of the scalp grid (row * 9 + column) of each electrode.",
            "pub static GRID_CELL: [u8; ELECTRODES]",
            &model.integers.cells,
        );
    }

    fn resampler(&mut self, table: &ResamplerTable) {
        self.item(
            "Phases of the resampler: outputs per [`RESAMPLER`]`.down` samples.",
            format_args!("pub const PHASES: usize = {};", table.phases()),
        );
        self.item(
            "Taps of each phase: samples that make an output.",
            format_args!("pub const TAPS: usize = {};", table.taps_per_phase()),
        );
        self.line("/// From the ADC's rate to that of the steps.");
        self.line("pub static RESAMPLER: Resampler<PHASES, TAPS> = Resampler {");
        self.line(format_args!("    down: {},", table.down));
        self.line("    taps: [");
        for phase in &table.taps {
            let taps: Vec<String> = phase.iter().map(separated).collect();
            self.line("        [");
            self.wrapped(&taps);
            self.line("        ],");
        }
        self.line("    ],");
        self.line("};");
        self.line("");
    }

    fn mains_filter(&mut self, filter: &MainsFilter) {
        let hz = filter.mains_hz;
        for doc in [
            format!("The filters for {hz} Hz mains, as code of their own."),
            String::new(),
            "Worst-case gains (L1 norms) of every node, to stay below 16:".to_owned(),
        ] {
            self.line(format_args!("/// {doc}").to_string().trim_end());
        }
        for node in &filter.gains {
            self.line(format_args!("/// * {}: {:.3}", node.node, node.gain));
        }
        self.line("#[derive(Clone, Copy, Debug, Default)]");
        self.line(format_args!("pub struct Mains{hz};"));
        self.line("");
        self.line(format_args!("impl Design<SECTIONS> for Mains{hz} {{"));
        self.line("    const CASCADE: Cascade<SECTIONS> = Cascade {");
        self.line("        sections: [");
        for section in &filter.sections {
            self.section(section);
        }
        self.line("        ],");
        self.line("    };");
        self.line("}");
        self.line("");
        self.line(format_args!("/// The filters for {hz} Hz mains."));
        self.line(format_args!(
            "pub static MAINS_{hz}: MainsFilter = MainsFilter {{"
        ));
        self.line(format_args!("    mains_hz: {hz},"));
        self.line(format_args!("    cascade: Mains{hz}::CASCADE,"));
        self.line(format_args!(
            "    group_delay_us: {},",
            separated(filter.group_delay_us)
        ));
        self.line(format_args!(
            "    scalp_delay_us: {},",
            separated(filter.scalp_delay_us)
        ));
        self.line(format_args!(
            "    settling_samples: {},",
            separated(filter.settling_samples)
        ));
        self.line(format_args!("    description: {:?},", filter.description));
        self.line("};");
        self.line("");
    }

    fn section(&mut self, section: &Section) {
        let (shape, coefficients) = match *section {
            Section::Notch { turn, loss } => ("Notch", vec![("turn", turn), ("loss", loss)]),
            Section::HighPass { first, second } => {
                ("HighPass", vec![("first", first), ("second", second)])
            }
            Section::BandPass {
                gain,
                first,
                second,
            } => (
                "BandPass",
                vec![("gain", gain), ("first", first), ("second", second)],
            ),
            Section::LowPass {
                gain,
                first,
                second,
            } => (
                "LowPass",
                vec![("gain", gain), ("first", first), ("second", second)],
            ),
        };
        self.line(format_args!("            Section::{shape} {{"));
        for (name, Coefficient { integer, remainder }) in coefficients {
            let remainder = separated(remainder);
            self.line(format_args!(
                "                {name}: Coefficient {{ integer: {integer}, remainder: {remainder} }},"
            ));
        }
        self.line("            },");
    }

    fn convolution(&mut self, name: &str, conv: &IntegerConv) {
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

    fn linear(&mut self, model: &DeviceModel) {
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

    fn network(&mut self) {
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

    fn codes(&mut self, model: &DeviceModel) {
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

    fn weights(&mut self, doc: &str, name: &str, weights: &[i8]) {
        let values: Vec<String> = weights.iter().map(ToString::to_string).collect();
        let length = separated(weights.len());
        self.line(format_args!("/// {doc}"));
        self.line(format_args!("static {name}: Aligned<{length}> = Aligned(["));
        self.wrapped(&values);
        self.line("]);");
        self.line("");
    }

    fn array<T: Display>(&mut self, doc: &str, declaration: &str, values: &[T]) {
        let values: Vec<String> = values.iter().map(separated).collect();
        self.list(doc, declaration, &values);
    }

    fn list(&mut self, doc: &str, declaration: &str, values: &[String]) {
        self.line(format_args!("/// {doc}"));
        self.line(format_args!("{declaration} = ["));
        self.wrapped(values);
        self.line("];");
        self.line("");
    }

    fn wrapped(&mut self, values: &[String]) {
        let mut row = String::from("   ");
        for value in values {
            if row.len() + value.len() + 2 > 100 {
                self.line(&row);
                row.truncate(3);
            }
            let _ = write!(row, " {value},");
        }
        self.line(&row);
    }
}

/// An integer with a separator every three digits.
fn separated(value: impl Display) -> String {
    let text = value.to_string();
    let (sign, digits) = text
        .strip_prefix('-')
        .map_or(("", text.as_str()), |rest| ("-", rest));
    let mut out = String::from(sign);
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            out.push('_');
        }
        out.push(digit);
    }
    out
}

/// A float literal that reads back to the same bits, its digits grouped by three.
fn float(value: f32) -> String {
    let text = format!("{value:?}");
    let (number, exponent) = text
        .split_once('e')
        .map_or((text.as_str(), None), |(n, e)| (n, Some(e)));
    let (whole, fraction) = number.split_once('.').unwrap_or((number, "0"));
    let fraction: Vec<&str> = (0..fraction.len())
        .step_by(3)
        .map(|at| &fraction[at..fraction.len().min(at + 3)])
        .collect();
    let mut literal = format!("{}.{}", separated(whole), fraction.join("_"));
    if let Some(exponent) = exponent {
        let _ = write!(literal, "e{exponent}");
    }
    literal
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_are_grouped_by_three() {
        assert_eq!(separated(1_234_567), "1_234_567");
        assert_eq!(separated(-123), "-123");
        assert_eq!(separated(-1_000), "-1_000");
    }

    #[test]
    fn a_float_literal_reads_back_to_the_same_bits() {
        for value in [22.351_742_f32, 1.0, 3.4e-7, 1e-7, 1_234.567_9, -0.25] {
            assert_eq!(float(value).replace('_', "").parse(), Ok(value));
        }
        assert_eq!(float(22.351_742), "22.351_742");
    }
}
