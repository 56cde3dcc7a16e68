//! The benchmark `host`: codes per second on one core of this PC, by our encoder and by PyTorch.

use std::env;
use std::hint::black_box;
use std::time::{Duration, Instant};

use anyhow::{Context, ensure};
use artifact::{Artifact, FloatEncoder};
use model::{CELLS, CODE, CODE_SCALE, CODE_ZERO_POINT, GRID_CELL, HOP, INPUT_SCALE_UV, STEPS};
use pipeline::{Acquisition, Code, Encoder, Mains, Pipeline, Sample, Step};
use serde::Deserialize;
use serde_json::json;

use super::checked_in::{self, ARTIFACT};
use super::figures::{Report, median};
use super::inputs;
use super::programs::Python;

/// Number of rounds, each of which times every contender (our encoder, PyTorch) once. A warm-up
/// round at the start is not counted.
const ROUNDS: usize = 9;

/// Speeds of all contenders in one round, codes per second.
#[derive(Debug)]
struct Round {
    /// Speed of our encoder on the stream of time steps.
    streaming: f64,
    /// Speed of our encoder, restarted for each window, so that it computes overlaps again.
    by_window: f64,
    /// Speed of our acquisition and encoder on ADC samples.
    pipeline: f64,
    /// Answer of PyTorch; `None` where it is not installed.
    torch: Option<Answer>,
}

/// Times our encoder and PyTorch alternately, and compares the codes of both with the float
/// network's.
///
/// # Errors
/// PyTorch does not run, or a contender's codes are incomplete.
pub(crate) fn measure() -> anyhow::Result<Report> {
    let artifact = checked_in::artifact()?;
    let mut ours = Ours::new()?;
    let windows = ours.float_windows(artifact.description.input.sd_uv);
    let reference = reference(&artifact, &windows)?;
    let int8_rms_levels = rms_levels(&ours.codes()?, &reference);
    let torch = Python::find_torch("");
    eprintln!("timing each encoder {ROUNDS} times");
    let mut rounds = Vec::new();
    for _ in 0..=ROUNDS {
        rounds.push(Round {
            streaming: ours.streaming(),
            by_window: ours.by_window(),
            pipeline: ours.pipeline(),
            torch: torch.map(|torch| encode(torch, &windows)).transpose()?,
        });
    }
    let answer = rounds[ROUNDS].torch.as_ref();
    let torch_relative = answer.map(|answer| relative(&answer.codes, &reference));
    report(&rounds[1..], int8_rms_levels, torch_relative)
}

/// Builds the report; each speed is a median over the rounds.
fn report(
    rounds: &[Round],
    int8_rms_levels: f64,
    torch_relative: Option<f64>,
) -> anyhow::Result<Report> {
    let median = |figure: &dyn Fn(&Round) -> Option<f64>| median(rounds, figure);
    let single = |round: &Round| Some(round.torch.as_ref()?.single);
    let batch = |round: &Round| Some(round.torch.as_ref()?.batch);
    let version = rounds[0].torch.as_ref().map(|torch| &torch.version);
    let figures = json!({
        "codes_per_second": median(&|round| Some(round.streaming)),
        "codes_per_second_windows": median(&|round| Some(round.by_window)),
        "codes_per_second_pipeline": median(&|round| Some(round.pipeline)),
        "torch_codes_per_second": median(&single),
        "torch_codes_per_second_batch": median(&batch),
        "ratio_torch": median(&|round| Some(round.streaming / single(round)?)),
        "ratio_torch_batch": median(&|round| Some(round.streaming / batch(round)?)),
        "ratio_torch_windows_batch": median(&|round| Some(round.by_window / batch(round)?)),
        // Differences from the codes of the float network: rms in quantisation levels for int8, and
        // the largest, relative to the largest code value, for PyTorch.
        "int8_rms_steps": int8_rms_levels,
        "torch_relative": torch_relative,
        "arch": env::consts::ARCH,
        "threads": 1,
        "rounds": rounds.len(),
        "torch": version,
    });
    let next = "compare tests/bench/torch_encoder.py with the mode and the network in signal/model/artifact/model.toml";
    Report::new("host", figures, next)
}

/// Number of windows in the input that every contender encodes; PyTorch also gets them as one
/// batch.
const WINDOWS: usize = 256;

/// Shortest duration of the timing of one contender; `torch_encoder.py` uses the same value.
const TURN: Duration = Duration::from_millis(200);

/// Our encoder and pipeline, as they are timed, with their input.
struct Ours {
    samples: Vec<Sample>,
    /// Time steps that the acquisition computes from `samples`.
    steps: Vec<Step>,
    encoder: Encoder<'static>,
    pipeline: Pipeline,
}

