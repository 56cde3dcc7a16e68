//! Inputs of the images, the same in every run: extreme test signals, synthetic EEG, and real EEG
//! where it is available.

use std::env;
use std::path::Path;

use any_model::Stress;
use anyhow::{Context, ensure};
use fixed_dsp::BLOCK;
use host_sim::Source;
use host_sim::synthetic::{Generator, SyntheticSpec};
use model::{ADC_RATE_HZ, CELLS, CHANNELS, ELECTRODES, GUARD_BITS, LSB_NV};
use pipeline::{Acquisition, Mains, Plane, Sample, Step};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use recordings::{AdcSpec, Missing, MontageMap, Recording, VirtualAdc};

use crate::block::{BLOCKS, Block};
use crate::hop;

/// Real EEG for the filters, in the folder that `CORTICODE_DATA` names: 61 electrodes at 512 Hz.
const RESAMPLED: &str = "derived/s001r04_61ch_512hz_i16.gdf";
/// Real EEG for the encoder, in the folder that `CORTICODE_DATA` names: 125 s, mains at 60 Hz, not
/// used in training.
const HELD_OUT: &str = "eegmmidb_S001/S001R11.edf";

/// Number of time steps left out at the start of the packed encoder's inputs: 10 s, in which
/// filters settle.
const SETTLING_STEPS: usize = 1_280;

/// Error message if a recording of real EEG cannot be read.
const FAILED: &str = "reading real EEG failed\n  next: does CORTICODE_DATA name the right folder?";

/// Inputs of equal length, as elements `T`: blocks, planes, samples or steps.
#[derive(Debug)]
pub(crate) struct Inputs<T> {
    pub(crate) names: Vec<&'static str>,
    pub(crate) data: Vec<Vec<T>>,
    /// For each missing input, the reason why it is missing.
    pub(crate) skipped: Vec<String>,
}

impl<T> Inputs<T> {
    pub(crate) fn new() -> Self {
        Self { names: Vec::new(), data: Vec::new(), skipped: Vec::new() }
    }

    fn add(&mut self, name: &'static str, data: Vec<T>) {
        self.names.push(name);
        self.data.push(data);
    }

    /// Returns the inputs if each has `length` elements (blocks, samples or time steps).
    ///
    /// # Errors
    /// The recording is too short. The message contains the name `recording` and the advice `next`.
    fn of_length(self, length: usize, recording: &str, next: &str) -> anyhow::Result<Self> {
        ensure!(
            self.data.iter().all(|input| input.len() == length),
            "{recording} is too short for {length} blocks, samples or time steps\n  next: {next}"
        );
        Ok(self)
    }

    /// Adds real EEG as an input or, if it is not available, notes the reason.
    fn add_real(&mut self, data: Result<Vec<T>, String>) {
        match data {
            Ok(data) => self.add("real EEG", data),
            Err(reason) => {
                eprintln!("SKIPPED: {reason}");
                self.skipped.push(reason);
            }
        }
    }
}

/// Returns the inputs of the filters, with [`BLOCKS`] blocks each.
///
/// # Errors
/// `CORTICODE_DATA` is set, and its recording cannot be read or is too short.
pub(crate) fn blocks() -> anyhow::Result<Inputs<Block>> {
    let mut inputs = Inputs::new();
    for (name, samples) in signals()? {
        inputs.add(name, to_blocks(samples));
    }
    inputs.add_real(recorded(RESAMPLED).context(FAILED)?.map(to_blocks));
    inputs.of_length(BLOCKS, RESAMPLED, "restore the file")
}

/// Returns the inputs of the lossless compression, with `count` samples each.
///
/// # Errors
/// `CORTICODE_DATA` is set, and its recording cannot be read or is too short.
pub(crate) fn samples(count: usize) -> anyhow::Result<Inputs<Sample>> {
    let mut inputs = Inputs::new();
    for (name, samples) in signals()? {
        inputs.add(name, samples.take(count).collect());
    }
    match recorded(RESAMPLED).context(FAILED)? {
        Ok(samples) => {
            for (name, noise_uv) in [
                ("real EEG, 0.2 uV noise", 0.2),
                ("real EEG, 0.5 uV noise", 0.5),
                ("real EEG, 1.0 uV noise", 1.0),
            ] {
                let mut random = ChaCha8Rng::seed_from_u64(3);
                let samples = samples.iter().take(count);
                let noisy = samples.map(|sample| with_noise(sample, noise_uv, &mut random));
                inputs.add(name, noisy.collect());
            }
        }
        Err(reason) => inputs.add_real(Err(reason)),
    }
    inputs.of_length(count, RESAMPLED, "restore the file")
}

