//! What is counted: our filters in their forms of use, and a peer's.

use fixed_dsp::{BLOCK, CascadeState, DelayLine, Filter, Resampler};
use idsp::iir::{DirectForm1, DirectForm1Dither, DirectForm1Wide};
use model::{CHANNELS, ELECTRODES, GUARD_BITS, SECTIONS};
use pipeline::{Acquisition, Electrodes, Mains, Sample};

use crate::{
    any_sections::AnySections,
    block::{Block, SILENCE},
    idsp_cascade::IdspCascade,
};

/// Something that takes four samples of all electrodes at a time.
pub trait Contender {
    /// Takes the next block.
    fn take(&mut self, block: &Block);

    /// Does with it what is counted.
    fn run(&mut self);

    /// What came of it; fewer numbers than a block has are followed by zeros.
    fn give(&self) -> Block;
}

/// Names of the contenders, in the order of [`with_contenders`].
pub const NAMES: [&str; 8] = [
    "ours-blocks",
    "ours-singles",
    "ours-resampler-64",
    "ours-acquisition",
    "ours-any-sections",
    "idsp-dither",
    "idsp-wide",
    "idsp-plain",
];

/// Gives `use_them` all contenders at rest.
pub fn with_contenders<R>(use_them: impl FnOnce([&mut dyn Contender; NAMES.len()]) -> R) -> R {
    use_them([
        &mut Blocks::default(),
        &mut Singles::default(),
        &mut Resampling::default(),
        &mut Acquiring::default(),
        &mut AnySections::default(),
        &mut IdspCascade::<DirectForm1Dither>::default(),
        &mut IdspCascade::<DirectForm1Wide>::default(),
        &mut IdspCascade::<DirectForm1<i32>>::default(),
    ])
}

/// The filters for 50 Hz mains, four samples at a time.
struct Blocks {
    states: [CascadeState<SECTIONS>; ELECTRODES],
    block: Block,
}

impl Default for Blocks {
    fn default() -> Self {
        Self {
            states: [CascadeState::REST; ELECTRODES],
            block: SILENCE,
        }
    }
}

impl Contender for Blocks {
    fn take(&mut self, block: &Block) {
        self.block = *block;
    }

    fn run(&mut self) {
        Mains::Hz50.apply_blocks(&mut self.states, &mut self.block);
    }

    fn give(&self) -> Block {
        self.block
    }
}

/// The same, all electrodes sample by sample.
#[derive(Default)]
struct Singles(Blocks);

impl Contender for Singles {
    fn take(&mut self, block: &Block) {
        self.0.take(block);
    }

    fn run(&mut self) {
        let Blocks { states, block } = &mut self.0;
        for sample in 0..BLOCK {
            for (state, channel) in states.iter_mut().zip(&mut *block) {
                channel[sample] = Mains::Hz50.apply(state, channel[sample]);
            }
        }
    }

    fn give(&self) -> Block {
        self.0.give()
    }
}

/// Taps of the resampler that is counted: as many as 512 Hz needs. Their values change no count.
const TAPS: usize = 64;

/// A resampler from 512 to 128 Hz: four samples into the delay line, one output.
struct Resampling {
    resampler: Resampler<1, TAPS>,
    line: DelayLine<ELECTRODES, TAPS>,
    block: Block,
    outputs: Electrodes,
}

impl Default for Resampling {
    fn default() -> Self {
        let taps = [[Resampler::<1, TAPS>::UNITY / 64; TAPS]];
        Self {
            resampler: core::hint::black_box(Resampler { down: 4, taps }),
            line: DelayLine::SILENCE,
            block: SILENCE,
            outputs: [0; ELECTRODES],
        }
    }
}

impl Contender for Resampling {
    fn take(&mut self, block: &Block) {
        self.block = *block;
    }

    fn run(&mut self) {
        for sample in 0..BLOCK {
            self.line
                .push(self.block.iter().map(|samples| samples[sample]));
        }
        self.outputs = self.resampler.outputs(0, &self.line);
    }

    fn give(&self) -> Block {
        padded(&self.outputs)
    }
}

/// The whole acquisition: rails, filters, decimation, scalp grid, quantisation.
struct Acquiring {
    acquisition: Acquisition,
    samples: [Sample; BLOCK],
    electrodes: Electrodes,
}

impl Default for Acquiring {
    /// One sample of silence has passed, which gave the first step; from now on a step comes with
    /// every fourth.
    fn default() -> Self {
        let mut acquisition = Acquisition::new(Mains::Hz50);
        acquisition.process_sample(&Sample::default());
        Self {
            acquisition,
            samples: [Sample::default(); BLOCK],
            electrodes: [0; ELECTRODES],
        }
    }
}

impl Contender for Acquiring {
    fn take(&mut self, block: &Block) {
        for (sample, time) in self.samples.iter_mut().zip(0..) {
            sample.counts = [0; CHANNELS];
            for (count, channel) in sample.counts.iter_mut().zip(block) {
                *count = channel[time] >> GUARD_BITS;
            }
        }
    }

    fn run(&mut self) {
        for sample in &self.samples {
            if let Some(step) = self.acquisition.process_sample(sample) {
                self.electrodes = step.electrodes;
            }
        }
    }

    fn give(&self) -> Block {
        padded(&self.electrodes)
    }
}

/// The numbers, each followed by zeros.
fn padded(electrodes: &Electrodes) -> Block {
    electrodes.map(|value| {
        let mut samples = [0; BLOCK];
        samples[0] = value;
        samples
    })
}
