//! Band powers of spatially filtered electrodes: the inputs of a classifier on the host.

use fixed_dsp::{BAND_SECTIONS, BandPass, BandPower};
use int8_nn::{Linear, Pair};
use model::{ELECTRODE_PAIRS, ELECTRODES, HOP, STEP_RATE_HZ};

use crate::quarters::write_quarters;
use crate::sample::Step;

/// Largest number of spatial filters, each of which yields one feature.
pub const MAX_FEATURES: usize = 8;

/// Largest permitted sum of the magnitudes of a spatial filter's weights. It keeps the weighted sum
/// of all electrodes below 2^23, as [`Linear::accumulate`] requires.
pub const LARGEST_ROW: u32 = 2_047;

/// Largest permitted magnitude of a coefficient, Q32: 4.0, twice the limit for a stable section.
const LARGEST_COEFFICIENT: u64 = 1 << 34;

/// Number of hops that are marked as settling after a start or a change of filters, because the
/// band-pass starts at rest: as many as take 1 s.
#[expect(clippy::cast_possible_truncation, reason = "at most as many as steps per second")]
const SETTLING_HOPS: u8 = (STEP_RATE_HZ as usize).div_ceil(HOP) as u8;

const _: () = assert!((STEP_RATE_HZ as usize).div_ceil(HOP) < 255);

/// Number of consecutive steps that are filtered together.
const BLOCK: usize = if HOP.is_multiple_of(4) { 4 } else { 1 };

/// Number of pairs of the packed weights.
const WEIGHT_PAIRS: usize = ELECTRODE_PAIRS * MAX_FEATURES / 2;

/// Spatial filters, and the band-pass that follows them: the configuration of a
/// [`FeatureExtractor`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FeatureFilters {
    id: u32,
    band: [BandPass; BAND_SECTIONS],
    /// Number of filters, at most [`MAX_FEATURES`].
    filters: u8,
    /// Weights of all filters, packed for [`Linear`]; 0 beyond the number of filters.
    weights: [Pair; WEIGHT_PAIRS],
}

impl FeatureFilters {
    /// No filters: the extractor returns no features.
    pub const NONE: Self = Self {
        id: 0,
        band: [BandPass::from_q32([0; 3]); BAND_SECTIONS],
        filters: 0,
        weights: [Pair::ZERO; WEIGHT_PAIRS],
    };

    /// Creates filters; `None` if an argument is out of range.
    ///
    /// * `id`: identifier that the features repeat, so that the host knows their filters.
    /// * `sections`: the band-pass at the step rate as two [`BandPass`] sections: gain, a1, a2 of
    ///   each, Q32, at most 4.0 in magnitude. The host must prove that no value of the filtered
    ///   signals exceeds 32 bits; otherwise values wrap.
    /// * `weights`: for each filter, the weight of each electrode of the montage, int8 as bytes. 1
    ///   to [`MAX_FEATURES`] filters; no weight is -128, and the magnitudes of a filter sum to
    ///   2,047 at most.
    pub fn new(id: u32, sections: [[i64; 3]; BAND_SECTIONS], weights: &[u8]) -> Option<Self> {
        let filters = weights.chunks_exact(ELECTRODES);
        let count = u8::try_from(filters.len()).ok()?;
        let is_row = |row: &[u8]| {
            let magnitudes = row.iter().map(|byte| byte.cast_signed().unsigned_abs());
            !row.contains(&i8::MIN.cast_unsigned())
                && magnitudes.map(u32::from).sum::<u32>() <= LARGEST_ROW
        };
        let is_valid = weights.len().is_multiple_of(ELECTRODES)
            && (1..=MAX_FEATURES).contains(&filters.len())
            && filters.clone().all(is_row)
            && (sections.as_flattened().iter())
                .all(|coefficient| coefficient.unsigned_abs() <= LARGEST_COEFFICIENT);
        if !is_valid {
            return None;
        }
        let mut inputs = [[0; MAX_FEATURES]; ELECTRODES];
        for (filter, row) in filters.enumerate() {
            for (outputs, weight) in inputs.iter_mut().zip(row) {
                if let Some(place) = outputs.get_mut(filter) {
                    *place = weight.cast_signed();
                }
            }
        }
        let mut packed = [Pair::ZERO; WEIGHT_PAIRS];
        Linear::pack_weights(ELECTRODE_PAIRS, MAX_FEATURES, inputs.as_flattened(), &mut packed);
        Some(Self { id, band: sections.map(BandPass::from_q32), filters: count, weights: packed })
    }

    /// Returns the matrix from the electrodes to the filtered signals.
    const fn matrix(&self) -> Linear<'_> {
        Linear { inputs: ELECTRODE_PAIRS, outputs: MAX_FEATURES, weights: &self.weights }
    }
}

