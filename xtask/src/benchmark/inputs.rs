//! What the filters are counted on: silence, rails, noise, EEG.

use std::fmt;
use std::path::PathBuf;

use bench::block::{self, BLOCKS, Block};
use fixed_dsp::BLOCK;
use host_sim::synthetic::{Generator, SyntheticSpec};
use model::{CHANNELS, ELECTRODES, GUARD_BITS};
use pipeline::Sample;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use recordings::{AdcSpec, Missing, MontageMap, Recording, VirtualAdc};

use crate::failure::Failure;

/// Real EEG below the folder that `CORTICODE_DATA` names: 61 electrodes at 512 Hz.
const REAL: &str = "derived/s001r04_61ch_512hz_i16.gdf";

/// Samples of an input.
const SAMPLES: usize = BLOCKS * BLOCK;

pub(crate) type Counts = [i32; CHANNELS];

/// The inputs one after the other.
#[derive(Debug)]
pub(crate) struct Inputs {
    /// Their names.
    pub(crate) names: Vec<&'static str>,
    /// [`BLOCKS`] blocks of each.
    pub(crate) blocks: Vec<Block>,
    /// The same as a file.
    pub(crate) bytes: Vec<u8>,
    /// What could not be had.
    pub(crate) skipped: Vec<String>,
}

impl Inputs {
    /// Makes them; the same on every run.
    ///
    /// # Errors
    /// The real recording is announced and cannot be read.
    pub(crate) fn make() -> Result<Self, Failure> {
        let mut inputs = Self {
            names: Vec::new(),
            blocks: Vec::new(),
            bytes: Vec::new(),
            skipped: Vec::new(),
        };
        inputs.add("silence", std::iter::repeat([0; CHANNELS]));
        inputs.add("rails", telegraph(ChaCha8Rng::seed_from_u64(1)));
        inputs.add("noise", white(ChaCha8Rng::seed_from_u64(2)));
        let spec = SyntheticSpec::new(3, model::LABELS.split(' '));
        inputs.add("synthetic EEG", Generator::new(&spec).map_err(unusable)?);
        if let Some(folder) = std::env::var_os("CORTICODE_DATA").filter(|path| !path.is_empty()) {
            let path = PathBuf::from(folder).join(REAL);
            let samples = recorded(&path, SAMPLES)?;
            if samples.len() < SAMPLES {
                return Err(unusable(format!("{} is too short", path.display())));
            }
            inputs.add("real EEG", samples);
        } else {
            let why = "real EEG as input: CORTICODE_DATA is not set; it names the folder that has";
            inputs.skipped.push(format!("{why} {REAL}"));
        }
        Ok(inputs)
    }

    fn add(&mut self, name: &'static str, samples: impl IntoIterator<Item = Counts>) {
        self.names.push(name);
        let samples: Vec<Counts> = samples.into_iter().take(SAMPLES).collect();
        for four in samples.as_chunks::<BLOCK>().0 {
            let block: Block = std::array::from_fn(|electrode| {
                std::array::from_fn(|sample| four[sample][electrode] << GUARD_BITS)
            });
            self.blocks.push(block);
            self.bytes.extend(block::to_bytes(&block));
        }
    }
}

/// Every electrode jumps from rail to rail, at random and 25 times per second on average.
fn telegraph(mut random: ChaCha8Rng) -> impl Iterator<Item = Counts> {
    let mut counts = [Sample::MAX; CHANNELS];
    std::iter::repeat_with(move || {
        for count in &mut counts[..ELECTRODES] {
            if random.random_ratio(1, 20) {
                // The other rail: -MAX - 1 for MAX and back.
                *count = !*count;
            }
        }
        counts
    })
}

/// White noise over the whole range.
fn white(mut random: ChaCha8Rng) -> impl Iterator<Item = Counts> {
    std::iter::repeat_with(move || {
        // The upper 24 bits.
        std::array::from_fn(|_| random.next_u32().cast_signed() >> 8)
    })
}

/// The recording as the virtual ADC delivers it, from its beginning; so many samples at most.
pub(crate) fn recorded(path: &std::path::Path, samples: usize) -> Result<Vec<Counts>, Failure> {
    let recording = Recording::open(path).map_err(unusable)?;
    let electrodes: Vec<&str> = model::LABELS.split(' ').collect();
    let map = MontageMap::new(&recording.labels(), &electrodes, Missing::Interpolate);
    let adc = AdcSpec::ads1299(model::ADC_RATE_HZ.into());
    let adc = VirtualAdc::new(recording, &map.map_err(unusable)?, adc).map_err(unusable)?;
    let samples: Result<Vec<Counts>, _> = adc.take(samples).collect();
    samples.map_err(unusable)
}

pub(crate) fn unusable(why: impl fmt::Display) -> Failure {
    Failure::Check {
        what: "making an input".to_owned(),
        why: format!("{why}"),
        next: "does CORTICODE_DATA name the right folder?".to_owned(),
    }
}
