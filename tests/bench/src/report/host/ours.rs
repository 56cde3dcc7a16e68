//! Our encoder, timed in this process on synthetic EEG.

use std::hint::black_box;
use std::time::{Duration, Instant};

use anyhow::{Context, ensure};
use model::{CELLS, CODE, HOP, INPUT_SCALE_UV, STEPS};
use pipeline::{Acquisition, Code, Encoder, Mains, Pipeline, Sample, Step};

use crate::report::inputs;

/// Number of windows in the input, and in PyTorch's batch.
const WINDOWS: usize = 256;

/// Shortest duration of a measurement; `torch_encoder.py` uses the same value.
const TURN: Duration = Duration::from_millis(200);

/// Our encoder in the forms that are timed, with its input.
pub(crate) struct Ours {
    samples: Vec<Sample>,
    /// The acquisition's output for `samples`.
    steps: Vec<Step>,
    encoder: Encoder<'static>,
    pipeline: Pipeline,
}

impl Ours {
    /// Generates the input, which is the same in every run, and creates the encoders.
    pub(crate) fn new() -> anyhow::Result<Self> {
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

    /// Returns the windows as input of the float network, ordered by time step and cell.
    pub(crate) fn float_windows(&self, sd_uv: f64) -> Vec<[f32; STEPS * CELLS]> {
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

    /// Returns the codes of all windows, value by value.
    ///
    /// # Errors
    /// Encoding the stream and encoding each window separately yield different codes, or a code is missing.
    pub(crate) fn codes(&self) -> anyhow::Result<Vec<i32>> {
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

    /// Times one encoder on the stream of time steps; returns codes per second.
    pub(crate) fn streaming(&mut self) -> f64 {
        timed(|| streamed(&mut self.encoder, &self.steps).len())
    }

    /// Times window after window, each with a new encoder; returns codes per second.
    pub(crate) fn by_window(&self) -> f64 {
        timed(|| windows(&self.steps).len())
    }

    /// Times acquisition and encoder on ADC samples; returns codes per second.
    pub(crate) fn pipeline(&mut self) -> f64 {
        timed(|| {
            let samples = self.samples.iter();
            let codes = samples.filter_map(|sample| self.pipeline.encode_sample(sample));
            codes.map(black_box).count()
        })
    }
}

/// Calls `codes` again and again for at least [`TURN`]; returns codes per second. `codes` returns the number
/// of codes that it has made.
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

/// Encodes each window with a new encoder, without use of the overlap.
fn windows(steps: &[Step]) -> Vec<Code> {
    let windows = steps.windows(STEPS).step_by(HOP);
    windows
        .filter_map(|window| streamed(&mut Encoder::new(), window).pop())
        .collect()
}
