//! The device's front end for any model description: filters and a resampler whose sizes are known
//! only at run time. Their outputs equal the outputs on the device, bit for bit.

use std::collections::VecDeque;

use artifact::Description;
use fixed_dsp::{Cascade, CascadeState, Filter};

use crate::device_model::filter_cascade;
use crate::error::FilterError;
use crate::headroom::GUARD_BITS;
use crate::resampler::ResamplerTable;

/// The filters of all electrodes.
#[derive(Debug)]
pub struct Filters {
    sections: Vec<Cascade<1>>,
    /// For each electrode, the states of all sections.
    states: Vec<Vec<CascadeState<1>>>,
}

impl Filters {
    /// Creates the filters of a description for a mains frequency; their states are 0.
    ///
    /// # Errors
    /// If the filters cannot be realised.
    pub fn new(description: &Description, mains_hz: u32) -> Result<Self, FilterError> {
        let rate_hz = description.adc.rate_hz;
        let sections = filter_cascade(&description.filters, rate_hz, mains_hz)?;
        let states = vec![CascadeState::REST; sections.len()];
        let cascade = |section| Cascade { sections: [section] };
        Ok(Self {
            sections: sections.into_iter().map(cascade).collect(),
            states: vec![states; description.montage.electrodes.len()],
        })
    }

    /// Filters one sample of each electrode, in counts; returns counts x 2^5 (Q27.5).
    pub fn filter_sample(&mut self, counts: &[i32]) -> Vec<i32> {
        let electrodes = counts.iter().zip(&mut self.states);
        let filtered = electrodes.map(|(&count, states)| {
            let sections = self.sections.iter().zip(states);
            sections.fold(count << GUARD_BITS, |x, (section, state)| section.apply(state, x))
        });
        filtered.collect()
    }
}

/// Resampler from the ADC's rate to the step rate.
#[derive(Debug)]
pub struct Resampler {
    table: ResamplerTable,
    /// The last filtered samples, as many as a phase has taps, newest first.
    newest: VecDeque<Vec<i32>>,
    /// Time from the next input sample to the next output. The unit is one sample period divided by
    /// the number of phases.
    ahead: usize,
}

impl Resampler {
    /// Creates a resampler whose previous samples are all 0.
    ///
    /// # Errors
    /// If the decimation cannot be realised.
    pub fn new(description: &Description) -> Result<Self, FilterError> {
        let table = ResamplerTable::new(
            description.filters.decimation,
            description.adc.rate_hz,
            description.window.rate_hz,
            description.montage.electrodes.len(),
        )?;
        Ok(Self {
            newest: vec![vec![0; description.montage.electrodes.len()]; table.taps_per_phase()]
                .into(),
            table,
            ahead: 0,
        })
    }

    /// Adds a filtered sample; returns an output if one is due at this sample.
    ///
    /// # Panics
    /// Never for a description whose headroom [`DeviceModel`](crate::DeviceModel) has proven.
    pub fn resample(&mut self, filtered: Vec<i32>) -> Option<Vec<i32>> {
        let electrodes = filtered.len();
        self.newest.pop_back();
        self.newest.push_front(filtered);
        let phases = self.table.phases();
        if self.ahead >= phases {
            self.ahead -= phases;
            return None;
        }
        let taps = &self.table.taps[self.ahead];
        self.ahead += usize::from(self.table.down) - phases;
        let output = |electrode| {
            let samples = self.newest.iter().map(|sample| sample[electrode]);
            let sum: i64 =
                taps.iter().zip(samples).map(|(&tap, x)| i64::from(tap) * i64::from(x)).sum();
            // The Q2.30 taps add 30 fraction bits to the sum. Round half up to remove them.
            i32::try_from((sum + (1 << 29)) >> 30).expect("model-gen proves the head room")
        };
        Some((0..electrodes).map(output).collect())
    }
}
