//! Draws the demo's four pictures from a run.

use std::error::Error;
use std::path::Path;

use artifact::Artifact;
use link::Flags;
use picture::heat_map::HeatMap;
use picture::intervals::{Intervals, Series};
use picture::traces::{Trace, Traces};

use crate::Failure;
use crate::comparison::{Comparison, seconds};
use crate::response::{Response, Twin};
use crate::run::{Received, Run};

/// Largest number of electrodes in the picture of traces.
const SHOWN: usize = 7;
/// Folder of the model with which the demo was built.
pub(crate) const MODEL: &str = match option_env!("CORTICODE_ARTIFACT") {
    Some(folder) => folder,
    None => concat!(env!("CARGO_MANIFEST_DIR"), "/../../signal/model/artifact"),
};
/// Length of the picture of traces, seconds: short enough to show single waves of 10 Hz.
const SHOWN_SECONDS: usize = 4;

/// Draws all four pictures into `folder`.
///
/// # Errors
/// The folder or a file cannot be written, or the model's artifact cannot be read.
pub(crate) fn draw_all(run: &Run, comparison: &Comparison, folder: &Path) -> Result<(), Failure> {
    let draw = || -> Result<(), Box<dyn Error>> {
        let artifact = Artifact::read(Path::new(MODEL))?;
        let twin = Twin::new(&artifact.description.filters);
        std::fs::create_dir_all(folder)?;
        traces(comparison).draw(&folder.join("traces.svg"))?;
        heat_map(run).draw(&folder.join("codes.svg"))?;
        intervals(run).draw(&folder.join("intervals.svg"))?;
        let response = Response::measure(&twin).magnitude();
        Ok(response.draw(&folder.join("filters.svg"))?)
    };
    draw().map_err(|error| {
        let next = format!(
            "is target/demo/ writable, the disk not full, and {MODEL} the model of the build?"
        );
        Failure::check("drawing the pictures", error, &next)
    })
}

fn traces(comparison: &Comparison) -> Traces {
    let rate = usize::from(model::STEP_RATE_HZ);
    let steps = comparison.source_uv.len();
    let start = steps.saturating_sub(SHOWN_SECONDS * rate);
    let labels: Vec<&str> = model::LABELS.split(' ').collect();
    let rows = shown(labels.len()).into_iter().map(|electrode| {
        let part = |uv: &[[f32; pipeline::ELECTRODES]]| {
            uv[start..].iter().map(|step| step[electrode]).collect()
        };
        Trace {
            label: labels[electrode].to_owned(),
            source_uv: part(&comparison.source_uv),
            result_uv: part(&comparison.result_uv),
        }
    });
    let rows: Vec<Trace> = rows.collect();
    let [count, all] = [rows.len(), labels.len()];
    Traces {
        rows,
        rate_hz: f64::from(model::STEP_RATE_HZ),
        start_s: seconds(comparison.first_step + start),
        since: "the device's start".to_owned(),
        result: format!(
            "decoded from {} numbers per {} ms",
            model::CODE,
            1_000.0 * seconds(model::HOP)
        ),
        subtitle: format!(
            "{count} of {all} electrodes of synthetic EEG; the model was trained on recordings. {comparison}"
        ),
    }
}

/// Returns the indices of up to [`SHOWN`] of `count` electrodes, evenly spread over the model's
/// order, which is front to back.
fn shown(count: usize) -> Vec<usize> {
    let last = SHOWN.min(count).saturating_sub(1);
    let index = |row: usize| row * count.saturating_sub(1) / last.max(1);
    (0..=last).map(index).collect()
}

fn heat_map(run: &Run) -> HeatMap {
    let first = run.codes.first().map_or(0, Received::window);
    let codes = run.codes.iter();
    let settling = codes.clone().take_while(|code| code.has(Flags::SETTLING));
    let values = |code: &Received| {
        let is_lost = code.has(Flags::FILLER);
        (!is_lost).then(|| code.frame.eeg.data.clone())
    };
    let [received, lost] = [run.received(), run.lost()];
    HeatMap {
        settling: settling.count(),
        codes: codes.map(values).collect(),
        start_s: seconds(first * model::HOP),
        interval_s: seconds(model::HOP),
        subtitle: format!(
            "{received} codes received from /encoded, {lost} lost; each component around its own mean"
        ),
    }
}

fn intervals(run: &Run) -> Intervals {
    Intervals {
        arrival: Series {
            name: "arrival at the subscriber".to_owned(),
            ms: run.arrival_intervals_ms(),
        },
        source: Series { name: "device stamps".to_owned(), ms: run.device_intervals_ms() },
        rival: None,
        subtitle: format!(
            "{} codes through PTY, bridge and TCPROS, all on this machine; the stamps are the device's own clock",
            run.received()
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shown_electrodes_are_spread_over_the_labels_of_any_model() {
        assert_eq!(shown(61), [0, 10, 20, 30, 40, 50, 60]);
        assert_eq!(shown(8), [0, 1, 2, 3, 4, 5, 7]);
        assert_eq!(shown(4), [0, 1, 2, 3]);
    }
}
