//! All contenders: our filters in each way in which they are used and, for comparison, the filters
//! of the third-party crate idsp.

use fixed_dsp::{BLOCK, CascadeState, DelayLine, Filter, Resampler};
use idsp::iir::{DirectForm1, DirectForm1Dither, DirectForm1Wide};
use model::{CHANNELS, ELECTRODES, GUARD_BITS, SECTIONS};
use pipeline::{Acquisition, Electrodes, Mains, Sample};

use crate::{
    any_sections::AnySections,
    block::{Block, SILENCE},
    idsp_cascade::IdspCascade,
};

/// Filter code under test, which processes four samples of all electrodes at a time.
pub trait Contender {
    /// Stores the next input block. Instructions of this function are not counted.
    fn load(&mut self, block: &Block);

    /// Processes the stored block. Instructions of this function are counted.
    fn run(&mut self);

    /// Returns the result of [`run`](Self::run), padded with zeros if it is shorter than a block.
    fn output(&self) -> Block;
}

/// Names of the contenders (compared filters) in reports, in the order of [`with_contenders`].
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

/// Calls `use_them` with all contenders, newly created and in the order of [`NAMES`].
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

/// Contender that runs our filters for 50 Hz mains, four samples at a time.
struct Blocks {
    states: [CascadeState<SECTIONS>; ELECTRODES],
    block: Block,
}

impl Default for Blocks {
    fn default() -> Self {
        Self { states: [CascadeState::REST; ELECTRODES], block: SILENCE }
    }
}

impl Contender for Blocks {
    fn load(&mut self, block: &Block) {
        self.block = *block;
    }

    fn run(&mut self) {
        Mains::Hz50.apply_blocks(&mut self.states, &mut self.block);
    }

    fn output(&self) -> Block {
        self.block
    }
}

/// Contender that runs our filters for 50 Hz mains, one sample of all electrodes at a time.
#[derive(Default)]
struct Singles(Blocks);

impl Contender for Singles {
    fn load(&mut self, block: &Block) {
        self.0.load(block);
    }

    fn run(&mut self) {
        let Blocks { states, block } = &mut self.0;
        for sample in 0..BLOCK {
            for (state, channel) in states.iter_mut().zip(&mut *block) {
                channel[sample] = Mains::Hz50.apply(state, channel[sample]);
            }
        }
    }

    fn output(&self) -> Block {
        self.0.output()
    }
}

/// Number of taps of the measured resampler: as many as a decimation from 512 Hz needs. The taps'
/// values do not affect the number of instructions.
const TAPS: usize = 64;

/// Contender that resamples from 512 to 128 Hz: for each block, four samples enter the delay line
/// and one output is computed.
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
    fn load(&mut self, block: &Block) {
        self.block = *block;
    }

    fn run(&mut self) {
        for sample in 0..BLOCK {
            self.line.push(self.block.iter().map(|samples| samples[sample]));
        }
        self.outputs = self.resampler.outputs(0, &self.line);
    }

    fn output(&self) -> Block {
        as_block(&self.outputs)
    }
}

/// The whole acquisition as a contender: rail detection, filters, decimation, grid, quantisation.
struct Acquiring {
    acquisition: Acquisition,
    samples: [Sample; BLOCK],
    electrodes: Electrodes,
}

impl Default for Acquiring {
    /// Creates the acquisition and processes one sample of silence, which completes the first time
    /// step. Afterwards every block of four samples completes one time step.
    fn default() -> Self {
        let mut acquisition = Acquisition::new(Mains::Hz50);
        acquisition.process_sample(&Sample::default());
        Self { acquisition, samples: [Sample::default(); BLOCK], electrodes: [0; ELECTRODES] }
    }
}

impl Contender for Acquiring {
    fn load(&mut self, block: &Block) {
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

    fn output(&self) -> Block {
        as_block(&self.electrodes)
    }
}

/// Returns a block with the electrodes' values in its first sample, and zeros in the others.
fn as_block(electrodes: &Electrodes) -> Block {
    electrodes.map(|value| {
        let mut samples = [0; BLOCK];
        samples[0] = value;
        samples
    })
}
