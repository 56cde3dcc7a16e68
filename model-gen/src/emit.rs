//! Writes the generated files of the `model` crate: documented constants and statics in Rust.

mod chain;
mod encoder;
mod number;
mod packed;
mod source;

use artifact::{CONV1_CHANNELS, CONV2_CHANNELS};

use crate::{device_model::DeviceModel, headroom::GUARD_BITS};
use number::{float, separated};
use source::Source;

/// Returns the generated files of the `model` crate: names and Rust sources.
///
/// The constants in the first file use no type of `model`, so that the types of `model` can use
/// these constants.
pub fn rust_files(model: &DeviceModel) -> [(&'static str, String); 2] {
    let mut constants = Source::default();
    constants.constants(model);
    constants.dimensions(model);
    constants.shape(model);
    constants.packed_shape(model);
    let mut statics = Source::default();
    statics.grid_cells(model);
    statics.resampler(&model.resampler);
    for filter in &model.filters {
        statics.mains_filter(filter);
    }
    statics.convolutions(model);
    statics.linear(model);
    statics.codes(model);
    statics.network(model);
    statics.packed(model);
    [
        ("constants.rs", constants.text),
        ("statics.rs", statics.text),
    ]
}

impl Source {
    fn constants(&mut self, model: &DeviceModel) {
        let description = &model.description;
        self.item(
            "Id of the model: first 8 bytes of the SHA-256 over the artifact.",
            format_args!("pub const MODEL_ID: [u8; 8] = {:?};", model.id.0),
        );
        self.item(
            "Sampling rate of the ADC, Hz.",
            format_args!("pub const ADC_RATE_HZ: u16 = {};", description.adc.rate_hz),
        );
        self.item(
            "Channels of the ADC chain; a sample has one count for each.",
            format_args!("pub const CHANNELS: usize = {};", description.adc.channels),
        );
        self.item(
            "Gain of the amplifier before the ADC.",
            format_args!("pub const GAIN: u32 = {};", description.adc.gain),
        );
        self.item(
            "Nanovolts of one ADC count: 2 * reference / gain / 2^24.",
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
            "Time steps from the start of one window to the start of the next.",
            format_args!("pub const HOP: usize = {};", description.window.hop),
        );
        self.item(
            "Time from the middle of a window to its last step, microseconds.",
            format_args!(
                "pub const WINDOW_CENTRE_US: u32 = {};",
                separated(model.window_centre_us())
            ),
        );
        self.item(
            "Fraction bits of a filtered sample, below one ADC count.",
            format_args!("pub const GUARD_BITS: u32 = {GUARD_BITS};"),
        );
        self.item(
            "Factor from a filtered sample (counts, Q27.5) to a level of the int8 input, Q0.32.",
            format_args!(
                "pub const INPUT_MULTIPLIER: i32 = {};",
                separated(model.input_multiplier)
            ),
        );
        self.item(
            "Microvolts of one level of the int8 input.",
            format_args!(
                "pub const INPUT_SCALE_UV: f32 = {};",
                float(model.integers.input_scale_uv)
            ),
        );
        self.item(
            "Number of sections of each filter cascade.",
            format_args!(
                "pub const SECTIONS: usize = {};",
                model.filters[0].sections.len()
            ),
        );
        self.item(
            "Phases of the resampler: outputs for every `RESAMPLER.down` samples.",
            format_args!("pub const PHASES: usize = {};", model.resampler.phases()),
        );
        self.item(
            "Taps of each phase: samples from which an output is computed.",
            format_args!(
                "pub const TAPS: usize = {};",
                model.resampler.taps_per_phase()
            ),
        );
        let labels = description.montage.electrodes.join(" ");
        self.item(
            "Electrode labels, separated by blanks; the index is the ADC channel.",
            format_args!("pub const LABELS: &str = {labels:?};"),
        );
    }

    fn dimensions(&mut self, model: &DeviceModel) {
        let description = &model.description;
        for (doc, name, value) in [
            (
                "Electrodes of the montage; electrode `e` is wired to ADC channel `e`.",
                "ELECTRODES",
                description.montage.electrodes.len(),
            ),
            (
                "Rows of the scalp grid, front to back.",
                "ROWS",
                description.grid.rows,
            ),
            (
                "Columns of the scalp grid, left to right.",
                "COLUMNS",
                description.grid.columns,
            ),
            ("Time steps of a window.", "STEPS", description.window.steps),
            (
                "Numbers in a code; 0 in a model without a network.",
                "CODE",
                model.integers.code_scale.len(),
            ),
            (
                "Output channels of the first convolution.",
                "CONV1_CHANNELS",
                CONV1_CHANNELS,
            ),
            (
                "Output channels of the second convolution.",
                "CONV2_CHANNELS",
                CONV2_CHANNELS,
            ),
        ] {
            self.item(doc, format_args!("pub const {name}: usize = {value};"));
        }
    }

    fn grid_cells(&mut self, model: &DeviceModel) {
        self.array(
            "Cell of the scalp grid, `row * COLUMNS + column`, of each electrode.",
            "pub static GRID_CELL: [u8; ELECTRODES]",
            &model.integers.cells,
        );
    }
}
