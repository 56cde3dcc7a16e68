//! Compares the reconstructed EEG with a reference: the same EEG after the same filters, neither
//! encoded nor sent.

use std::fmt;

use host_sim::synthetic::{Generator, SyntheticSpec};
use link::Flags;
use offline::{ElectrodeSums, microvolts};
use pipeline::{ELECTRODES, FrontEnd, Mains, Sample};

use crate::Failure;
use crate::run::Run;

/// Values of all electrodes at one step, uV; there are 128 steps per second.
type StepUv = [f32; ELECTRODES];

/// Reference and reconstruction over the same steps: the last uninterrupted series of steps with
/// settled filters and no lost code.
#[derive(Debug, Clone)]
pub(crate) struct Comparison {
    /// Index of the first compared step since the start of the stream.
    pub(crate) first_step: usize,
    /// Reference: EEG after the filters, uV.
    pub(crate) source_uv: Vec<StepUv>,
    /// Reconstruction: EEG decoded from the codes, uV.
    pub(crate) result_uv: Vec<StepUv>,
    /// Percentage root-mean-square difference (PRD) of reference x and reconstruction y, `100
    /// sqrt(sum (x - y)^2 / sum x^2)` over all electrodes and steps, percent.
    pub(crate) prd_percent: f64,
}

impl Comparison {
    /// Compares the reconstruction in `run` with the EEG that host-sim generates from `seed`.
    ///
    /// # Errors
    /// host-sim does not know the position of one of the model's electrodes.
    pub(crate) fn new(run: &Run, seconds: u32, seed: u64) -> Result<Self, Failure> {
        let reference = reference(seconds, seed)?;
        let mut first_step = 0;
        let (mut source_uv, mut result_uv) = (Vec::<StepUv>::new(), Vec::<StepUv>::new());
        // The message of window w on `/neurodata_reconstructed` starts at step w * HOP.
        for frame in &run.reconstructed {
            let first = frame.window().saturating_mul(model::HOP);
            let steps = frame.frame.eeg.data.as_chunks().0;
            let usable = !frame.has(Flags::SETTLING) && !frame.has(Flags::FILLER);
            if !usable || first != first_step + source_uv.len() {
                source_uv.clear();
                result_uv.clear();
                first_step = first;
            }
            let source = reference.get(first..first.saturating_add(steps.len()));
            if let (true, Some(source)) = (usable, source) {
                source_uv.extend(source);
                result_uv.extend(steps);
            }
        }
        let mut sums = ElectrodeSums::default();
        for (source, result) in source_uv.iter().zip(&result_uv) {
            for (source, result) in source.iter().zip(result) {
                sums.add(*source, *result);
            }
        }
        Ok(Self { first_step, prd_percent: sums.prd_percent(), source_uv, result_uv })
    }
}

/// Prints the PRD, the number of electrodes and the compared time span, such as `PRD 13.1 % over 61
/// electrodes, 9.9 to 14.9 s`.
impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let steps = self.source_uv.len();
        if steps == 0 {
            return f.write_str("no PRD: no code came after the filters had settled");
        }
        let [start, end] = [self.first_step, self.first_step + steps].map(seconds);
        let prd = self.prd_percent;
        write!(f, "PRD {prd:.1} % over {ELECTRODES} electrodes, {start:.1} to {end:.1} s")
    }
}

/// Returns the duration of `steps` steps, seconds.
pub(crate) fn seconds(steps: usize) -> f64 {
    f64::from(u32::try_from(steps).unwrap_or(u32::MAX)) / f64::from(model::STEP_RATE_HZ)
}

/// Returns the reference: the EEG of all electrodes after the filters, one entry per step.
fn reference(seconds: u32, seed: u64) -> Result<Vec<StepUv>, Failure> {
    let spec = SyntheticSpec::new(seed, model::LABELS.split(' '));
    let mut generator = Generator::new(&spec).map_err(|error| {
        let next =
            "compare signal/model/artifact/model.toml with the electrodes that host-sim knows";
        Failure::check("synthesising the reference", error, next)
    })?;
    let mut front_end = FrontEnd::new(Mains::Hz50, &model::RESAMPLER);
    let samples = 0..u64::from(seconds) * u64::from(model::ADC_RATE_HZ);
    let steps = samples.filter_map(|_| {
        let counts = generator.next_sample();
        let (electrodes, _) = front_end.filter_sample(&Sample { counts })?;
        Some(microvolts(&electrodes))
    });
    Ok(steps.collect())
}
