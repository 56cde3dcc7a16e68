//! The demo's four pictures, drawn from a run.

use std::error::Error;
use std::path::Path;

use artifact::Artifact;
use bench::response::{Response, Twin};
use link::Flags;
use picture::heat_map::HeatMap;
use picture::intervals::{Intervals, Series};
use picture::traces::{Trace, Traces};

use crate::comparison::Comparison;
use crate::failure::Failure;
use crate::run::{Received, Run};

/// Electrodes in the picture of traces, front to back.
const SHOWN: [&str; 7] = ["F3", "Fz", "F4", "C3", "Cz", "C4", "Pz"];
/// Folder of the model with which the demo was built.
const MODEL: &str = match option_env!("CORTICODE_ARTIFACT") {
    Some(folder) => folder,
    None => concat!(env!("CARGO_MANIFEST_DIR"), "/../model/artifact"),
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
    let shown = SHOWN.iter().filter_map(|label| {
        let electrode = labels.iter().position(|other| other == label)?;
        let part = |uv: &[[f32; pipeline::ELECTRODES]]| {
            uv[start..].iter().map(|step| step[electrode]).collect()
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
        start_s: seconds(comparison.first_step + start),
        since: "the device's start".to_owned(),
        result: format!(
            "decoded from {} numbers per {} ms",
            model::CODE,
            1_000.0 * seconds(model::HOP)
        ),
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
        source: Series {
            name: "device stamps".to_owned(),
            ms: run.device_intervals_ms(),
        },
        rival: None,
        subtitle: format!(
            "{} codes through PTY, bridge and TCPROS, all on this machine; the stamps are the device's own clock",
            run.received()
        ),
    }
}

/// Returns the duration of `steps` steps at 128 Hz, seconds.
fn seconds(steps: usize) -> f64 {
    f64::from(u32::try_from(steps).unwrap_or(u32::MAX)) / f64::from(model::STEP_RATE_HZ)
}
