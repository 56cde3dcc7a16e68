//! Codes per second, as a table and as JSON.

use std::fmt::{self, Display, Formatter};

use serde::Serialize;

use super::agreement::Agreement;
use crate::failure::Failure;

/// Codes per second of one round.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Speeds {
    /// Steps through one encoder.
    pub(crate) streaming: f64,
    /// Each window through an encoder of its own.
    pub(crate) windows: f64,
    /// ADC samples through acquisition and encoder.
    pub(crate) pipeline: f64,
    /// PyTorch, a window per call and all in one.
    pub(crate) torch: Option<[f64; 2]>,
}

/// Medians over the rounds; a ratio is the median of the rounds' own ratios, because what else the PC
/// does slows a round's contenders alike. Nothing here is judged: the time is the PC's.
#[derive(Debug, Serialize)]
pub(crate) struct Report {
    /// Streaming.
    codes_per_second: f64,
    /// Streaming over PyTorch, both a code at a time, as a stream needs them.
    ratio_torch: Option<f64>,
    codes_per_second_windows: f64,
    codes_per_second_pipeline: f64,
    torch_codes_per_second: Option<f64>,
    torch_codes_per_second_batch: Option<f64>,
    /// Streaming over PyTorch's batch.
    ratio_torch_batch: Option<f64>,
    /// Window by window over PyTorch's batch: neither makes use of the overlap.
    ratio_torch_windows_batch: Option<f64>,
    arch: String,
    torch: Option<String>,
    threads: u32,
    rounds: usize,
    #[serde(flatten)]
    agreement: Agreement,
    faults: Vec<String>,
}

impl Report {
    /// Of at least one round.
    pub(crate) fn new(
        arch: String,
        torch: Option<String>,
        rounds: &[Speeds],
        agreement: Agreement,
    ) -> Self {
        let over = |figure: fn(&Speeds) -> f64| median(rounds.iter().map(figure).collect());
        let over_torch = |figure: fn(&Speeds, [f64; 2]) -> f64| {
            let figures = rounds.iter().map(|round| Some(figure(round, round.torch?)));
            figures.collect::<Option<Vec<f64>>>().map(median)
        };
        Self {
            codes_per_second: over(|round| round.streaming),
            ratio_torch: over_torch(|round, [single, _]| round.streaming / single),
            codes_per_second_windows: over(|round| round.windows),
            codes_per_second_pipeline: over(|round| round.pipeline),
            torch_codes_per_second: over_torch(|_, [single, _]| single),
            torch_codes_per_second_batch: over_torch(|_, [_, batch]| batch),
            ratio_torch_batch: over_torch(|round, [_, batch]| round.streaming / batch),
            ratio_torch_windows_batch: over_torch(|round, [_, batch]| round.windows / batch),
            arch,
            torch,
            threads: 1,
            rounds: rounds.len(),
            faults: agreement.faults(),
            agreement,
        }
    }

    /// One object.
    pub(crate) fn json(&self) -> String {
        serde_json::to_string(self).unwrap_or_else(|error| format!("{{\"error\":\"{error}\"}}"))
    }

    /// Whether the contenders compute the same codes.
    ///
    /// # Errors
    /// They do not.
    pub(crate) fn judge(&self) -> Result<(), Failure> {
        if self.faults.is_empty() {
            return Ok(());
        }
        Err(Failure::Check {
            what: "the benchmark on this PC".to_owned(),
            why: self.faults.join("; "),
            next: "compare bench/torch_encoder.py with the mode and the network in \
                   model/artifact/model.toml"
                .to_owned(),
        })
    }
}

impl Display for Report {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let rounds = self.rounds;
        writeln!(
            f,
            "Codes per second, one thread, {} (medians of {rounds} rounds)",
            self.arch
        )?;
        row(f, "streaming, step by step", self.codes_per_second)?;
        row(
            f,
            "the whole pipeline, from ADC samples",
            self.codes_per_second_pipeline,
        )?;
        row(
            f,
            "window by window, without the overlap",
            self.codes_per_second_windows,
        )?;
        let (Some(version), Some(single), Some(batch)) = (
            &self.torch,
            self.torch_codes_per_second,
            self.torch_codes_per_second_batch,
        ) else {
            return writeln!(f, "PyTorch is not here to be compared with");
        };
        row(f, "PyTorch f32, a window per call", single)?;
        row(f, "PyTorch f32, 256 windows in one call", batch)?;
        writeln!(
            f,
            "Ratios to PyTorch {version} on one thread (medians of the rounds' own)"
        )?;
        for (name, ratio) in [
            ("streaming over a window per call", self.ratio_torch),
            ("streaming over the batch", self.ratio_torch_batch),
            (
                "window by window over the batch",
                self.ratio_torch_windows_batch,
            ),
        ] {
            writeln!(f, "  {name:<42}{:>10.2}", ratio.unwrap_or(f64::NAN))?;
        }
        writeln!(
            f,
            "Same codes: PyTorch's within {:.1e} of the reference in floats, int8's within {:.2} steps rms",
            self.agreement.torch_relative.unwrap_or(f64::NAN),
            self.agreement.int8_rms_steps,
        )
    }
}

fn row(f: &mut Formatter<'_>, name: &str, codes: f64) -> fmt::Result {
    writeln!(f, "  {name:<42}{codes:>10.0}")
}

/// 0 of nothing.
fn median(mut figures: Vec<f64>) -> f64 {
    figures.sort_by(f64::total_cmp);
    figures.get(figures.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(with_torch: bool) -> Report {
        // The last round ran on a busy PC.
        let rounds = [1.0, 1.1, 0.1].map(|speed| Speeds {
            streaming: 8_000.0 * speed,
            windows: 4_000.0 * speed,
            pipeline: 7_000.0 * speed,
            torch: with_torch.then_some([1_000.0 * speed, 5_000.0 * speed]),
        });
        let agreement = Agreement {
            int8_rms_steps: 0.5,
            torch_relative: with_torch.then_some(1e-7),
        };
        let torch = with_torch.then(|| "2.0".to_owned());
        Report::new("x86_64".to_owned(), torch, &rounds, agreement)
    }

    #[test]
    fn a_ratio_is_that_of_a_round_and_a_slow_round_does_not_count() {
        let json: serde_json::Value = serde_json::from_str(&report(true).json()).expect("JSON");
        assert_eq!(json["codes_per_second"], 8_000.0);
        assert_eq!(json["ratio_torch"], 8.0);
        assert_eq!(json["ratio_torch_batch"], 1.6);
        assert_eq!(json["ratio_torch_windows_batch"], 0.8);
        assert!(report(true).judge().is_ok());
    }

    #[test]
    fn without_torch_its_figures_are_null_and_the_table_says_so() {
        let json: serde_json::Value = serde_json::from_str(&report(false).json()).expect("JSON");
        assert!(json["codes_per_second"].is_f64());
        assert!(json["ratio_torch"].is_null());
        assert!(report(false).to_string().contains("PyTorch is not here"));
    }

    #[test]
    fn other_codes_are_a_fault_whatever_the_speed() {
        let mut report = report(true);
        report.agreement.torch_relative = Some(0.1);
        report.faults = report.agreement.faults();
        assert!(report.judge().is_err());
    }
}
