//! Decides at the end of a window which electrodes are bad, and which are good again.

use core::mem;

use model::{ELECTRODES, STEP_RATE_HZ};

use super::evidence::{Evidence, Sums};
use super::{ElectrodeMask, MAX_EXCLUDED, Table, WINDOW};

/// Energy of the innovation (measurement minus prediction) that excludes an electrode, as a
/// multiple of the electrode's typical innovation energy. This energy limit is at most
/// [`MOST_USUAL`]. The energy of the prediction is added to it, because a larger signal is
/// predicted with a larger error.
const EXCLUDING: u64 = 50;
/// Largest value of the energy limit that [`EXCLUDING`] yields: 70 uV RMS. Without it, an electrode
/// whose innovation was large in training, for example over a temporal muscle, would be excluded
/// late or never for noise of 100 uV RMS.
const MOST_USUAL: u64 = 280 * 280 * WINDOW as u64;
/// Value of `Sums::excess` for an innovation at the excluding limit: 2^8.
const EXCESS_ONE: u32 = 1 << EXCESS_BITS;
const EXCESS_BITS: u32 = 8;
/// Excess that excludes an electrode after a single window. A smaller excess, above [`EXCESS_ONE`],
/// must last two windows in a row, because movement or muscle activity of half a second is over by
/// the time its window is judged.
const SUDDEN: u32 = 2 * EXCESS_ONE;
/// Value of `Sums::excess` below which an electrode counts as good again.
const GOOD_BELOW: u32 = EXCESS_ONE / 4;
/// Largest number of electrodes that one window excludes for their innovation alone.
const MOST_AT_ONCE: usize = 8;
/// An electrode is quiet if its energy, times this factor, is below the energy of its prediction.
const QUIET_PART: u64 = 16;

/// Number of windows in a row for which an excluded electrode must be good to be readmitted: 10 s.
pub(super) const HOLD: u8 = windows(10);
/// Number of windows in a row for which an electrode must be quiet to be excluded: 3 s.
const QUIET: u8 = windows(3);

#[expect(clippy::cast_possible_truncation, reason = "a window takes 0.5 s or more")]
const fn windows(seconds: usize) -> u8 {
    (seconds * STEP_RATE_HZ as usize / WINDOW) as u8
}

/// Results of earlier windows for each electrode.
#[derive(Clone, Debug)]
pub(super) struct Judge {
    /// Number of windows in a row in which the electrode was good.
    good: [u8; ELECTRODES],
    /// Number of windows in a row in which the electrode was quiet.
    quiet: [u8; ELECTRODES],
    /// Whether the electrode's innovation exceeded the excluding limit in the last window.
    loud: [bool; ELECTRODES],
}

/// Result of a judgement.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Verdict {
    /// Electrodes to exclude.
    pub(super) bad: ElectrodeMask,
    /// Excluded electrodes that have been good for long enough.
    pub(super) recovered: ElectrodeMask,
}

impl Judge {
    pub(super) const NEW: Self =
        Self { good: [0; ELECTRODES], quiet: [0; ELECTRODES], loud: [false; ELECTRODES] };

