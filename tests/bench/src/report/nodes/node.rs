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
//! The node in rospy gets its frames half an interval later, so that neither waits for the
//! processor because of the other. Where scipy and PyTorch are installed, it filters and encodes as
//! the paper's node does; otherwise it encodes nothing, and its times are those of rospy alone.

use std::time::{Duration, Instant};

use anyhow::ensure;
use neuro_ros::{NeuroFrame, RosMessage};
use ros1::{Node, Publisher, PublisherOptions};
use serde_json::json;
use tokio::time::sleep;

use super::amplifier::{Amplifier, FIRST};
use super::subscriber::Subscriber;
use super::{Nodes, Pair, Programs, Ros, START};
use crate::report::checked_in;
use crate::report::figures::Report;
use crate::report::programs::{self, Python};

/// Name of the program that is measured.
const NODE: &str = "corticode-node";
/// Topics of `corticode-node` and of the node in rospy: that of the frames, then that of the codes.
const TOPICS: [[&str; 2]; 2] = [
    ["/neurodata", "/encoded"],
    ["/rospy/neurodata", "/rospy/encoded"],
];

/// Measures both nodes for `seconds`. Without rospy, only `corticode-node` is measured.
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
    let torch = find_rospy_with_torch();
    let pair = super::block_on(run(&programs, torch, seconds))?;
    let rival = rival_name(torch.is_some());
    let names = ["through corticode-node", "frames sent to it", rival];
    programs.draw("node", &pair.intervals(names, "of another acquisition"))?;
    report(&pair, torch.is_some(), seconds)
}

/// Finds a Python interpreter that can import rospy, scipy and PyTorch.
fn find_rospy_with_torch() -> Option<Python> {
    let next = "`/usr/bin/python3 -m venv --system-site-packages torch-venv && torch-venv/bin/pip install torch \
                scipy`, then again with torch-venv/bin first in PATH";
    Python::find("rospy, scipy, torch", next)
}

/// Starts both nodes and the amplifier that sends them frames, and returns the nodes' figures.
async fn run(programs: &Programs, torch: Option<Python>, seconds: u32) -> anyhow::Result<Pair> {
    let ros = Ros::start().await?;
    let codes = [
        Subscriber::start(&ros.node, TOPICS[0][1]).await?,
        Subscriber::start(&ros.node, TOPICS[1][1]).await?,
    ];
    let publishers = [
        advertise(&ros.node, TOPICS[0][0]).await?,
        advertise(&ros.node, TOPICS[1][0]).await?,
    ];
    let own = ros.start_program(programs, NODE, &["--ros-master-uri", ros.master.uri()])?;
    let first = FIRST.to_string();
    let [length, rate] = super::code_arguments();
    let mut arguments = vec![TOPICS[1][0], TOPICS[1][1], &first, &length, &rate];
    let model = programs::model(&checked_in::artifact()?.description).to_string();
    if torch.is_some() {
        arguments.push(&model);
    }
    let python = torch.or_else(super::find_rospy);
    let rospy = python.map(|python| ros.start_script(python, "rospy_node.py", &arguments));
    let rospy = rospy.transpose()?;
    let nodes = Nodes { own, rospy, codes };
    wait_for_subscribers(&publishers[..nodes.measured_codes().len()]).await?;
    let amplifier = Amplifier::start(publishers);
    nodes.wait_for_codes().await?;
    nodes.measure(seconds, || amplifier.times()).await
}

async fn advertise(node: &Node, topic: &str) -> anyhow::Result<Publisher> {
    let options = PublisherOptions {
        queue: 64,
        latch: false,
    };
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

/// Returns the name of the node in rospy in reports; it tells whether the node `encodes`.
fn rival_name(encodes: bool) -> &'static str {
    if encodes {
        "through rospy, scipy and PyTorch"
    } else {
        "through rospy, nothing encoded"
    }
}

fn report(pair: &Pair, rospy_encodes: bool, seconds: u32) -> anyhow::Result<Report> {
    let node = &pair.own;
    let figures = json!({
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
        let report = measure(2).expect("both nodes are measured");
        super::super::assert_two_seconds(&report, 1..=2);
    }
}
