//! The front end at every sampling rate and decimation: comparison with scipy, aliases, delay.

mod aliases;
mod delay;
mod rates;

use artifact::Decimation;
use fixed_dsp::{Cascade, Resampler};
use model::{CHANNELS, GUARD_BITS, SECTIONS};
use model_gen::{Chain, FilterSpec, ResamplerTable, cascade};
use pipeline::{FrontEnd, Sample};

/// Step rate of every front end in these tests, Hz.
const STEP_RATE_HZ: u32 = 128;

/// The device's filters and resampler, designed and quantised at run time for any ADC rate.
struct AtRate {
    rate_hz: u32,
    cascade: Cascade<SECTIONS>,
    table: ResamplerTable,
}

impl AtRate {
    fn new(rate_hz: u32, mains_hz: u32, decimation: Decimation) -> Self {
        let spec = FilterSpec {
            rate_hz: rate_hz.into(),
            mains_hz: mains_hz.into(),
            harmonics: 0,
            notch_q: 30.0,
            band_hz: [0.5, 60.0],
            order: 5,
        };
        let sections = cascade(&spec).expect("the specification is realisable");
        Self {
            rate_hz,
            cascade: Cascade {
                sections: sections.try_into().expect("a notch and five sections"),
            },
            table: ResamplerTable::new(decimation, rate_hz, STEP_RATE_HZ, model::ELECTRODES)
                .expect("a sane rate"),
        }
    }

    /// Returns filters and resampler as a chain, which computes their response in float.
    fn chain(&self) -> Chain<'_> {
        Chain {
            sections: &self.cascade.sections,
            resampler: &self.table,
            rate_hz: self.rate_hz,
        }
    }

    /// Returns the filtered steps of one electrode, in counts, for an input of `counts`.
    fn steps(&self, counts: &[i32]) -> Vec<f64> {
        match (self.table.phases(), self.table.taps_per_phase()) {
            (1, 1) => self.run::<1, 1>(counts),
            (64, 32) => self.run::<64, 32>(counts),
            (1, 32) => self.run::<1, 32>(counts),
            (32, 64) => self.run::<32, 64>(counts),
            (1, 64) => self.run::<1, 64>(counts),
            (16, 128) => self.run::<16, 128>(counts),
            (1, 128) => self.run::<1, 128>(counts),
            (phases, taps) => panic!("no front end of {phases} phases and {taps} taps here"),
        }
    }

    fn run<const PHASES: usize, const TAPS: usize>(&self, counts: &[i32]) -> Vec<f64> {
        let rows = self.table.taps.iter().map(|row| {
            let row: [i32; TAPS] = row.as_slice().try_into().expect("TAPS taps");
            row
        });
        let rows: Vec<[i32; TAPS]> = rows.collect();
        let resampler = Resampler {
            down: self.table.down,
            taps: rows.try_into().expect("PHASES phases"),
        };
        assert!(resampler.is_consistent());
        let mut front_end = FrontEnd::<_, PHASES, TAPS>::new(self.cascade, &resampler);
        counts
            .iter()
            .filter_map(|&count| {
                front_end.filter_sample(&Sample {
                    counts: [count; CHANNELS],
                })
            })
            .map(|(electrodes, _)| f64::from(electrodes[0]) / f64::from(1 << GUARD_BITS))
            .collect()
    }
}