    /// Judges a window in which the electrodes `excluded` were excluded. Electrodes in `never` are
    /// not found bad.
    #[inline(never)]
    pub(super) fn judge(
        &mut self,
        evidence: &Evidence,
        excluded: ElectrodeMask,
        never: ElectrodeMask,
        table: &Table<'_>,
    ) -> Verdict {
        let (mut sure, mut out) = (evidence.flat() | evidence.railed, excluded);
        let (mut certain, mut recovered) = ([false; ELECTRODES], [false; ELECTRODES]);
        let mut excluding = [0; ELECTRODES];
        for (electrode, sums) in evidence.electrodes.iter().enumerate() {
            let typical = typical_energy(table, electrode);
            let excess = sums.excess(typical);
            let was_loud = mem::replace(&mut self.loud[electrode], excess > EXCESS_ONE);
            if was_loud || excess > SUDDEN {
                excluding[electrode] = excess;
            }
            let [measured, predicted] = [sums.measured, sums.predicted].map(u64::from);
            let is_quiet = measured * QUIET_PART < predicted && predicted > typical.into();
            self.quiet[electrode] = counted(self.quiet[electrode], is_quiet);
            certain[electrode] = sure & 1 != 0 || sums.is_tonal() || self.quiet[electrode] >= QUIET;
            let is_good = !certain[electrode] && !is_quiet && excess < GOOD_BELOW;
            self.good[electrode] = counted(self.good[electrode], is_good);
            recovered[electrode] = out & 1 != 0 && self.good[electrode] >= HOLD;
            // Shift by one, because selecting one of 64 bits takes a microcontroller several
            // instructions.
            (sure, out) = (sure >> 1, out >> 1);
        }
        let [certain, recovered] = [certain, recovered].map(mask);
        let certain = certain & !excluded & !never;
        // Certainly bad electrodes spoil the prediction of others, so exclude them first; the next
        // window judges the others without them.
        let bad = if certain == 0 {
            let free = MAX_EXCLUDED.saturating_sub(excluded.count_ones() as usize);
            largest(excluding, excluded | never, MOST_AT_ONCE.min(free))
        } else {
            certain
        };
        Verdict { bad, recovered }
    }

    /// Forgets how long electrodes were good; call this when they are excluded.
    pub(super) fn forget(&mut self, mut excluded: ElectrodeMask) {
        while let Some(good) = self.good.get_mut(excluded.trailing_zeros() as usize) {
            *good = 0;
            excluded &= excluded - 1;
        }
    }
}

/// Returns up to `most` electrodes that are not in `others` and whose excess is above `EXCESS_ONE`
/// and more than half of the largest excess. A smaller excess can come from a bad electrode, which
/// spoils the predictions of others.
fn largest(mut excess: [u32; ELECTRODES], others: ElectrodeMask, most: usize) -> ElectrodeMask {
    let mut rest = others;
    for excess in &mut excess {
        if rest & 1 != 0 {
            *excess = 0;
        }
        rest >>= 1;
    }
    let mut bad = 0;
    let mut least = EXCESS_ONE;
    for _ in 0..most {
        let largest = excess.iter().copied().max().unwrap_or(0);
        let place = excess.iter().position(|&excess| excess == largest);
        let Some(electrode) = place.filter(|_| largest > least) else {
            break;
        };
        least = least.max(largest / 2);
        bad |= 1 << electrode;
        if let Some(excess) = excess.get_mut(electrode) {
            *excess = 0;
        }
    }
    bad
}

/// Returns the updated number of windows in a row in which a condition holds.
const fn counted(count: u8, holds: bool) -> u8 {
    if holds { count.saturating_add(1) } else { 0 }
}

/// Returns the mask of the electrodes whose element is `true`.
fn mask(electrodes: [bool; ELECTRODES]) -> ElectrodeMask {
    let bits = electrodes.into_iter().rev();
    bits.fold(0, |mask, bit| mask << 1 | ElectrodeMask::from(bit))
}

/// Returns the energy that the innovation of an electrode typically has in a window, in squares of
/// a quarter microvolt, saturated. The table states the mean square of the innovation, in squares
/// of a sixteenth of a microvolt.
fn typical_energy(table: &Table<'_>, electrode: usize) -> u32 {
    let square = table.innovation.get(electrode).copied().unwrap_or(i32::MAX);
    let energy = u64::from(square.cast_unsigned()) * WINDOW as u64 / 16;
    u32::try_from(energy).unwrap_or(u32::MAX)
}

impl Sums {
    /// Returns the energy of the innovation as a fraction of the excluding limit, times
    /// [`EXCESS_ONE`]. The limit is divided by [`EXCESS_ONE`] and rounded down first, so that one
    /// 32-bit division suffices; with a trained table, this divisor is some ten thousands.
    fn excess(&self, typical: u32) -> u32 {
        let usual = (EXCLUDING * u64::from(typical)).min(MOST_USUAL);
        let limit = (usual + u64::from(self.predicted)) >> EXCESS_BITS;
        self.innovation / u32::try_from(limit).unwrap_or(u32::MAX).max(1)
    }
}
