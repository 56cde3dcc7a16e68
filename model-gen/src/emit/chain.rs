//! The filters and the resampler.

use fixed_dsp::{Coefficient, Section};

use super::{Source, number::separated};
use crate::{MainsFilter, ResamplerTable, headroom::ROOM};

impl Source {
    pub(super) fn resampler(&mut self, table: &ResamplerTable) {
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

    pub(super) fn mains_filter(&mut self, filter: &MainsFilter) {
        let hz = filter.mains_hz;
        for doc in [
            format!("The filters for {hz} Hz mains, as code of their own."),
            String::new(),
            format!("Worst-case gains (L1 norms) of every node, to stay below {ROOM}:"),
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
}
