//! Writes the model of the packed code as Rust constants.

use std::fmt::Display;

use packed::{LEVELS, MAGNITUDES};

use super::source::{Source, separated};
use crate::device_model::DeviceModel;
use crate::packed::PackedIntegers;

impl Source {
    /// Writes the constant `PACKED`: the packed model, or `None` if the artifact has none.
    pub(super) fn packed(&mut self, model: &DeviceModel) {
        let Some(packed) = &model.packed else {
            self.line(
                "\
/// The artifact has no packed model.
pub const PACKED: Option<Packed<'static>> = None;
",
            );
            return;
        };
        // Write the imports only if there is a packed model; otherwise they would be unused.
        self.line(
            "\
use ::packed::Tables;
use int8_nn::Linear;
use crate::constants::PACKED_COEFFICIENTS;
use crate::packed::Slice;
",
        );
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
        for (name, matrix) in
            [("ANALYSIS", &packed.model.analysis), ("PREDICTION", &packed.model.prediction)]
        {
            self.array(
                &format!("Factors of the packed {}, Q0.32.", name.to_lowercase()),
                &format!("static PACKED_{name}_FACTORS: [i32; PACKED_COEFFICIENTS]"),
                &matrix.factors,
            );
        }
        for (name, levels, kind) in [
            ("PREDICTED", &packed.model.predicted_levels, "predicted blocks"),
            ("RESET", &packed.model.reset_levels, "blocks without prediction"),
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
        self.line(format_args!(
            "/// {doc}\nstatic PACKED_{declaration}; {MAGNITUDES}]; {LEVELS}]; 2] = ["
        ));
        for rows in table {
            self.line("    [");
            for row in rows {
                let row: Vec<String> = row.iter().map(separated).collect();
                self.line(format_args!("        [{}],", row.join(", ")));
            }
            self.line("    ],");
        }
        self.line("];\n");
    }

    fn packed_constant(&mut self, packed: &PackedIntegers) {
        let outputs = packed.model.coefficients();
        self.line(
            "\
/// The packed model.
pub const PACKED: Option<Packed<'static>> = Some(Packed {
    analysis: [",
        );
        for (step, (first, weights)) in packed.analysis().iter().enumerate() {
            let inputs = 2 * weights.len() / outputs;
            self.line(format_args!(
                "        Slice {{
            first: {first},
            matrix: Linear {{ inputs: {inputs}, outputs: PACKED_COEFFICIENTS, weights: &PACKED_ANALYSIS_{step}_WEIGHTS }},
        }},"
            ));
        }
        self.line(format_args!(
            "    ],
    analysis_factors: &PACKED_ANALYSIS_FACTORS,
    prediction: Linear {{ inputs: {}, outputs: PACKED_COEFFICIENTS, weights: &PACKED_PREDICTION_WEIGHTS }},
    prediction_factors: &PACKED_PREDICTION_FACTORS,
    predicted_levels: &PACKED_PREDICTED_LEVELS,
    reset_levels: &PACKED_RESET_LEVELS,
    tables: Tables {{ starts: &PACKED_STARTS, costs: &PACKED_COSTS }},
    input_multiplier: {},
    input_limit: {},
    misfit_energy: {},
    rate: {},
}});",
            outputs / 2,
            separated(packed.input_multiplier),
            separated(packed.model.description.input_limit),
            separated(packed.misfit_energy),
            packed.model.description.rate
        ));
    }
}
