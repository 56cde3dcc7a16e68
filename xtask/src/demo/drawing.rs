//! The demo's four pictures, from what was heard.

use std::path::Path;

use super::reference::Comparison;
use super::run::Run;
use crate::benchmark::{drawing, twin::Twin};
use crate::failure::Failure;
use crate::picture::heat_map::HeatMap;
use crate::picture::intervals::Intervals;
use crate::picture::traces::{Trace, Traces};

/// Electrodes in the picture, front to back.
const SHOWN: [&str; 7] = ["F3", "Fz", "F4", "C3", "Cz", "C4", "Pz"];
/// Seconds in the picture: single waves of 10 Hz stay visible.
const SHOWN_SECONDS: usize = 4;

/// Draws them into `folder`.
///
/// # Errors
/// The folder or a file cannot be written, or the artifact not read.
pub(crate) fn draw_all(run: &Run, comparison: &Comparison, folder: &Path) -> Result<(), Failure> {
    let cannot = |why: String| Failure::Check {
        what: "drawing the pictures".to_owned(),
        why,
        next: format!("is {} writable, and the disk not full?", folder.display()),
    };
    std::fs::create_dir_all(folder).map_err(|error| cannot(error.to_string()))?;
    let twin = Twin::of_the_model()?;
    let drawn = [
        traces(comparison).draw(&folder.join("traces.svg")),
        heat_map(run).draw(&folder.join("codes.svg")),
        intervals(run).draw(&folder.join("intervals.svg")),
        drawing::response(&twin).draw(&folder.join("filters.svg")),
    ];
    drawn
        .into_iter()
        .collect::<Result<(), _>>()
        .map_err(|error| cannot(error.to_string()))
}

fn traces(comparison: &Comparison) -> Traces {
    let rate = usize::from(model::STEP_RATE_HZ);
    let steps = comparison.source_uv.len();
    let begin = steps.saturating_sub(SHOWN_SECONDS * rate);
    let labels: Vec<&str> = model::LABELS.split(' ').collect();
    let shown = SHOWN.iter().filter_map(|label| {
        let electrode = labels.iter().position(|other| other == label)?;
        let part = |uv: &[[f32; pipeline::ELECTRODES]]| {
            uv[begin..].iter().map(|step| step[electrode]).collect()
        };
        Some(Trace {
            label: (*label).to_owned(),
            source_uv: part(&comparison.source_uv),
            result_uv: part(&comparison.result_uv),
        })
    });
    Traces {
        rows: shown.collect(),
        rate_hz: f64::from(model::STEP_RATE_HZ),
        begin_s: seconds(comparison.first_step + begin),
        subtitle: format!(
            "{} of {} electrodes of synthetic EEG; the model was trained on a recording. PRD {:.1} % over {:.0} s",
            SHOWN.len(),
            labels.len(),
            comparison.prd_percent,
            seconds(steps)
        ),
    }
}

fn heat_map(run: &Run) -> HeatMap {
    let first = run.codes.first().map_or(0, super::run::Heard::window);
    let codes = run
        .codes
        .iter()
        .map(|heard| (!heard.is_filler()).then(|| heard.frame.eeg.data.clone()));
    HeatMap {
        codes: codes.collect(),
        begin_s: seconds(usize::try_from(first).unwrap_or(0) * model::HOP),
        interval_s: seconds(model::HOP),
        settling: run
            .codes
            .iter()
            .take_while(|heard| heard.is_settling())
            .count(),
        subtitle: format!(
            "{} codes received from /encoded, {} lost; each component around its own mean",
            run.received(),
            run.lost()
        ),
    }
}

fn intervals(run: &Run) -> Intervals {
    Intervals {
        arrival_ms: run.arrival_intervals_ms(),
        device_ms: run.device_intervals_ms(),
        subtitle: format!(
            "{} codes through PTY, bridge and TCPROS, all on this machine; the stamps are the device's own clock",
            run.received()
        ),
    }
}

/// Time of a step at 128 Hz, s.
fn seconds(steps: usize) -> f64 {
    f64::from(u32::try_from(steps).unwrap_or(u32::MAX)) / f64::from(model::STEP_RATE_HZ)
}
