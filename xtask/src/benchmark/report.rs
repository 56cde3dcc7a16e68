//! The benchmark's figures, their limits, and how both are shown.

use std::fmt;

use bench::contender::NAMES;
use model::{ELECTRODES, SECTIONS};
use serde::Serialize;

use super::counts::Counts;
use super::inputs::Inputs;
use super::noise::{InBand, Noise};
use super::published::{PUBLISHED, Published};
use crate::failure::Failure;

/// Most instructions per sample and electrode: measured 55.7; a compiler may spill one register more.
const MOST_INSTRUCTIONS: f64 = 58.0;
/// Most in-band noise, nV rms: measured 2.39.
const MOST_NOISE_NV: f64 = 2.6;
/// Least instructions of idsp's dither for one of ours, in the same run: measured 2.38.
const LEAST_RATIO: f64 = 2.0;

/// Places in [`NAMES`].
const OURS: usize = 0;
const IDSP_DITHER: usize = 5;

/// Everything that was measured; the object of `--json`.
#[derive(Debug, Serialize)]
pub(crate) struct Report {
    /// Ours in 4-sample blocks, the worst block on either machine.
    insn_per_sample_channel: f64,
    /// Ours, 0.5-60 Hz, with offset, mains and EEG.
    noise_nv_rms: f64,
    /// Instructions of idsp's dither (its best block) over ours (the worst).
    ratio_idsp_dither: f64,
    /// Whether everything of ours takes as many instructions for every input.
    constant_count: bool,
    /// Whether every output of the machines has the bits of the portable filters, and single
    /// samples give the bits of blocks.
    bits_equal: bool,
    machines: Vec<MachineFigures>,
    noise_nv: NoiseFigures,
    inputs: Vec<&'static str>,
    skipped: Vec<String>,
    published_elsewhere: [Published; PUBLISHED.len()],
    faults: Vec<String>,
}

#[derive(Debug, Serialize)]
struct MachineFigures {
    machine: &'static str,
    core: &'static str,
    contenders: Vec<ContenderFigures>,
}

#[derive(Debug, Serialize)]
struct ContenderFigures {
    name: &'static str,
    /// Instructions per sample and electrode.
    fewest: f64,
    most: f64,
    constant: bool,
    different_blocks: usize,
}

#[derive(Debug, Serialize)]
struct NoiseFigures {
    ours: InBand,
    idsp_dither: InBand,
    idsp_wide: InBand,
}

impl Report {
    /// Puts the figures together and judges them.
    pub(crate) fn new(inputs: &Inputs, counts: &[Counts], noise: &Noise) -> Self {
        let extreme = |contender, place: usize, pick: fn(f64, f64) -> f64| {
            let figures = counts
                .iter()
                .map(|counts| counts.per_sample(contender)[place]);
            figures.reduce(pick).unwrap_or(f64::NAN)
        };
        let most = extreme(OURS, 1, f64::max);
        let constant = |contender| counts.iter().all(|counts| counts.is_constant(contender));
        let mut ours = (0..NAMES.len()).filter(|contender| NAMES[*contender].starts_with("ours"));
        let mut report = Self {
            insn_per_sample_channel: most,
            noise_nv_rms: noise.ours.in_band.eeg,
            ratio_idsp_dither: extreme(IDSP_DITHER, 0, f64::min) / most,
            constant_count: ours.all(constant),
            bits_equal: counts.iter().all(Counts::bits_are_equal),
            machines: counts.iter().map(MachineFigures::of).collect(),
            noise_nv: NoiseFigures {
                ours: noise.ours.in_band,
                idsp_dither: noise.idsp_dither.in_band,
                idsp_wide: noise.idsp_wide.in_band,
            },
            inputs: inputs.names.clone(),
            skipped: inputs.skipped.clone(),
            published_elsewhere: PUBLISHED,
            faults: Vec::new(),
        };
        report.faults = report.find_faults();
        report
    }

    /// One object.
    pub(crate) fn json(&self) -> String {
        serde_json::to_string(self).unwrap_or_else(|error| format!("{{\"error\":\"{error}\"}}"))
    }

