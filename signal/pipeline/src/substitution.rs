//! Substitution of bad electrodes: finds them, and fills them from the others before the encoder.
//!
//! One electrode at the rail, with noise or without contact spoils the code of all others, because
//! every value of a code depends on every electrode. The model can have a table of weights from
//! which each electrode is predicted by the others. The table serves twice: an electrode whose
//! signal differs too much from its prediction is excluded, and an excluded electrode is replaced
//! by its prediction from the rest.
//!
//! ```text
//! Step --> quarters of 1 uV --> Fill: excluded electrodes from the others --> Step for the encoders
//!                                 |
//!                                 +--> Evidence over 64 steps --> Judge: exclude, readmit
//! ```

mod evidence;
mod fill;
mod judge;

use model::{ELECTRODES, HOP, STEP_RATE_HZ, Substitution as Table};

use crate::front_end::Mains;
use crate::quarters;
use crate::sample::{Sample, Step};
use evidence::Evidence;
use fill::Fill;
use judge::Judge;

/// Largest number of electrodes that are excluded at the same time.
const MAX_EXCLUDED: usize = 12;

/// Number of steps from one judgement of the electrodes to the next: at most 0.5 s, and whole hops,
/// so that the excluded electrodes change between two hops.
const WINDOW: usize = STEP_RATE_HZ as usize / 2 / HOP * HOP;

const _: () = assert!(ELECTRODES <= 64, "a mask of electrodes has 64 bits");

/// Electrodes as a mask; bit n is electrode n of the montage.
type ElectrodeMask = u64;

/// The host's decisions about the exclusion of electrodes. `link` defines this type again, for the
/// wire, because this crate does not depend on `link`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ExclusionPolicy {
    /// Electrodes that are always excluded.
    pub always: ElectrodeMask,
    /// Electrodes that are never excluded; `always` takes precedence.
    pub never: ElectrodeMask,
    /// Whether the device itself finds bad electrodes.
    pub automatic: bool,
}

impl ExclusionPolicy {
    /// The device finds bad electrodes, and the host excludes and protects no electrode.
    pub const AUTOMATIC: Self = Self { always: 0, never: 0, automatic: true };
}

/// Finds bad electrodes and fills them from the others, step by step.
///
/// Excluded electrodes change only between two windows of half a second, but an electrode at the
/// ADC's rail is excluded with that very step. While no electrode is excluded, steps pass
/// unchanged.
///
/// # Timing
/// Whatever the signal, every step takes one product of the table with all electrodes, eight sweeps
/// over all twelve slots for excluded electrodes, and the sums of the evidence. Each excluded
/// electrode is quantised again. A step that excludes an electrode also gathers its weights, and
/// the last step of a window takes one judgement more. The instructions are counted by
/// `cargo xtask bench substitution`.
#[derive(Clone, Debug)]
pub struct Substitution {
    fill: Fill,
    evidence: Evidence,
    judge: Judge,
    /// Number of steps of the window so far.
    steps: u16,
    /// True if the filters had not settled at some step of the window.
    settling: bool,
}

impl Substitution {
    /// State before the first step of a run at 50 Hz, with nothing excluded; all zeros.
    pub const NEW: Self = Self {
        fill: Fill::NONE,
        evidence: Evidence::NONE,
        judge: Judge::NEW,
        steps: 0,
        settling: false,
    };

    /// Starts a run in place, with nothing excluded.
    pub fn restart(&mut self, mains: Mains) {
        *self = Self::NEW;
        self.evidence.restart(mains);
    }

    /// Adds a sample, from which flat electrodes are found. Call this once for each sample, before
    /// [`Self::fill_step`] with the step that the sample completes.
    #[inline]
    pub fn observe_sample(&mut self, sample: &Sample) {
        self.evidence.add_sample(sample);
    }

    /// Replaces the excluded electrodes of a step by their prediction, and quantises them again. A
    /// new policy takes effect with the next window.
    pub fn fill_step(&mut self, step: &mut Step, policy: ExclusionPolicy, table: &Table<'_>) {
        if self.steps == 0 {
            self.fill.readmit(policy.never & !policy.always);
            self.fill.exclude_first(policy.always, table);
        }
        let railed = step.saturated & ALL;
        if policy.automatic {
            self.exclude(railed & !policy.never, table);
        }
        let measured = quarters::quarters(&step.electrodes);
        let predicted = self.fill.predict(&measured, table);
        self.evidence.add_step(&measured, &predicted, railed);
        step.excluded = self.fill.excluded();
        step.saturated &= !step.excluded;
        for electrode in self.fill.indices() {
            if let Some(&value) = predicted.get(electrode) {
                step.replace(electrode, quarters::filtered(value));
            }
        }
        self.settling |= step.settling;
        self.steps += 1;
        if usize::from(self.steps) == WINDOW {
            self.end_window(policy, table);
        }
    }

    /// Judges the electrodes at the end of a window, and begins the next window. Skips the
    /// judgement while the filters settle, because their transient looks like a fault of every
    /// electrode.
    fn end_window(&mut self, policy: ExclusionPolicy, table: &Table<'_>) {
        if policy.automatic && !self.settling {
            let excluded = self.fill.excluded();
            let verdict = self.judge.judge(&self.evidence, excluded, policy.never, table);
            self.fill.readmit(verdict.recovered & !policy.always);
            self.exclude(verdict.bad, table);
        }
        if !policy.automatic {
            self.fill.readmit(!policy.always);
        }
        self.evidence.restart(self.evidence.mains());
        self.steps = 0;
        self.settling = false;
    }

    /// Excludes bad electrodes, up to a total of [`MAX_EXCLUDED`].
    fn exclude(&mut self, bad: ElectrodeMask, table: &Table<'_>) {
        let excluded = self.fill.excluded();
        if bad & !excluded != 0 && (excluded.count_ones() as usize) < MAX_EXCLUDED {
            self.judge.forget(bad);
            self.fill.exclude(bad, table);
        }
    }
}

/// All electrodes of the montage.
const ALL: ElectrodeMask = u64::MAX >> (64 - ELECTRODES);

#[cfg(test)]
mod tests;
