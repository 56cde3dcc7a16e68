//! The benchmark `node`: how evenly and how soon codes reach a subscriber through `corticode-node`,
//! and through a node in rospy that subscribes to the same frames and publishes messages of the
//! same shape.
//!
//! ```text
//!                  ┌── /neurodata ─────── corticode-node ──── /encoded ───────┐
//! this program ────┤                                                          ├── this program
//!                  └── /rospy/neurodata ── rospy_node.py ─── /rospy/encoded ──┘
//! ```
//!
//! The node in rospy gets its frames half an interval later, so that the two nodes do not compete
//! for the processor. At the rate of the model's ADC, and where scipy and PyTorch are installed, it
//! filters and encodes as the paper's node does. Otherwise it encodes nothing, and its times are
//! the times of rospy alone. Latency counts from the frame that has the last step of a code's
//! window.

use std::time::{Duration, Instant};

use anyhow::{Context, ensure};
use neuro_ros::{NeuroFrame, RosMessage};
use ros1::{Node, Publisher, PublisherOptions};
use serde_json::json;
use tokio::time::sleep;

use super::amplifier::{Amplifier, Frames};
use super::subscriber::Subscriber;
use super::{Nodes, Pair, Programs, Ros, START};
use crate::report::checked_in;
use crate::report::figures::Report;
use crate::report::programs::{self, Python};

/// Name of the program that is measured.
const NODE: &str = "corticode-node";
/// Topics of the frames and of the codes, first for `corticode-node`, then for the node in rospy.
const TOPICS: [[&str; 2]; 2] = [["/neurodata", "/encoded"], ["/rospy/neurodata", "/rospy/encoded"]];

/// Measures both nodes for `seconds`, with frames at the rate `rate_hz`, by default that of the
/// model's ADC. Without rospy, measures only `corticode-node`.
///
/// # Errors
/// A program is missing, does not start, or loses its connection.
pub(crate) fn measure(rate_hz: Option<u16>, seconds: u32) -> anyhow::Result<Report> {
    let rate_hz = rate_hz.unwrap_or(model::ADC_RATE_HZ);
    let frames = Frames::new(rate_hz).with_context(|| {
        format!("neither 1/64 s nor 20 ms is a whole number of samples at {rate_hz} Hz\n  next: --rate=500")
    })?;
    let programs = Programs::find("node", &[NODE])?;
    let torch = (rate_hz == model::ADC_RATE_HZ).then(find_rospy_with_torch).flatten();
    let pair = super::block_on(run(&programs, frames, torch, seconds))?;
    let rival = rival_name(torch.is_some());
    let names = ["through corticode-node", "frames sent to it", rival];
    programs.draw("node", &pair.intervals(names, "of another acquisition"))?;
    report(&pair, rate_hz, torch.is_some(), seconds)
}

/// Finds a Python interpreter that can import rospy, scipy and PyTorch.
fn find_rospy_with_torch() -> Option<Python> {
    let next = "`/usr/bin/python3 -m venv --system-site-packages torch-venv && torch-venv/bin/pip install torch \
                scipy`, then again with torch-venv/bin first in PATH";
    Python::find("rospy, scipy, torch", next)
}

/// Starts both nodes and the amplifier, and returns the nodes' figures.
async fn run(
    programs: &Programs,
    frames: Frames,
    torch: Option<Python>,
    seconds: u32,
) -> anyhow::Result<Pair> {
    let ros = Ros::start().await?;
    let codes = [
        Subscriber::start(&ros.node, TOPICS[0][1]).await?,
        Subscriber::start(&ros.node, TOPICS[1][1]).await?,
    ];
    let publishers =
        [advertise(&ros.node, TOPICS[0][0]).await?, advertise(&ros.node, TOPICS[1][0]).await?];
    let own = ros.start_program(programs, NODE, &["--ros-master-uri", ros.master.uri()])?;
    let [length, rate] = super::code_arguments();
    let windows = frames.windows().map(|number| number.to_string());
    let mut arguments = vec![TOPICS[1][0], TOPICS[1][1], &length, &rate];
    arguments.extend(windows.iter().map(String::as_str));
    let model = programs::model(&checked_in::artifact()?.description).to_string();
    if torch.is_some() {
        arguments.push(&model);
    }
    let python = torch.or_else(super::find_rospy);
    let rospy = python.map(|python| ros.start_script(python, "rospy_node.py", &arguments));
    let rospy = rospy.transpose()?;
    let nodes = Nodes { own, rospy, codes };
    wait_for_subscribers(&publishers[..nodes.measured_codes().len()]).await?;
    let amplifier = Amplifier::start(frames, publishers);
    nodes.wait_for_codes().await?;
    nodes.measure(seconds, || amplifier.times()).await
}

async fn advertise(node: &Node, topic: &str) -> anyhow::Result<Publisher> {
    let options = PublisherOptions { queue: 64, latch: false };
    Ok(node.advertise(topic, NeuroFrame::TYPE, options).await?)
}

async fn wait_for_subscribers(publishers: &[Publisher]) -> anyhow::Result<()> {
    let deadline = Instant::now() + START;
    while publishers.iter().any(|each| each.subscribers() == 0) {
        ensure!(
            Instant::now() < deadline,
            "a node does not subscribe within {} s\n  next: is the machine very busy? repeat",
            START.as_secs()
        );
        sleep(Duration::from_millis(20)).await;
    }
    Ok(())
}

/// Returns the name of the node in rospy for reports. The name states whether the node `encodes`.
fn rival_name(encodes: bool) -> &'static str {
    if encodes { "through rospy, scipy and PyTorch" } else { "through rospy, nothing encoded" }
}

fn report(pair: &Pair, rate_hz: u16, rospy_encodes: bool, seconds: u32) -> anyhow::Result<Report> {
    let node = &pair.own;
    let figures = json!({
        "rate_hz": rate_hz,
        "latency_median_ms": node.latency_median_ms,
        "latency_p99_ms": node.latency_p99_ms,
        "codes_per_burst": node.codes_per_burst,
        "interval_mean_ms": node.interval_mean_ms,
        "interval_sd_ms": node.interval_sd_ms,
        "interval_sd_ratio_rospy": pair.ratio(&|node| node.interval_sd_ms),
        "latency_ratio_rospy": pair.ratio(&|node| node.latency_median_ms),
        "codes_lost": node.lost,
        "seconds": seconds,
        "rospy_encodes": rospy_encodes,
        "nodes": pair.objects([NODE, rival_name(rospy_encodes)]),
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
        let report = measure(None, 2).expect("both nodes are measured");
        super::super::assert_two_seconds(&report, 1..=2);
    }
}