impl Ours {
    /// Generates the input, which is the same in every run, and creates the encoders.
    fn new() -> anyhow::Result<Self> {
        let mut eeg = inputs::synthetic()?;
        let mut acquisition = Acquisition::new(Mains::Hz50);
        let (mut samples, mut steps) = (Vec::new(), Vec::new());
        while steps.len() < STEPS + (WINDOWS - 1) * HOP {
            let sample = eeg.next().context("synthetic EEG ends")?;
            steps.extend(acquisition.process_sample(&sample));
            samples.push(sample);
        }
        Ok(Self {
            samples,
            steps,
            encoder: Encoder::new(),
            pipeline: Pipeline::new(Mains::Hz50),
        })
    }

    /// Returns the windows as inputs of the float network, ordered by time step and cell. `sd_uv`
    /// is the standard deviation to which the network's input is scaled.
    fn float_windows(&self, sd_uv: f64) -> Vec<[f32; STEPS * CELLS]> {
        #[expect(
            clippy::cast_possible_truncation,
            reason = "the network computes in f32"
        )]
        let scale = INPUT_SCALE_UV / sd_uv as f32;
        let windows = self.steps.windows(STEPS).step_by(HOP).map(|window| {
            let cell = |cell: usize| f32::from(window[cell / CELLS].plane[cell % CELLS]) * scale;
            std::array::from_fn(cell)
        });
        windows.collect()
    }

    /// Returns the values of the codes of all windows, one code after the other.
    ///
    /// # Errors
    /// Encoding the stream and encoding each window separately yield different codes, or a code is
    /// missing.
    fn codes(&self) -> anyhow::Result<Vec<i32>> {
        let values = |codes: &[Code]| -> Vec<i32> {
            codes.iter().flat_map(|code| code.values.levels()).collect()
        };
        let streamed = values(&streamed(&mut Encoder::new(), &self.steps));
        ensure!(
            streamed.len() == WINDOWS * CODE && streamed == values(&windows(&self.steps)),
            "the codes of a stream are not those of its windows one by one\n  \
             next: `cargo test --package pipeline --test streaming_equals_batch`"
        );
        Ok(streamed)
    }

    /// Times the encoder on the stream of time steps; returns codes per second.
    fn streaming(&mut self) -> f64 {
        timed(|| streamed(&mut self.encoder, &self.steps).len())
    }

    /// Times the encoder on single windows, each with a new encoder; returns codes per second.
    fn by_window(&self) -> f64 {
        timed(|| windows(&self.steps).len())
    }

    /// Times acquisition and encoder on ADC samples; returns codes per second.
    fn pipeline(&mut self) -> f64 {
        timed(|| {
            let samples = self.samples.iter();
            let codes = samples.filter_map(|sample| self.pipeline.encode_sample(sample));
            codes.map(black_box).count()
        })
    }
}

/// Calls `codes` repeatedly for at least [`TURN`]; returns codes per second. `codes` returns the
/// number of codes that it has computed.
fn timed(mut codes: impl FnMut() -> usize) -> f64 {
    let start = Instant::now();
    let mut count = 0.0;
    while start.elapsed() < TURN {
        count += f64::from(u32::try_from(codes()).unwrap_or(u32::MAX));
    }
    count / start.elapsed().as_secs_f64()
}

fn streamed(encoder: &mut Encoder, steps: &[Step]) -> Vec<Code> {
    let codes = steps.iter().filter_map(|step| encoder.encode_step(step));
    codes.map(black_box).collect()
}

/// Returns the code of each window, computed by a new encoder from all its time steps.
fn windows(steps: &[Step]) -> Vec<Code> {
    let windows = steps.windows(STEPS).step_by(HOP);
    windows
        .filter_map(|window| streamed(&mut Encoder::new(), window).pop())
        .collect()
}

/// What one run of `torch_encoder.py` prints.
#[derive(Debug, Deserialize)]
struct Answer {
    /// Version of PyTorch that ran.
    version: String,
    /// Values of the codes of the first [`COMPARED`] windows, one code after the other.
    codes: Vec<f32>,
    /// Codes per second with one window per call of the network.
    single: f64,
    /// Codes per second with all windows in one call of the network.
    batch: f64,
}

/// Encodes the windows with the same network in PyTorch. Their values are ordered by time step and
/// cell.
///
/// # Errors
/// The script fails, or its codes are incomplete.
fn encode(torch: Python, windows: &[[f32; STEPS * CELLS]]) -> anyhow::Result<Answer> {
    let bytes = windows.as_flattened().iter();
    let bytes: Vec<u8> = bytes.flat_map(|cell| cell.to_le_bytes()).collect();
    let weights = format!("{ARTIFACT}/weights.safetensors");
    let cells: Vec<String> = GRID_CELL.iter().map(ToString::to_string).collect();
    let arguments = [weights, cells.join(","), COMPARED.to_string()];
    let answer: Answer = torch.answer("torch_encoder.py", &arguments, &bytes)?;
    let (found, expected) = (answer.codes.len(), COMPARED * CODE);
    ensure!(
        found == expected,
        "the codes of PyTorch have {found} numbers, {expected} are expected"
    );
    Ok(answer)
}

