//! The input of `host-sim run`, opened.

use std::{error::Error, path::Path};

use host_sim::{
    RecordedEdges, Source,
    synthetic::{Generator, SyntheticSpec},
};
use link::Substitutes;
use offline::Played;
use pipeline::Mains;
use recordings::Onsets;

use crate::command_line::{Input, RunOptions};

/// Signal to play, with what its recording says about it.
pub(crate) struct OpenedInput {
    pub(crate) source: Source,
    /// Electrodes that the recording lacks.
    pub(crate) substitutes: Substitutes,
    /// Trigger edges at the events of the recording.
    pub(crate) recorded_edges: RecordedEdges,
}

impl OpenedInput {
    /// Opens the input that the options name, and prints what is wrong with it. Prints how a
    /// recording fits the montage unless the options forbid it.
    pub(crate) fn new(options: &RunOptions) -> Result<Self, Box<dyn Error>> {
        match &options.input {
            Input::Synthetic => {
                let mut spec = SyntheticSpec::new(options.seed, model::LABELS.split(' '));
                spec.mains_hz = match options.mains {
                    Mains::Hz50 => 50,
                    Mains::Hz60 => 60,
                };
                spec.rate_hz = model::ADC_RATE_HZ.into();
                spec.rails = options.rails;
                Ok(Self {
                    source: Source::Synthetic(Box::new(Generator::new(&spec)?)),
                    substitutes: Substitutes::NONE,
                    recorded_edges: RecordedEdges::default(),
                })
            }
            Input::Recording(path) => Self::recording(path, options),
        }
    }

    fn recording(path: &Path, options: &RunOptions) -> Result<Self, Box<dyn Error>> {
        let played = Played::open(path, options.missing.into())?;
        if !options.quiet {
            eprintln!("{}", played.montage);
        }
        let recorded_edges = if options.trigger_every.is_none() {
            edges(&played.onsets, options.quiet)
        } else {
            RecordedEdges::default()
        };
        for warning in &played.warnings {
            eprintln!("warning: {warning}");
        }
        Ok(Self {
            source: Source::Recording(Box::new(played.adc)),
            substitutes: played.substitutes,
            recorded_edges,
        })
    }
}

/// Returns the trigger edges at the events of a recording.
fn edges(onsets: &Onsets, quiet: bool) -> RecordedEdges {
    let edges = RecordedEdges::new(onsets);
    if onsets.outside > 0 {
        eprintln!(
            "warning: {} events are outside the signal and are not played",
            onsets.outside
        );
    }
    if !quiet && edges.pulses() > 0 {
        eprintln!(
            "events: {} trigger pulses for {} events; host-sim inspect lists them",
            edges.pulses(),
            onsets.seconds.len()
        );
    }
    edges
}
