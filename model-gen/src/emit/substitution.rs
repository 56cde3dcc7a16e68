//! Writes the table of substitutions as Rust constants.

use super::source::Source;
use crate::device_model::DeviceModel;
use crate::pack;

impl Source {
    /// Writes the constant `SUBSTITUTION`: the table of substitutions, or `None` if the artifact
    /// has none.
    pub(super) fn substitution(&mut self, model: &DeviceModel) {
        let Some(table) = &model.substitution else {
            self.line(
                "
/// The artifact has no table of substitutions.
pub const SUBSTITUTION: Option<Substitution<'static>> = None;",
            );
            return;
        };
        // Write the import only if there is a table; otherwise it would be unused.
        self.line("\nuse crate::shapes::{ELECTRODE_OUTPUTS, ELECTRODE_PAIRS};\n");
        self.weights(
            "Weights with which electrodes are predicted from the others.",
            "SUBSTITUTION",
            &pack::substitution(table),
        );
        self.array(
            "Typical mean square of each electrode's innovation, (1/16 uV)^2.",
            "static SUBSTITUTION_INNOVATION: [i32; ELECTRODES]",
            &table.innovation,
        );
        self.line(
            "\
/// The table of substitutions.
pub const SUBSTITUTION: Option<Substitution<'static>> = Some(Substitution {
    prediction: int8_nn::Linear {
        inputs: ELECTRODE_PAIRS,
        outputs: ELECTRODE_OUTPUTS,
        weights: &SUBSTITUTION_WEIGHTS,
    },
    innovation: &SUBSTITUTION_INNOVATION,
});",
        );
    }
}
