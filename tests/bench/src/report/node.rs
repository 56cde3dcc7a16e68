//! The benchmark `node`: how evenly and how soon codes reach a subscriber through `corticode-node`, and through
//! a node in rospy that subscribes to the same frames and publishes messages of the same shape.
//!
//! ```text
//!                  ┌── /neurodata ─────── corticode-node ──── /encoded ───────┐
//! this program ────┤                                                          ├── this program
//!                  └── /rospy/neurodata ── rospy_node.py ─── /rospy/encoded ──┘
//! ```
//!
//! The node in rospy gets its frames half an interval later, so that neither waits for the processor because of
//! the other. Where scipy and PyTorch are installed, it filters and encodes as the paper's node does; otherwise it
//! encodes nothing, and its times are those of rospy alone.

mod amplifier;
mod setup;

use std::fs;

use anyhow::{Context, ensure};
use picture::intervals::{Intervals, Series};
use serde_json::json;

use self::setup::{NODE, Pair, Setup};
use super::bridge::setup::Programs;
use super::figures::Report;

/// Measures both nodes for `seconds`. Without rospy, `corticode-node` is measured alone.
///
/// # Errors
/// A program is missing, does not start, or loses its connection.
pub(crate) fn measure(seconds: u32) -> anyhow::Result<Report> {
    ensure!(
        model::ADC_RATE_HZ.is_multiple_of(model::STEP_RATE_HZ),
        "a hop of this model is no whole number of samples at {} Hz, which the frames of this benchmark hold\n  \
         next: measure a model whose ADC has a multiple of {} Hz",
        model::ADC_RATE_HZ,
        model::STEP_RATE_HZ
    );
    let programs = Programs::find("node", &[NODE])?;
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()?;
    let pair = runtime.block_on(async {
        let setup = Setup::start(&programs).await?;
        setup.measure(seconds).await
    })?;
    let folder = programs.folder.with_file_name("bench");
    let picture = folder.join("node-intervals.svg");
    fs::create_dir_all(folder)
        .map_err(anyhow::Error::from)
        .and_then(|()| Ok(intervals(&pair).draw(&picture)?))
        .with_context(|| format!("{} cannot be written", picture.display()))?;
    eprintln!("picture: {}", picture.display());
    report(&pair, seconds)
}

/// Returns the histogram of the intervals of both nodes.
fn intervals(pair: &Pair) -> Intervals {
    let series = |name: &str, ms: &[f64]| Series {
        name: name.to_owned(),
        ms: ms.to_owned(),
    };
    let rospy = pair.rospy.as_ref();
    Intervals {
        arrival: series("through corticode-node", &pair.node.intervals_ms),
        source: series("frames sent to it", &pair.node.sent_intervals_ms),
        rival: rospy.map(|rospy| series(rival_name(pair), &rospy.intervals_ms)),
        subtitle: format!(
            "{} codes of another acquisition to a subscriber, all on this machine",
            pair.node.codes
        ),
    }
}

/// Returns the name of the node in rospy.
fn rival_name(pair: &Pair) -> &'static str {
    if pair.rospy_encodes {
        "through rospy, scipy and PyTorch"
    } else {
        "through rospy, nothing encoded"
    }
}

fn report(pair: &Pair, seconds: u32) -> anyhow::Result<Report> {
    let Pair { node, rospy, .. } = pair;
    let ratio = |own: f64, other: Option<f64>| other.map(|other| own / other);
    let rival = rospy.as_ref();
    let mut nodes = vec![json!(node)];
    nodes[0]["name"] = "corticode-node".into();
    if let Some(rospy) = rospy {
        let mut object = json!(rospy);
        object["name"] = rival_name(pair).into();
        nodes.push(object);
    }
    let figures = json!({
        "interval_mean_ms": node.interval_mean_ms,
        "interval_sd_ms": node.interval_sd_ms,
        "interval_sd_ratio_rospy": ratio(node.interval_sd_ms, rival.map(|r| r.interval_sd_ms)),
        "latency_ratio_rospy": ratio(node.latency_median_ms, rival.map(|r| r.latency_median_ms)),
        "codes_lost": node.lost,
        "seconds": seconds,
        "rospy_encodes": pair.rospy_encodes,
        "nodes": nodes,
    });
    let next = "end other programs and repeat; then compare host/node/src/feed.rs with `git log`";
    Report::new("node", figures, next)
}

#[cfg(test)]
mod tests {
    use emulator::skip::skip_unless_required;

    use super::*;

    #[test]
    fn two_seconds_of_frames_lose_no_code_and_arrive_at_the_rate_of_codes() {
        if let Err(error) = Programs::find("node", &[NODE]) {
            skip_unless_required("the benchmark of the node", error.to_string());
            return;
        }
        let report = measure(2).expect("both nodes are measured");
        assert_eq!(report.faults(), [""; 0]);
        let nodes = report.object["nodes"].as_array().expect("a list");
        assert!((1..=2).contains(&nodes.len()));
        for node in nodes {
            let codes = node["codes"].as_u64().expect("a number");
            // 32 on an idle machine.
            assert!((10..200).contains(&codes), "{node}");
            let latency = node["latency_median_ms"].as_f64().expect("a number");
            assert!(latency > 0.0, "{node}");
        }
    }
}