    /// Whether all limits are kept.
    ///
    /// # Errors
    /// Names those that are not.
    pub(crate) fn judge(&self) -> Result<(), Failure> {
        if self.faults.is_empty() {
            return Ok(());
        }
        Err(Failure::Check {
            what: "the benchmark".to_owned(),
            why: self.faults.join("; "),
            next: "compare with `git log` of fixed-dsp, model and the toolchain".to_owned(),
        })
    }

    /// Which contenders have a fault, on which machine: `: NAME on MACHINE, ..`.
    fn blamed(&self, faulty: fn(&ContenderFigures) -> bool) -> String {
        let blamed = self.machines.iter().flat_map(|machine| {
            let contenders = machine.contenders.iter().filter(|figures| faulty(figures));
            contenders.map(|figures| format!("{} on {}", figures.name, machine.machine))
        });
        let blamed: Vec<String> = blamed.collect();
        format!(": {}", blamed.join(", "))
    }

    /// A figure that is no number keeps no limit.
    fn find_faults(&self) -> Vec<String> {
        let instructions = self.insn_per_sample_channel;
        let (noise, ratio) = (self.noise_nv_rms, self.ratio_idsp_dither);
        let checks = [
            (
                instructions <= MOST_INSTRUCTIONS,
                format!("{instructions:.1} instructions, {MOST_INSTRUCTIONS} allowed"),
            ),
            (
                noise <= MOST_NOISE_NV,
                format!("{noise:.2} nV of noise, {MOST_NOISE_NV} allowed"),
            ),
            (
                ratio >= LEAST_RATIO,
                format!("idsp's dither takes {ratio:.2} times ours, {LEAST_RATIO:.1} needed"),
            ),
            (
                self.constant_count,
                format!(
                    "the number of instructions depends on the input{}",
                    self.blamed(|figures| figures.name.starts_with("ours") && !figures.constant)
                ),
            ),
            (
                self.bits_equal,
                format!(
                    "the machine's outputs are not those of the portable filters{}",
                    self.blamed(|figures| figures.different_blocks > 0)
                ),
            ),
        ];
        let broken = checks.into_iter().filter(|(kept, _)| !kept);
        broken.map(|(_, words)| words).collect()
    }
}

impl MachineFigures {
    fn of(counts: &Counts) -> Self {
        let contenders = NAMES.iter().enumerate().map(|(contender, name)| {
            let [fewest, most] = counts.per_sample(contender);
            ContenderFigures {
                name,
                fewest,
                most,
                constant: counts.is_constant(contender),
                different_blocks: counts.different[contender],
            }
        });
        Self {
            machine: counts.machine.name,
            core: counts.machine.core,
            contenders: contenders.collect(),
        }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            formatter,
            "Instructions per sample and electrode, {ELECTRODES} electrodes, {SECTIONS} sections (a \
             range: fewest and most of a block; *: depends on the input)"
        )?;
        write!(formatter, "{:<40}", "")?;
        for machine in &self.machines {
            write!(formatter, "{:>16}", machine.core)?;
        }
        writeln!(formatter)?;
        for (contender, name) in NAMES.iter().enumerate() {
            write!(formatter, "  {name:<38}")?;
            for machine in &self.machines {
                write!(
                    formatter,
                    "{:>16}",
                    machine.contenders[contender].to_string()
                )?;
            }
            writeln!(formatter)?;
        }
        let heading = "Published, on other code and settings";
        writeln!(
            formatter,
            "{heading:<40}{:>16}{:>16}",
            "instructions", "in-band noise"
        )?;
        for other in &self.published_elsewhere {
            let [low, high] = other.insn_per_sample_channel;
            let range = if low == high {
                low.to_string()
            } else {
                format!("{low}-{high}")
            };
            writeln!(
                formatter,
                "  {:<38}{range:>16}{:>16}",
                other.name, other.noise
            )?;
        }
        writeln!(
            formatter,
            "Noise in 0.5-60 Hz against a float64 twin, nV rms"
        )?;
        let kinds = ["offset, mains, EEG", "mains", "silence"];
        writeln!(
            formatter,
            "{:<22}{:>18}{:>18}{:>18}",
            "", kinds[0], kinds[1], kinds[2]
        )?;
        let NoiseFigures {
            ours,
            idsp_dither,
            idsp_wide,
        } = &self.noise_nv;
        for (name, noise) in [
            ("ours", ours),
            ("idsp-dither", idsp_dither),
            ("idsp-wide", idsp_wide),
        ] {
            let [eeg, mains, silence] = [noise.eeg, noise.mains, noise.silence];
            writeln!(
                formatter,
                "  {name:<20}{eeg:>18.2}{mains:>18.2}{silence:>18.2}"
            )?;
        }
        writeln!(
            formatter,
            "idsp's dither takes {:.2} times the instructions of ours; count {} over {}; outputs {}",
            self.ratio_idsp_dither,
            if self.constant_count {
                "constant"
            } else {
                "NOT constant"
            },
            self.inputs.join(", "),
            if self.bits_equal {
                "bit for bit those of the PC"
            } else {
                "NOT those of the PC"
            },
        )
    }
}

