//! Collects the parts of a device's filtered signal that can be used for a fit.

use link::Flags;
use neuro_ros::{NeuroFrame, TRI_LABELS};
use packed_fit::Track;
use packed_fit::innovation::SECOND;

/// Flags of steps that are missing or do not show the electrodes' signals, with text for the user.
const UNUSABLE: [(Flags, &str); 4] = [
    (Flags::FILLER, "missing"),
    (Flags::SETTLING, "while filters settle"),
    (Flags::OVERRUN, "after an overrun"),
    (Flags::ADC_STATUS_BAD, "with a wrong status of a converter"),
];

/// [`SECOND`], the number of steps in a second, as a float.
#[expect(clippy::cast_precision_loss, reason = "128 is exact")]
const SECOND_STEPS: f64 = SECOND as f64;

/// Collects filtered steps in stretches without a gap.
#[derive(Clone, Debug, Default)]
pub(crate) struct Listening {
    pub(crate) stretches: Vec<Track>,
    /// Whether the next step continues the last stretch.
    continues: bool,
    /// Number of steps received, usable or not.
    pub(crate) steps: u64,
    /// Number of steps that cannot be used, for each flag of [`UNUSABLE`]; a step counts for the
    /// first of its flags.
    unusable: [u64; UNUSABLE.len()],
}

impl Listening {
    /// Adds the usable steps of a frame. A step that cannot be used ends the present stretch.
    pub(crate) fn receive(&mut self, frame: &NeuroFrame) {
        let electrodes = usize::from(frame.eeg.info.nchannels);
        let steps = frame.eeg.data.chunks_exact(electrodes.max(1));
        for (step, words) in steps.zip(frame.tri.data.chunks_exact(TRI_LABELS.len())) {
            self.steps += 1;
            let flags = Flags::from_bits(u16::try_from(words[0]).unwrap_or(u16::MAX));
            let reason = UNUSABLE.iter().position(|(flag, _)| flags.contains(*flag));
            if let Some(reason) = reason {
                self.unusable[reason] += 1;
                self.continues = false;
                continue;
            }
            if !std::mem::replace(&mut self.continues, true) {
                self.stretches.push(Track::new("device", electrodes, Vec::new()));
            }
            if let Some(stretch) = self.stretches.last_mut() {
                stretch.values.extend_from_slice(step);
            }
        }
    }

    /// Returns the number of whole seconds in all stretches.
    pub(crate) fn seconds(&self) -> usize {
        let seconds = self.stretches.iter().map(|stretch| stretch.steps() / SECOND);
        seconds.sum()
    }

    /// Returns the text `; not usable: ` followed by the number of seconds for each reason; empty
    /// if all steps are usable.
    pub(crate) fn unusable_words(&self) -> String {
        let reasons = UNUSABLE.iter().zip(self.unusable);
        let reasons = reasons.filter(|(_, steps)| *steps > 0);
        #[expect(clippy::cast_precision_loss, reason = "some hours of steps")]
        let seconds = |steps: u64| steps as f64 / SECOND_STEPS;
        let words = reasons.map(|((_, words), steps)| format!("{:.1} s {words}", seconds(steps)));
        let words: Vec<String> = words.collect();
        if words.is_empty() {
            return String::new();
        }
        format!("; not usable: {}", words.join(", "))
    }

    /// Returns the RMS of each electrode over the newest second, uV; empty before the first step.
    pub(crate) fn newest_rms_uv(&self) -> Vec<f64> {
        let Some(stretch) = self.stretches.last() else {
            return Vec::new();
        };
        let values = SECOND * stretch.electrodes;
        let newest = &stretch.values[stretch.values.len().saturating_sub(values)..];
        let rms = |electrode| {
            let values = newest.iter().skip(electrode).step_by(stretch.electrodes);
            let squares = values.map(|uv| f64::from(*uv).powi(2));
            let mean = squares.sum::<f64>() / SECOND_STEPS;
            mean.sqrt()
        };
        (0..stretch.electrodes).map(rms).collect()
    }
}