/// Returns a sample with white noise added to its electrodes, as an amplifier would. The recording
/// has no noise above 80 Hz, because it was resampled from 160 Hz.
fn with_noise(sample: &Sample, noise_uv: f64, random: &mut ChaCha8Rng) -> Sample {
    let mut counts = sample.counts;
    for count in &mut counts[..ELECTRODES] {
        // The sum of twelve uniform numbers is about normal and has variance 1.
        let normal: f64 = (0..12).map(|_| random.random::<f64>() - 0.5).sum();
        #[expect(clippy::cast_possible_truncation, reason = "some microvolts")]
        let noise = (normal * noise_uv * 1000.0 / f64::from(LSB_NV)).round() as i32;
        *count = (*count + noise).clamp(-Sample::MAX - 1, Sample::MAX);
    }
    Sample { counts }
}

/// Returns the encoder's inputs. Together they contain at least `windows` windows.
///
/// # Errors
/// `CORTICODE_DATA` is set, and its recording cannot be read or is too short.
pub(crate) fn planes(windows: usize) -> anyhow::Result<Inputs<Plane>> {
    let real = recorded(HELD_OUT).context(FAILED)?;
    let count = Stress::ALL.len() + 1 + usize::from(real.is_ok());
    let steps = hop::steps(windows.div_ceil(count));
    let mut inputs = Inputs::new();
    for stress in Stress::ALL {
        let planes = stress.planes(CELLS).take(steps);
        let planes = planes.map(|plane| std::array::from_fn(|cell| plane[cell]));
        inputs.add(stress.name(), planes.collect());
    }
    inputs.add("synthetic EEG", to_planes(Mains::Hz50, synthetic()?, steps));
    inputs.add_real(real.map(|samples| to_planes(Mains::Hz60, samples, steps)));
    inputs.of_length(steps, HELD_OUT, "ask for fewer --windows")
}

/// Returns the inputs of the packed encoder, with `count` time steps each.
///
/// # Errors
/// `CORTICODE_DATA` is set, and its recording cannot be read or is too short.
pub(crate) fn steps(count: usize) -> anyhow::Result<Inputs<Step>> {
    let mut inputs = Inputs::new();
    let noisy = eight_noisy(synthetic()?, ChaCha8Rng::seed_from_u64(4));
    let [_, rails, noise, synthetic] = signals()?;
    inputs.add("silence", vec![Step::SILENCE; count]);
    for (name, samples) in [
        rails,
        noise,
        ("impulses", Box::new(impulses(ChaCha8Rng::seed_from_u64(3)))),
        ("synthetic EEG, eight electrodes noisy", Box::new(noisy)),
        synthetic,
    ] {
        inputs.add(name, to_steps(Mains::Hz50, samples, count));
    }
    let real = recorded(HELD_OUT).context(FAILED)?;
    inputs.add_real(real.map(|samples| to_steps(Mains::Hz60, samples, count)));
    inputs.of_length(count, HELD_OUT, "ask for fewer --hops")
}