impl fmt::Display for ContenderFigures {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let varies = if self.constant { "" } else { "*" };
        let (fewest, most) = (self.fewest, self.most);
        if (most - fewest) < 0.05 {
            write!(formatter, "{most:.1}{varies}")
        } else {
            write!(formatter, "{fewest:.1}-{most:.1}{varies}")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Break = fn(&mut Report);

    fn report() -> Report {
        let quiet = InBand {
            eeg: 2.4,
            mains: 2.4,
            silence: 0.0,
        };
        Report {
            insn_per_sample_channel: 55.0,
            noise_nv_rms: 2.4,
            ratio_idsp_dither: 2.2,
            constant_count: true,
            bits_equal: true,
            machines: vec![MachineFigures {
                machine: "mps2-an386",
                core: "Cortex-M4F",
                contenders: vec![ContenderFigures {
                    name: "ours-blocks",
                    fewest: 55.0,
                    most: 55.0,
                    constant: false,
                    different_blocks: 1,
                }],
            }],
            noise_nv: NoiseFigures {
                ours: quiet,
                idsp_dither: quiet,
                idsp_wide: quiet,
            },
            inputs: vec!["silence"],
            skipped: Vec::new(),
            published_elsewhere: PUBLISHED,
            faults: Vec::new(),
        }
    }

    #[test]
    fn the_ratio_is_that_of_the_two_contenders_that_it_names() {
        assert_eq!(
            [NAMES[OURS], NAMES[IDSP_DITHER]],
            ["ours-blocks", "idsp-dither"]
        );
    }

    #[test]
    fn every_limit_is_judged_and_named() {
        assert!(report().find_faults().is_empty());
        let broken: [(Break, &str); 6] = [
            (
                |report| report.insn_per_sample_channel = 58.1,
                "58.1 instructions",
            ),
            (|report| report.noise_nv_rms = 2.61, "2.61 nV"),
            (|report| report.noise_nv_rms = f64::NAN, "NaN nV"),
            (|report| report.ratio_idsp_dither = 1.99, "1.99 times"),
            (
                |report| report.constant_count = false,
                "depends on the input: ours-blocks on mps2-an386",
            ),
            (
                |report| report.bits_equal = false,
                "filters: ours-blocks on mps2-an386",
            ),
        ];
        for (break_it, words) in broken {
            let mut report = report();
            break_it(&mut report);
            report.faults = report.find_faults();
            let failure = report.judge().expect_err("a limit is broken");
            assert!(failure.to_string().contains(words), "{failure}");
            assert_eq!(report.faults.len(), 1);
        }
    }

    #[test]
    fn the_json_is_one_object_with_the_figures() {
        let json: serde_json::Value = serde_json::from_str(&report().json()).expect("JSON");
        assert_eq!(json["insn_per_sample_channel"], 55.0);
        assert_eq!(json["noise_nv_rms"], 2.4);
        assert_eq!(json["ratio_idsp_dither"], 2.2);
        assert_eq!(json["constant_count"], true);
        assert!(!report().json().contains('\n'));
    }
}
