//! What should have come back: the same EEG through the same filters, without a link.

use host_sim::synthetic::{Generator, SyntheticError, SyntheticSpec};
use pipeline::{Electrodes, FrontEnd, Mains, Sample};

use super::run::Run;

/// Filtered electrodes of the whole run, one entry per step at 128 Hz.
#[derive(Debug, Clone)]
pub(crate) struct Reference {
    /// uV; the index inside is the electrode.
    steps_uv: Vec<[f32; pipeline::ELECTRODES]>,
}

/// Reference and reconstruction over the same steps.
#[derive(Debug, Clone)]
pub(crate) struct Comparison {
    /// Index of the first step.
    pub(crate) first_step: usize,
    /// What went in, uV.
    pub(crate) source_uv: Vec<[f32; pipeline::ELECTRODES]>,
    /// What came back, uV.
    pub(crate) result_uv: Vec<[f32; pipeline::ELECTRODES]>,
    /// `100 sqrt(sum (x - y)^2 / sum x^2)` over all electrodes and steps, percent.
    pub(crate) prd_percent: f64,
}

impl Reference {
    /// Makes the EEG that host-sim makes from this seed, and filters it.
    ///
    /// # Errors
    /// The generator refuses the model's electrodes.
    pub(crate) fn new(seed: u64, seconds: u32) -> Result<Self, SyntheticError> {
        let mut generator = Generator::new(&SyntheticSpec::new(seed, model::LABELS.split(' ')))?;
        let mut front_end = FrontEnd::new(Mains::Hz50, &model::RESAMPLER);
        let samples = u64::from(seconds) * u64::from(model::ADC_RATE_HZ);
        let steps_uv = (0..samples)
            .filter_map(|_| {
                front_end.filter_sample(&Sample {
                    counts: generator.next_sample(),
                })
            })
            .map(|(electrodes, _)| microvolts(&electrodes))
            .collect();
        Ok(Self { steps_uv })
    }

    /// Puts the reconstruction beside it: frame `w` of `/neurodata_reconstructed` holds the steps
    /// from `w * hop` on. Taken is the longest stretch at the end without settling or fillers.
    pub(crate) fn compare(&self, run: &Run) -> Comparison {
        let mut comparison = Comparison {
            first_step: 0,
            source_uv: Vec::new(),
            result_uv: Vec::new(),
            prd_percent: f64::NAN,
        };
        for heard in &run.reconstructed {
            let first = usize::try_from(heard.window())
                .unwrap_or(usize::MAX)
                .saturating_mul(model::HOP);
            let frame = heard.frame.eeg.data.as_chunks().0;
            let source = self.steps_uv.get(first..first.saturating_add(frame.len()));
            let follows = first == comparison.first_step + comparison.source_uv.len();
            if heard.is_settling() || heard.is_filler() || !follows {
                comparison.source_uv.clear();
                comparison.result_uv.clear();
                comparison.first_step = first;
            }
            if let Some(source) = source
                && !heard.is_settling()
                && !heard.is_filler()
            {
                comparison.source_uv.extend(source);
                comparison.result_uv.extend(frame);
            }
        }
        comparison.prd_percent = prd_percent(&comparison.source_uv, &comparison.result_uv);
        comparison
    }
}

fn microvolts(electrodes: &Electrodes) -> [f32; pipeline::ELECTRODES] {
    // Q27.5 of counts of LSB_NV nanovolts each.
    let steps_per_count = f32::from(1_u16 << model::GUARD_BITS);
    #[expect(
        clippy::cast_precision_loss,
        reason = "a picture needs no more than 24 bits"
    )]
    electrodes.map(|value| value as f32 / steps_per_count * model::LSB_NV / 1000.0)
}

fn prd_percent<const N: usize>(source: &[[f32; N]], result: &[[f32; N]]) -> f64 {
    let pairs = || source.as_flattened().iter().zip(result.as_flattened());
    let error: f64 = pairs().map(|(x, y)| f64::from(x - y).powi(2)).sum();
    let power: f64 = pairs().map(|(x, _)| f64::from(*x).powi(2)).sum();
    100.0 * (error / power).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_prd_of_a_tenth_too_little_is_10_percent() {
        let source = [[1.0_f32, -2.0], [3.0, 4.0]];
        let result = source.map(|step| step.map(|x| 0.9 * x));
        assert!((prd_percent(&source, &result) - 10.0).abs() < 1e-4);
        assert!(prd_percent(&source, &source) < 1e-9);
    }
}
