//! The benchmark `bridge`: how evenly and how soon codes reach a subscriber, through the bridge and
//! through a node in rospy that does the same work.
//!
//! ```text
//!                     ┌── TCP ── corticode-bridge ── TCPROS ──┐
//! host-sim ── relay ──┤                                       ├── subscribers
//!                     └── TCP ── rospy_bridge.py ─── TCPROS ──┘
//! ```
//!
//! The relay records when it sends each code, and the subscribers record when it arrives. The node
//! in rospy gets its codes half an interval later than the bridge, so that the two do not compete
//! for the processor.

use std::fs;
use std::net::TcpListener;
use std::time::Duration;

use anyhow::Context;
use serde_json::{Value as Json, json};

use super::figures::Figures;
use super::relay::Relay;
use super::subscriber::Subscriber;
use super::{ANY_PORT, Nodes, Pair, Programs, Ros, START, WARM_UP};
use crate::report::figures::Report;

const BOARD: &str = "host-sim";
const BRIDGE: &str = "corticode-bridge";
/// Names of the programs that the benchmark starts.
const PROGRAMS: [&str; 2] = [BOARD, BRIDGE];
/// Topic on which the node in rospy publishes codes.
const ROSPY_TOPIC: &str = "/rospy/encoded";

/// Name of a part of the measurement, and the figures of both nodes in it.
type Part = (&'static str, Pair);

/// Measures both nodes in two parts of `seconds` each: first with subscribers to the codes alone,
/// then with a subscriber to the reconstructed signals too. Without rospy, measures only the
/// bridge.
///
/// # Errors
/// A program is missing, does not start, or loses its connection.
pub(crate) fn measure(seconds: u32) -> anyhow::Result<Report> {
    let programs = Programs::find("bridge", &PROGRAMS)?;
    let parts = super::block_on(run(&programs, seconds))?;
    let names = ["through the bridge", "sent to the bridge", "through rospy"];
    programs.draw("bridge", &parts[0].1.intervals(names, "from host-sim"))?;
    report(&parts, seconds)
}

/// Starts all programs and returns the figures of both parts.
async fn run(programs: &Programs, seconds: u32) -> anyhow::Result<[Part; 2]> {
    let ros = Ros::start().await?;
    let codes = [
        Subscriber::start(&ros.node, "/encoded").await?,
        Subscriber::start(&ros.node, ROSPY_TOPIC).await?,
    ];
    let to_bridge = TcpListener::bind(ANY_PORT)?;
    let port = format!("tcp:{}", to_bridge.local_addr()?);
    let arguments = ["--port", &port, "--ros-master-uri", ros.master.uri()];
    let own = ros.start_program(programs, BRIDGE, &arguments)?;
    let to_rospy = TcpListener::bind(ANY_PORT)?;
    let port = to_rospy.local_addr()?.port().to_string();
    let [length, rate] = super::code_arguments();
    let arguments = [&*port, ROSPY_TOPIC, &length, &rate];
    let rospy = super::find_rospy();
    let rospy = rospy.map(|python| ros.start_script(python, "rospy_bridge.py", &arguments));
    let rospy = rospy.transpose()?;
    // Find a free port: dropping the listener frees it again, and host-sim then takes it.
    let port = TcpListener::bind(ANY_PORT)?.local_addr()?.port();
    let signal = Duration::from_secs(2 * u64::from(seconds)) + START + 3 * WARM_UP;
    let duration = format!("--duration={}", signal.as_secs());
    let output = format!("--output=tcp:127.0.0.1:{port}");
    let arguments = ["run", "--input=synthetic", "--realtime", &duration, &output];
    let _board = ros.start_program(programs, BOARD, &arguments)?;
    // Connect in another thread, because the ROS master must reply on this thread meanwhile.
    let has_rospy = rospy.is_some();
    let relay = tokio::task::spawn_blocking(move || {
        Relay::start(port, &to_bridge, has_rospy.then_some(&to_rospy))
    });
    let log = || {
        let log = fs::read_to_string(ros.log(BRIDGE));
        format!("{BRIDGE} printed:\n{}", log.unwrap_or_default())
    };
    let relay = relay.await?.with_context(log)?;
    let nodes = Nodes { own, rospy, codes };
    nodes.wait_for_codes().await?;
    eprintln!("measuring codes for {seconds} s");
    let codes = nodes.measure(seconds, || relay.times()).await?;
    let signals = Subscriber::start(&ros.node, "/neurodata_reconstructed").await?;
    signals.wait_for_code(START).await?;
    eprintln!("measuring codes and signals for {seconds} s");
    let both = nodes.measure(seconds, || relay.times()).await?;
    Ok([("codes", codes), ("codes and signals", both)])
}

/// Builds the report. A figure of the whole run is the worse figure of its two parts.
fn report(parts: &[Part], seconds: u32) -> anyhow::Result<Report> {
    let worst = |figure: &dyn Fn(&Figures) -> f64| {
        let figures = parts.iter().map(|(_, pair)| figure(&pair.own));
        figures.fold(f64::NAN, f64::max)
    };
    let worst_ratio = |figure: &dyn Fn(&Figures) -> f64| {
        let ratios: Option<Vec<f64>> = parts.iter().map(|(_, pair)| pair.ratio(figure)).collect();
        ratios.map(|ratios| ratios.into_iter().fold(f64::NAN, f64::max))
    };
    let nodes = |(name, pair): &Part| -> Vec<Json> {
        let names = ["bridge", "rospy"].map(|node| format!("{node}: {name}"));
        pair.objects([&names[0], &names[1]])
    };
    let figures = json!({
        "interval_sd_ratio_rospy": worst_ratio(&|node| node.interval_sd_ms),
        "interval_p99_ratio_rospy": worst_ratio(&|node| node.deviation_p99_ms),
        "latency_ratio_rospy": worst_ratio(&|node| node.latency_median_ms),
        "latency_p99_ratio_rospy": worst_ratio(&|node| node.latency_p99_ms),
        "cpu_percent": worst(&|node| node.cpu_percent),
        "rss_mb": worst(&|node| node.rss_mb),
        "codes_lost": worst(&|node| f64::from(node.lost)),
        "seconds": seconds,
        "nodes": parts.iter().flat_map(nodes).collect::<Vec<_>>(),
    });
    let next =
        "end other programs and repeat; then compare host/bridge/src/app/bridge.rs with `git log`";
    Report::new("bridge", figures, next)
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use emulator::skip::skip_unless_required;

    use super::super::figures::{Times, Usage};
    use super::*;

    /// Returns the figures of a node whose code i arrives `latency_ms[i]` after it was sent.
    fn figures(latency_ms: &[u64]) -> Figures {
        let start = Instant::now();
        let sent = |window: u64| {
            start
                + Duration::from_micros(
                    1_000_000 * model::HOP as u64 / u64::from(model::STEP_RATE_HZ) * window,
                )
        };
        let windows = 0..latency_ms.len() as u64;
        let times: Times = windows.map(|window| (window, sent(window))).collect();
        let arrived = times.iter().zip(latency_ms);
        let arrived = arrived.map(|((window, at), ms)| (*window, *at + Duration::from_millis(*ms)));
        let usage = Usage { processor: Duration::ZERO, resident_mb: 1.0 };
        let span = [start, start + Duration::from_mins(1)];
        Figures::new(&times, &arrived.collect(), span, &usage)
    }

    #[test]
    fn ratios_are_those_of_the_worse_part_and_null_without_rospy() {
        let part = |bridge: &[u64], rospy: Option<&[u64]>| {
            let pair = Pair { own: figures(bridge), rospy: rospy.map(figures) };
            ("codes", pair)
        };
        let good = part(&[1, 2, 1, 2], Some(&[2, 4, 2, 4]));
        let bad = part(&[2, 4, 2, 4], Some(&[1, 2, 1, 2]));
        let report = report(&[good, bad], 60).expect("limits.toml");
        for name in ["interval_sd", "interval_p99", "latency", "latency_p99"] {
            let ratio = report.object[format!("{name}_ratio_rospy")].as_f64();
            assert!(ratio.is_some_and(|ratio| (ratio - 2.0).abs() < 1e-6), "{name}: {ratio:?}");
        }
        assert_eq!(report.object["nodes"][1]["name"], "rospy: codes");
        let alone = part(&[1, 2, 1, 2], None);
        let report = super::report(&[alone], 60).expect("limits.toml");
        assert!(report.object["interval_sd_ratio_rospy"].is_null());
        assert_eq!(report.object["nodes"].as_array().map(Vec::len), Some(1));
    }

    #[test]
    fn two_seconds_beside_rospy_lose_no_code() {
        if let Err(error) = Programs::find("bridge", &PROGRAMS) {
            skip_unless_required("the benchmark of the bridge", error.to_string());
            return;
        }
        let has_rospy = super::super::find_rospy().is_some();
        if !has_rospy {
            skip_unless_required("rospy beside the bridge", "it is not installed".to_owned());
        }
        let nodes = if has_rospy { 4 } else { 2 };
        let report = measure(2).expect("both parts are measured");
        super::super::assert_two_seconds(&report, nodes..=nodes);
    }
}
