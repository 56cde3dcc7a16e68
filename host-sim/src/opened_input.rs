//! The input of `host-sim run`, opened.

use std::{error::Error, path::Path};

use host_sim::{
    RecordedEdges, Source,
    synthetic::{Generator, SyntheticSpec},
};
use link::Substitutes;
use recordings::montage_map::Origin;
use recordings::{AdcSpec, MontageMap, Recording, VirtualAdc};

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
    /// Opens the input that the options name, and prints what is wrong with it. Prints how a recording fits
    /// the montage unless the options forbid it.
    pub(crate) fn new(options: &RunOptions) -> Result<Self, Box<dyn Error>> {
        match &options.input {
            Input::Synthetic => {
                let mut spec = SyntheticSpec::new(options.seed, model::LABELS.split(' '));
                spec.mains_hz = options.mains.hz().into();
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
        let mut recording = Recording::open(path)?;
        let electrodes: Vec<&str> = model::LABELS.split(' ').collect();
        let map = MontageMap::new(&recording.labels(), &electrodes, options.missing.into())?;
        if !options.quiet {
            eprintln!("{map}");
        }
        let recorded_edges = if options.trigger_every.is_none() {
            edges(&mut recording, options.quiet)?
        } else {
            RecordedEdges::default()
        };
        for warning in map.warnings() {
            eprintln!("warning: {warning}");
        }
        for warning in recording.warnings() {
            eprintln!("warning: {warning}");
        }
        let spec = AdcSpec {
            rate_hz: model::ADC_RATE_HZ.into(),
            lsb_uv: f64::from(model::LSB_NV) / 1_000.0,
        };
        let substitutes = Substitutes {
            interpolated: bits(&map, |origin| matches!(origin, Origin::Interpolated(_))),
            zero: bits(&map, |origin| matches!(origin, Origin::Zero)),
        };
        let adc = VirtualAdc::new(recording, &map, spec)?;
        Ok(Self {
            source: Source::Recording(Box::new(adc)),
            substitutes,
            recorded_edges,
        })
    }
}

/// Returns the trigger edges at the events of a recording.
fn edges(recording: &mut Recording, quiet: bool) -> Result<RecordedEdges, Box<dyn Error>> {
    let onsets = recording.onsets()?;
    let edges = RecordedEdges::new(&onsets);
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
    Ok(edges)
}

/// Returns a bit set of the electrodes whose origin is `wanted`.
fn bits(map: &MontageMap, wanted: impl Fn(&Origin) -> bool) -> u64 {
    let electrodes = (0..u64::BITS).zip(map.origins());
    let electrodes = electrodes.filter(|(_, origin)| wanted(origin));
    electrodes.fold(0, |bits, (electrode, _)| bits | 1 << electrode)
}
