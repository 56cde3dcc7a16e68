//! Writes the packed model as Rust constants.

use std::fmt::Display;

use packed::{LEVELS, MAGNITUDES};

use super::number::separated;
use super::source::Source;
use crate::device_model::DeviceModel;
use crate::packed::PackedIntegers;

impl Source {
    /// Writes the constants from which `model` derives the lengths of the packed model's arrays.
    pub(super) fn packed_shape(&mut self, model: &DeviceModel) {
        let packed = model.packed.as_ref();
        for (doc, name, value) in [
            (
                "Coefficients of a packed block; 0 if the model has no packed model.",
                "PACKED_COEFFICIENTS",
                packed.map_or(0, |packed| packed.model.coefficients()),
            ),
            (
                "Pairs of input values of a packed block, zeros at its end included.",
                "PACKED_INPUT_PAIRS",
                packed.map_or(0, PackedIntegers::input_pairs),
            ),
        ] {
            self.item(doc, format_args!("pub const {name}: usize = {value};"));
        }
    }

    /// Writes the packed model, or `None`.
    pub(super) fn packed(&mut self, model: &DeviceModel) {
        let Some(packed) = &model.packed else {
            self.item(
                "The artifact has no packed model.",
                "pub const PACKED: Option<Packed<'static>> = None;",
            );
            return;
        };
        // Without a packed model, `model` would not use these names.
        for name in [
            "::packed::Tables",
            "int8_nn::Linear",
            "crate::constants::PACKED_COEFFICIENTS",
            "crate::packed::Slice",
        ] {
            self.line(format_args!("use {name};"));
        }
        self.line("");
        for (step, (_, weights)) in packed.analysis().iter().enumerate() {
            self.weights(
                &format!("Weights of the packed analysis after step {step}."),
                &format!("PACKED_ANALYSIS_{step}"),
                weights,
            );
        }
        self.weights(
            "Weights of the packed prediction.",
            "PACKED_PREDICTION",
            &packed.prediction(),
        );
        for (name, matrix) in [
            ("ANALYSIS", &packed.model.analysis),
            ("PREDICTION", &packed.model.prediction),
        ] {
            self.array(
                &format!("Factors of the packed {}, Q0.32.", name.to_lowercase()),
                &format!("static PACKED_{name}_FACTORS: [i32; PACKED_COEFFICIENTS]"),
                &matrix.factors,
            );
        }
        for (name, levels, kind) in [
            (
                "PREDICTED",
                &packed.model.predicted_levels,
                "predicted blocks",
            ),
            (
                "RESET",
                &packed.model.reset_levels,
                "blocks without prediction",
            ),
        ] {
            self.array(
                &format!("Levels of the mean magnitudes of {kind}."),
                &format!("static PACKED_{name}_LEVELS: [u8; PACKED_COEFFICIENTS]"),
                levels,
            );
        }
        self.table(
            "First frequencies of the magnitudes.",
            "STARTS: [[[u16",
            packed.model.starts.as_ref(),
        );
        self.table(
            "Bits of the magnitudes, 1/16 bit.",
            "COSTS: [[[u8",
            packed.model.costs().as_ref(),
        );
        self.packed_constant(packed);
    }

    fn table<T: Display>(
        &mut self,
        doc: &str,
        declaration: &str,
        table: &[[[T; MAGNITUDES]; LEVELS]; 2],
    ) {
        self.line(format_args!("/// {doc}"));
        self.line(format_args!(
            "static PACKED_{declaration}; {MAGNITUDES}]; {LEVELS}]; 2] = ["
        ));
        for rows in table {
            self.line("    [");
            for row in rows {
                let row: Vec<String> = row.iter().map(separated).collect();
                self.line(format_args!("        [{}],", row.join(", ")));
            }
            self.line("    ],");
        }
        self.line("];");
        self.line("");
    }

    fn packed_constant(&mut self, packed: &PackedIntegers) {
        let outputs = packed.model.coefficients();
        self.line("/// The packed model.");
        self.line("pub const PACKED: Option<Packed<'static>> = Some(Packed {");
        self.line("    analysis: [");
        for (step, (first, weights)) in packed.analysis().iter().enumerate() {
            let inputs = 2 * weights.len() / outputs;
            self.line("        Slice {");
            self.line(format_args!("            first: {first},"));
            self.line(format_args!(
                "            matrix: Linear {{ inputs: {inputs}, outputs: PACKED_COEFFICIENTS, weights: &PACKED_ANALYSIS_{step}_WEIGHTS }},"
            ));
            self.line("        },");
        }
        self.line("    ],");
        self.line("    analysis_factors: &PACKED_ANALYSIS_FACTORS,");
        self.line(format_args!(
            "    prediction: Linear {{ inputs: {}, outputs: PACKED_COEFFICIENTS, weights: &PACKED_PREDICTION_WEIGHTS }},",
            outputs / 2
        ));
        self.line("    prediction_factors: &PACKED_PREDICTION_FACTORS,");
        self.line("    predicted_levels: &PACKED_PREDICTED_LEVELS,");
        self.line("    reset_levels: &PACKED_RESET_LEVELS,");
        self.line("    tables: Tables { starts: &PACKED_STARTS, costs: &PACKED_COSTS },");
        self.line(format_args!(
            "    input_multiplier: {},",
            separated(packed.input_multiplier)
        ));
        self.line(format_args!(
            "    input_limit: {},",
            separated(packed.model.description.input_limit)
        ));
        self.line(format_args!(
            "    misfit_energy: {},",
            separated(packed.misfit_energy)
        ));
        self.line(format_args!("    rate: {},", packed.model.description.rate));
        self.line("});");
    }
}