/// Name of a test signal, and its endless samples.
type Signal = (&'static str, Box<dyn Iterator<Item = Sample>>);

/// Returns the test signals silence, jumps between rails, full-range noise, and synthetic EEG.
fn signals() -> anyhow::Result<[Signal; 4]> {
    let random = ChaCha8Rng::seed_from_u64;
    Ok([
        ("silence", Box::new(std::iter::repeat(Sample::default()))),
        ("rails", Box::new(telegraph(random(1)))),
        ("noise", Box::new(white(random(2)))),
        ("synthetic EEG", Box::new(synthetic()?)),
    ])
}

/// Returns endless synthetic EEG at the model's electrodes, the same on every call.
pub(crate) fn synthetic() -> anyhow::Result<impl Iterator<Item = Sample>> {
    let spec = SyntheticSpec::new(3, model::LABELS.split(' '));
    let mut source = Source::Synthetic(Box::new(Generator::new(&spec)?));
    Ok(std::iter::from_fn(move || source.next_sample().ok().flatten()))
}

/// Returns the samples of a recording in the folder that `CORTICODE_DATA` names, converted to the
/// model's montage and rate. Returns `Ok(Err(reason))` if the variable is not set.
fn recorded(file: &str) -> anyhow::Result<Result<Vec<Sample>, String>> {
    let Some(folder) = env::var_os("CORTICODE_DATA").filter(|folder| !folder.is_empty()) else {
        return Ok(Err(format!(
            "real EEG as input: CORTICODE_DATA is not set; it names the folder that has {file}"
        )));
    };
    let recording = Recording::open(Path::new(&folder).join(file))?;
    let electrodes: Vec<&str> = model::LABELS.split(' ').collect();
    let map = MontageMap::new(&recording.labels(), &electrodes, Missing::Interpolate);
    let adc = AdcSpec { rate_hz: ADC_RATE_HZ.into(), lsb_uv: f64::from(LSB_NV) / 1000.0 };
    let adc = VirtualAdc::new(recording, &map?, adc)?;
    let mut source = Source::Recording(Box::new(adc));
    let samples = std::iter::from_fn(|| source.next_sample().transpose());
    Ok(Ok(samples.collect::<Result<_, _>>()?))
}

fn to_blocks(samples: impl IntoIterator<Item = Sample>) -> Vec<Block> {
    let samples: Vec<Sample> = samples.into_iter().take(BLOCKS * BLOCK).collect();
    let blocks = samples.as_chunks::<BLOCK>().0.iter().map(|four| {
        std::array::from_fn(|electrode| {
            four.each_ref().map(|sample| sample.counts[electrode] << GUARD_BITS)
        })
    });
    blocks.collect()
}

/// Returns the first `steps` planes (scalp grids) that the acquisition computes from the samples.
fn to_planes(mains: Mains, samples: impl IntoIterator<Item = Sample>, steps: usize) -> Vec<Plane> {
    let mut acquisition = Acquisition::new(mains);
    let samples = samples.into_iter();
    let steps_of = samples.filter_map(|sample| acquisition.process_sample(&sample));
    steps_of.map(|step| step.plane).take(steps).collect()
}

/// Returns `count` steps that the acquisition computes after the first [`SETTLING_STEPS`].
fn to_steps(mains: Mains, samples: impl IntoIterator<Item = Sample>, count: usize) -> Vec<Step> {
    let mut acquisition = Acquisition::new(mains);
    let samples = samples.into_iter();
    let steps = samples.filter_map(|sample| acquisition.process_sample(&sample));
    steps.skip(SETTLING_STEPS).take(count).collect()
}

/// Returns samples of 0, except that one count in 500 is 1 mV or -1 mV.
fn impulses(mut random: ChaCha8Rng) -> impl Iterator<Item = Sample> {
    let millivolt = counts(1_000.0);
    std::iter::repeat_with(move || Sample {
        counts: std::array::from_fn(|_| match random.random_range(0..1_000) {
            0 => millivolt,
            1 => -millivolt,
            _ => 0,
        }),
    })
}

/// Returns the samples with white noise of 100 uV rms added to the first eight electrodes.
fn eight_noisy(
    samples: impl Iterator<Item = Sample>,
    mut random: ChaCha8Rng,
) -> impl Iterator<Item = Sample> {
    // The rms of a uniform distribution is its largest value divided by the square root of 3.
    let largest = counts(100.0 * 3_f32.sqrt());
    samples.map(move |mut sample| {
        for count in sample.counts.iter_mut().take(8) {
            *count += random.random_range(-largest..=largest);
        }
        sample
    })
}

/// Converts microvolts to counts of the ADC.
#[expect(clippy::cast_possible_truncation, reason = "some millivolts at most")]
fn counts(uv: f32) -> i32 {
    (uv * 1_000.0 / LSB_NV).round() as i32
}

/// Returns a random telegraph signal: each electrode jumps from rail to rail 25.6 times per second
/// on average.
fn telegraph(mut random: ChaCha8Rng) -> impl Iterator<Item = Sample> {
    let mut counts = [Sample::MAX; CHANNELS];
    std::iter::repeat_with(move || {
        for count in &mut counts[..ELECTRODES] {
            if random.random_ratio(1, 20) {
                // `!` leads to the opposite rail: !MAX is -MAX - 1.
                *count = !*count;
            }
        }
        Sample { counts }
    })
}

/// Returns white noise, uniform over the whole 24-bit range.
fn white(mut random: ChaCha8Rng) -> impl Iterator<Item = Sample> {
    std::iter::repeat_with(move || Sample {
        counts: std::array::from_fn(|_| random.next_u32().cast_signed() >> 8),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_requested_number_of_windows_is_made_and_eeg_is_not_silent() {
        let inputs = planes(100).expect("inputs");
        let steps = inputs.data[0].len();
        let all = inputs.names.len() * hop::windows(steps);
        assert!((100..100 + inputs.names.len()).contains(&all), "{all}");
        let eeg = inputs.data[4][steps / 2..].as_flattened();
        let loud = eeg.iter().filter(|cell| cell.unsigned_abs() > 1).count();
        assert!(loud > eeg.len() / 10, "{loud} of {}", eeg.len());
    }
}