/// Number of windows whose codes are compared with the float network's, which is slow.
const COMPARED: usize = 32;

/// Returns the codes that the float network computes for the first [`COMPARED`] windows.
///
/// # Errors
/// The artifact has no encoder.
fn reference(
    artifact: &Artifact,
    windows: &[[f32; STEPS * CELLS]],
) -> anyhow::Result<Vec<Vec<f32>>> {
    let encoder = FloatEncoder::new(artifact)?;
    let windows = windows.iter().take(COMPARED);
    Ok(windows.map(|window| encoder.encode(window)).collect())
}

/// Returns the rms difference of int8 codes from the reference, in quantisation levels. A reference
/// value outside the range of int8 is clamped to the range first.
fn rms_levels(codes: &[i32], reference: &[Vec<f32>]) -> f64 {
    let mut sum = 0.0;
    for (codes, reference) in codes.chunks_exact(CODE).zip(reference) {
        for (dimension, (&code, z)) in codes.iter().zip(reference).enumerate() {
            let exact = z / CODE_SCALE[dimension] + f32::from(CODE_ZERO_POINT[dimension]);
            let exact = f64::from(exact.clamp(i8::MIN.into(), i8::MAX.into()));
            sum += (f64::from(code) - exact).powi(2);
        }
    }
    let values = u32::try_from(reference.concat().len()).unwrap_or(u32::MAX);
    (sum / f64::from(values)).sqrt()
}

/// Returns the largest difference of float codes from the reference, relative to the reference's
/// largest magnitude. No code may be NaN, because the maximum ignores NaN.
fn relative(codes: &[f32], reference: &[Vec<f32>]) -> f64 {
    let reference = reference.concat();
    let largest = reference.iter().map(|z| z.abs()).fold(0.0, f32::max);
    let differences = codes
        .iter()
        .zip(reference)
        .map(|(code, z)| (code - z).abs());
    f64::from(differences.fold(0.0, f32::max)) / f64::from(largest)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report_with(torch: Option<Answer>, torch_relative: f64) -> Report {
        let torch_relative = torch.is_some().then_some(torch_relative);
        let round = Round {
            streaming: 8_000.0,
            by_window: 4_000.0,
            pipeline: 7_000.0,
            torch,
        };
        report(&[round], 0.5, torch_relative).expect("a report")
    }

    #[test]
    fn without_torch_its_figures_are_null_and_other_codes_are_a_fault_whatever_the_speed() {
        let report = report_with(None, 0.0);
        assert_eq!(report.object["codes_per_second"], 8_000.0);
        assert!(report.object["ratio_torch"].is_null());
        assert!(report.object["torch_relative"].is_null());
        assert_eq!(report.faults(), [""; 0]);
        let torch = || {
            Some(Answer {
                version: "2".to_owned(),
                codes: Vec::new(),
                single: 1_000.0,
                batch: 5_000.0,
            })
        };
        let report = report_with(torch(), 1e-7);
        for (name, value) in [
            ("codes_per_second_windows", 4_000.0),
            ("codes_per_second_pipeline", 7_000.0),
            ("torch_codes_per_second", 1_000.0),
            ("ratio_torch", 8.0),
            ("ratio_torch_batch", 1.6),
            ("ratio_torch_windows_batch", 0.8),
        ] {
            assert_eq!(report.object[name], value, "{name}");
        }
        report_with(torch(), 0.1).assert_only_fault("torch_relative is 0.1;");
    }

    /// Returns a code in floats that corresponds to int8 values 3 above their zero points.
    fn exact() -> Vec<f32> {
        CODE_SCALE.map(|scale| 3.0 * scale).to_vec()
    }

    #[test]
    fn int8_codes_are_compared_in_levels() {
        let codes = |above: i32| CODE_ZERO_POINT.map(|zero| i32::from(zero) + above);
        for (above, expected) in [(3, 0.0), (5, 2.0)] {
            let distance = rms_levels(&codes(above), &[exact()]);
            assert!((distance - expected).abs() < 0.01, "{distance}");
        }
    }

    #[test]
    fn one_float_that_is_off_is_the_distance() {
        let mut codes = exact();
        assert!(relative(&codes, &[exact()]) < 1e-9);
        let largest = exact().into_iter().fold(0.0, f32::max);
        codes[5] += 2.0 * largest;
        let distance = relative(&codes, &[exact()]);
        assert!((distance - 2.0).abs() < 1e-6, "{distance}");
    }
}