/// The band powers of one hop, with their position in the run and their status.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Features {
    /// Identifier that the host chose for the filters; see [`FeatureFilters::new`].
    pub id: u32,
    /// Index of the hop since the start of the run; wraps. Hop `n` begins with step `n * HOP`.
    pub hop: u32,
    /// Time by which the hop's last step follows the ADC sample that completed the hop, in
    /// microseconds; see [`Step::offset_us`].
    pub offset_us: u16,
    /// ADC channels at the rail in any sample since the step before the hop; bit n is channel n.
    pub saturated: u64,
    /// True if the device's filters or the band-pass of the features had not settled at the hop's
    /// first step.
    pub settling: bool,
    filters: u8,
    levels: [u8; MAX_FEATURES],
}

impl Features {
    /// Returns the power of each filter's signal as a level, `8 log2(energy) - 80`, rounded and
    /// limited to 0..=255. The energy is the sum of the squares of the hop's filtered samples; a
    /// sample is the weighted sum of the electrodes in quarters of a microvolt.
    pub fn levels(&self) -> &[u8] {
        self.levels.get(..usize::from(self.filters)).unwrap_or_default()
    }
}

/// Computes [`Features`], one for each hop of steps.
///
/// A hop takes the same number of instructions, whatever the signals are. Every fourth step also
/// runs the band-pass, and the last step of a hop also computes the logarithms. The instructions
/// are counted by `cargo xtask bench substitution`.
#[derive(Clone, Debug)]
pub struct FeatureExtractor {
    filters: FeatureFilters,
    power: BandPower<MAX_FEATURES>,
    /// Electrodes of the newest step, in quarters of a microvolt, padded with zeros.
    inputs: [Pair; ELECTRODE_PAIRS],
    /// Signals of the steps that are not filtered yet.
    block: [[i32; MAX_FEATURES]; BLOCK],
    /// Number of steps of the hop so far.
    steps: u8,
    hop: u32,
    saturated: u64,
    /// True if the device's filters had not settled at the hop's first step.
    settling: bool,
    /// Number of hops, this one included, until the band-pass has settled.
    settling_hops: u8,
}

impl FeatureExtractor {
    /// An extractor before the first step of a run, without filters.
    pub const NEW: Self = Self {
        filters: FeatureFilters::NONE,
        power: BandPower::REST,
        inputs: [Pair::ZERO; ELECTRODE_PAIRS],
        block: [[0; MAX_FEATURES]; BLOCK],
        steps: 0,
        hop: 0,
        saturated: 0,
        settling: false,
        settling_hops: SETTLING_HOPS,
    };

    /// Starts a run in place; the filters stay.
    pub fn restart(&mut self) {
        self.power = BandPower::REST;
        self.steps = 0;
        self.hop = 0;
        self.saturated = 0;
        self.settling_hops = SETTLING_HOPS;
    }

    /// Uses these filters from the next step on. The current hop and the hops of the following
    /// second, in which the band-pass settles, are marked as settling. Setting the same filters
    /// again changes nothing.
    pub fn set_filters(&mut self, filters: FeatureFilters) {
        if filters != self.filters {
            self.filters = filters;
            self.power = BandPower::REST;
            self.settling_hops = SETTLING_HOPS + u8::from(self.steps > 0);
        }
    }

    /// Adds a step; returns the features if the step completes a hop and there are filters.
    #[inline(never)]
    pub fn add_step(&mut self, step: &Step) -> Option<Features> {
        if self.steps == 0 {
            self.settling = step.settling;
        }
        self.saturated |= step.saturated;
        let place = usize::from(self.steps) % BLOCK;
        let signals = &mut self.block[place];
        *signals = [0; MAX_FEATURES];
        // `try_accumulate` always returns true, because the matrix has a constant size.
        write_quarters(&step.electrodes, &mut self.inputs);
        let _ = (self.filters.matrix()).try_accumulate(&self.inputs, signals);
        let filters = usize::from(self.filters.filters);
        if place == BLOCK - 1 {
            (self.power).add_block(&self.filters.band, &self.block, filters);
        }
        self.steps += 1;
        if usize::from(self.steps) < HOP {
            return None;
        }
        let features = Features {
            id: self.filters.id,
            hop: self.hop,
            offset_us: step.offset_us,
            saturated: self.saturated,
            settling: self.settling || self.settling_hops > 0,
            filters: self.filters.filters,
            levels: self.power.take_levels(filters),
        };
        self.steps = 0;
        self.saturated = 0;
        self.settling_hops = self.settling_hops.saturating_sub(1);
        self.hop = self.hop.wrapping_add(1);
        (self.filters.filters > 0).then_some(features)
    }
}

#[cfg(test)]
mod tests;
