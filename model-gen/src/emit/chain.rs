//! Writes the filters and the resampler as Rust constants.

use fixed_dsp::{Coefficient, Section};

use super::source::{Source, separated};
use crate::{device_model::MainsFilter, headroom::GAIN_LIMIT, resampler::ResamplerTable};

impl Source {
    pub(super) fn resampler(&mut self, table: &ResamplerTable) {
        self.line(format_args!(
            "\
/// Resampler from the ADC's rate to the step rate; it follows the filters of either mains
/// frequency.
pub static RESAMPLER: Resampler<PHASES, TAPS> = Resampler {{
    down: {},
    taps: [",
            table.down
        ));
        for phase in &table.taps {
            let taps: Vec<String> = phase.iter().map(separated).collect();
            self.line("        [");
            self.wrapped(&taps);
            self.line("        ],");
        }
        self.line("    ],\n};\n");
    }

    pub(super) fn mains_filter(&mut self, filter: &MainsFilter) {
        let hz = filter.mains_hz;
        self.line(format_args!(
            "\
/// The filters for {hz} Hz mains as a compile-time constant.
///
/// Worst-case gain (L1 norm) of every node; the limit is {GAIN_LIMIT}:"
        ));
        for node in &filter.gains {
            self.line(format_args!("/// * {}: {:.3}", node.node, node.gain));
        }
        self.line(format_args!(
            "\
#[derive(Clone, Copy, Debug, Default)]
pub struct Mains{hz};

impl Design<SECTIONS> for Mains{hz} {{
    const CASCADE: Cascade<SECTIONS> = Cascade {{
        sections: ["
        ));
        for section in &filter.sections {
            self.section(section);
        }
        self.line(format_args!(
            "        ],
    }};
}}

/// Filters for {hz} Hz mains, with their delays.
pub static MAINS_{hz}: MainsFilter = MainsFilter {{
    mains_hz: {hz},
    cascade: Mains{hz}::CASCADE,
    group_delay_us: {},
    scalp_delay_us: {},
    settling_samples: {},
    description: {:?},
}};
",
            separated(filter.group_delay_us),
            separated(filter.scalp_delay_us),
            separated(filter.settling_samples),
            filter.description
        ));
    }

    fn section(&mut self, section: &Section) {
        let (shape, coefficients) = match *section {
            Section::Notch { a1, one_minus_b0 } => {
                ("Notch", vec![("a1", a1), ("one_minus_b0", one_minus_b0)])
            }
            Section::HighPass { a1, a2 } => ("HighPass", vec![("a1", a1), ("a2", a2)]),
            Section::BandPass { gain, a1, a2 } => {
                ("BandPass", vec![("gain", gain), ("a1", a1), ("a2", a2)])
            }
            Section::LowPass { gain, a1, a2 } => {
                ("LowPass", vec![("gain", gain), ("a1", a1), ("a2", a2)])
            }
        };
        self.line(format_args!("            Section::{shape} {{"));
        for (name, Coefficient { integer, fraction }) in coefficients {
            let fraction = separated(fraction);
            self.line(format_args!(
                "                {name}: Coefficient {{ integer: {integer}, fraction: {fraction} }},"
            ));
        }
        self.line("            },");
    }
}
