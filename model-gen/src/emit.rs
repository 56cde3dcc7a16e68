//! Rust text for the `model` crate: integers with their meaning, for people to read.

mod chain;
mod encoder;
mod number;

use std::fmt::{Display, Write as _};

use crate::{device_model::DeviceModel, headroom::GUARD_BITS};
use number::{float, separated};

/// The generated part of the `model` crate.
pub fn rust(model: &DeviceModel) -> String {
    let mut out = Source::default();
    out.constants(model);
    out.shape(model);
    out.montage(model);
    out.resampler(&model.resampler);
    for filter in &model.filters {
        out.mains_filter(filter);
    }
    out.convolutions(model);
    out.linear(model);
    out.codes(model);
    out.network(model);
    out.text
}

#[derive(Default)]
struct Source {
    text: String,
}

impl Source {
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
            "From a filtered sample (counts, Q27.5) to a step of the int8 input, Q0.32.",
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

    fn item(&mut self, doc: &str, line: impl Display) {
        for doc in doc.lines() {
            self.line(format_args!("/// {doc}"));
        }
        self.line(line);
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

    fn line(&mut self, line: impl Display) {
        // Writing to a String cannot fail.
        let _ = writeln!(self.text, "{line}");
    }
}
