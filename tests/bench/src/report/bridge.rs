//! The benchmark `bridge`: how evenly and how soon codes reach a subscriber, through the bridge and through a
//! node in rospy that does the same work.
//!
//! ```text
//!                     ┌── TCP ── corticode-bridge ── TCPROS ──┐
//! host-sim ── relay ──┤                                       ├── subscribers
//!                     └── TCP ── rospy_bridge.py ─── TCPROS ──┘
//! ```
//!
//! The relay notes when it sends each code, and the subscribers when it arrives. The node in rospy gets its
//! codes half an interval later than the bridge, so that neither waits for the processor because of the other.

pub(super) mod node_figures;
mod part;
mod relay;
pub(super) mod rospy;
pub(super) mod setup;
pub(super) mod subscriber;
pub(super) mod usage;

use std::fs;

use anyhow::Context;
use serde_json::json;

use self::node_figures::Figures;
use self::part::Part;
use self::setup::{PROGRAMS, Programs, Setup};
use super::figures::Report;

/// Measures both nodes in two parts of `seconds` each: with subscribers of the codes alone, and with one of
/// the reconstructed signals too. Without rospy, the bridge is measured alone.
///
/// # Errors
/// A program is missing, does not start, or loses its connection.
pub(crate) fn measure(seconds: u32) -> anyhow::Result<Report> {
    let programs = Programs::find("bridge", &PROGRAMS)?;
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()?;
    let parts = runtime.block_on(run(&programs, seconds))?;
    let folder = programs.folder.with_file_name("bench");
    let picture = folder.join("bridge-intervals.svg");
    fs::create_dir_all(folder)
        .map_err(anyhow::Error::from)
        .and_then(|()| Ok(parts[0].intervals().draw(&picture)?))
        .with_context(|| format!("{} cannot be written", picture.display()))?;
    eprintln!("picture: {}", picture.display());
    report(&parts, seconds)
}

async fn run(programs: &Programs, seconds: u32) -> anyhow::Result<[Part; 2]> {
    let setup = Setup::start(programs, seconds).await?;
    let codes = setup.measure("codes", seconds).await?;
    let signals = setup.subscribe_to_signals().await?;
    let both = setup.measure("codes and signals", seconds).await?;
    drop(signals);
    Ok([codes, both])
}

/// Returns the report. A figure of the whole run is that of the worse part.
fn report(parts: &[Part], seconds: u32) -> anyhow::Result<Report> {
    let worst = |figure: &dyn Fn(&Figures) -> f64| {
        let figures = parts.iter().map(|part| figure(&part.bridge));
        figures.fold(f64::NAN, f64::max)
    };
    let worst_ratio = |figure: &dyn Fn(&Figures) -> f64| {
        let ratio = |part: &Part| Some(figure(&part.bridge) / figure(part.rospy.as_ref()?));
        let ratios: Option<Vec<f64>> = parts.iter().map(ratio).collect();
        ratios.map(|ratios| ratios.into_iter().fold(f64::NAN, f64::max))
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
        "nodes": parts.iter().flat_map(Part::nodes).collect::<Vec<_>>(),
    });
    let next =
        "end other programs and repeat; then compare host/bridge/src/app/bridge.rs with `git log`";
    Report::new("bridge", figures, next)
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use emulator::skip::skip_unless_required;

    use super::node_figures::Times;
    use super::rospy::Rospy;
    use super::usage::Usage;
    use super::*;

    /// Returns a node's figures if each code arrives `latency_ms` later than it was sent.
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
        let usage = Usage {
            processor: Duration::ZERO,
            resident_mb: 1.0,
        };
        let span = [start, start + Duration::from_mins(1)];
        Figures::new(&times, &arrived.collect(), span, &usage)
    }

    #[test]
    fn ratios_are_those_of_the_worse_part_and_null_without_rospy() {
        let part = |bridge: &[u64], rospy: Option<&[u64]>| Part {
            name: "codes",
            bridge: figures(bridge),
            rospy: rospy.map(figures),
        };
        let good = part(&[1, 2, 1, 2], Some(&[2, 4, 2, 4]));
        let bad = part(&[2, 4, 2, 4], Some(&[1, 2, 1, 2]));
        let report = report(&[good, bad], 60).expect("limits.toml");
        for name in ["interval_sd", "interval_p99", "latency", "latency_p99"] {
            let ratio = report.object[format!("{name}_ratio_rospy")].as_f64();
            assert!(
                ratio.is_some_and(|ratio| (ratio - 2.0).abs() < 1e-6),
                "{name}: {ratio:?}"
            );
        }
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
        let has_rospy = Rospy::find().is_some();
        if !has_rospy {
            skip_unless_required("rospy beside the bridge", "it is not installed".to_owned());
        }
        let report = measure(2).expect("both parts are measured");
        assert_eq!(report.faults(), [""; 0]);
        let nodes = report.object["nodes"].as_array().expect("a list");
        assert_eq!(nodes.len(), if has_rospy { 4 } else { 2 });
        for node in nodes {
            let codes = node["codes"].as_u64().expect("a number");
            // 32 on an idle machine.
            assert!((10..200).contains(&codes), "{node}");
            let latency = node["latency_median_ms"].as_f64().expect("a number");
            assert!(latency > 0.0, "{node}");
        }
    }
}
