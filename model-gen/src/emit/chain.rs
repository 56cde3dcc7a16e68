//! Writes the filters and the resampler as Rust constants.

use fixed_dsp::{Coefficient, Section};

use super::{number::separated, source::Source};
use crate::{device_model::MainsFilter, headroom::GAIN_LIMIT, resampler::ResamplerTable};

impl Source {
    pub(super) fn resampler(&mut self, table: &ResamplerTable) {
        self.line("/// Resampler from the ADC's rate to the step rate, after any of the filters.");
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

    pub(super) fn mains_filter(&mut self, filter: &MainsFilter) {
        let hz = filter.mains_hz;
        for doc in [
            format!("The filters for {hz} Hz mains as a compile-time constant."),
            String::new(),
            format!("Worst-case gain (L1 norm) of every node; the limit is {GAIN_LIMIT}:"),
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
        self.line(format_args!(
            "/// Filters for {hz} Hz mains, with their delays."
        ));
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
