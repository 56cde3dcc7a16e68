//! Figures of one node: intervals, latency and loss of its codes, processor time and memory.

use std::collections::BTreeMap;
use std::fs;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use anyhow::Context;
use picture::spread::Spread;
use serde::Serialize;

/// Device time from one code to the next, ms.
#[expect(clippy::cast_precision_loss, reason = "some steps")]
const HOP_MS: f64 = 1_000.0 * model::HOP as f64 / model::STEP_RATE_HZ as f64;

/// Time at which each code was sent or received, by the index of its window.
pub(super) type Times = BTreeMap<u64, Instant>;

/// [`Times`] that one thread notes while others read them.
#[derive(Debug, Clone, Default)]
pub(super) struct SharedTimes(Arc<Mutex<Times>>);

impl SharedTimes {
    /// Notes the time of a window's code, unless one has been noted already.
    pub(super) fn note(&self, window: u64, at: Instant) {
        self.locked().entry(window).or_insert(at);
    }

    /// Returns all times that have been noted so far.
    pub(super) fn so_far(&self) -> Times {
        self.locked().clone()
    }

    fn locked(&self) -> MutexGuard<'_, Times> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Figures of one node over a span of time. Times are from this PC's monotonic clock, in ms.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Figures {
    /// Number of codes that arrived from the node.
    pub(super) codes: u32,
    /// Number of codes that were sent to the node and did not arrive from it.
    pub(super) lost: u32,
    /// Standard deviation of the intervals at which codes were sent to the node, ms.
    sent_sd_ms: f64,
    pub(super) interval_mean_ms: f64,
    /// Standard deviation of the intervals between arrivals, ms.
    pub(super) interval_sd_ms: f64,
    interval_p99_ms: f64,
    interval_max_ms: f64,
    /// 99th percentile of |interval - [`HOP_MS`]| over the arrivals, ms.
    pub(super) deviation_p99_ms: f64,
    /// Largest number of successive codes with intervals below a quarter of a hop.
    pub(super) codes_per_burst: usize,
    /// Median time from the sending of a code to its arrival, ms.
    pub(super) latency_median_ms: f64,
    pub(super) latency_p99_ms: f64,
    /// Processor time of the node as a percentage of the time that passed.
    pub(super) cpu_percent: f64,
    /// Resident memory of the node at the end of the measurement, 10^6 bytes.
    pub(super) rss_mb: f64,
    #[serde(skip)]
    pub(super) intervals_ms: Vec<f64>,
    #[serde(skip)]
    pub(super) sent_intervals_ms: Vec<f64>,
}

impl Figures {
    /// Computes the figures from the codes that were sent between `start` and `end`.
    pub(super) fn new(
        sent: &Times,
        arrived: &Times,
        [start, end]: [Instant; 2],
        usage: &Usage,
    ) -> Self {
        let sent: Times = sent
            .iter()
            .filter(|(_, at)| (start..end).contains(at))
            .map(|(window, at)| (*window, *at))
            .collect();
        let arrived: Times =
            sent.keys().filter_map(|window| Some((*window, *arrived.get(window)?))).collect();
        let latencies =
            arrived.iter().map(|(window, at)| ms(at.saturating_duration_since(sent[window])));
        let latencies: Vec<f64> = latencies.collect();
        let (intervals_ms, sent_intervals_ms) = (intervals(&arrived), intervals(&sent));
        let deviations: Vec<f64> = intervals_ms.iter().map(|ms| (ms - HOP_MS).abs()).collect();
        let spread = Spread::from_values(&intervals_ms);
        let count = |times: &Times| u32::try_from(times.len()).unwrap_or(u32::MAX);
        Self {
            codes: count(&arrived),
            lost: count(&sent) - count(&arrived),
            sent_sd_ms: Spread::from_values(&sent_intervals_ms).sd,
            interval_mean_ms: spread.mean,
            interval_sd_ms: spread.sd,
            interval_p99_ms: quantile(&intervals_ms, 0.99),
            interval_max_ms: quantile(&intervals_ms, 1.0),
            deviation_p99_ms: quantile(&deviations, 0.99),
            codes_per_burst: longest_burst(&intervals_ms),
            latency_median_ms: quantile(&latencies, 0.5),
            latency_p99_ms: quantile(&latencies, 0.99),
            cpu_percent: 100.0 * usage.processor.as_secs_f64() / (end - start).as_secs_f64(),
            rss_mb: usage.resident_mb,
            intervals_ms,
            sent_intervals_ms,
        }
    }
}

/// Returns the largest number of successive codes with intervals below a quarter of a hop.
fn longest_burst(intervals_ms: &[f64]) -> usize {
    let bursts = intervals_ms.split(|ms| *ms >= HOP_MS / 4.0);
    bursts.map(|burst| burst.len() + 1).max().unwrap_or(1)
}

/// Returns the times between codes of successive windows, ms, leaving out lost codes.
fn intervals(times: &Times) -> Vec<f64> {
    let pairs = times.iter().zip(times.iter().skip(1));
    let pairs = pairs.filter(|((window, _), (next, _))| *window + 1 == **next);
    pairs.map(|((_, at), (_, next))| ms(next.saturating_duration_since(*at))).collect()
}

fn ms(duration: Duration) -> f64 {
    duration.as_secs_f64() * 1000.0
}

/// Returns the smallest value that at least the fraction `part` of all values does not exceed; NaN
/// without values.
fn quantile(values: &[f64], part: f64) -> f64 {
    let mut values = values.to_vec();
    values.sort_by(f64::total_cmp);
    let below = values.iter().enumerate().find(|(index, _)| {
        let count = |count: usize| f64::from(u32::try_from(count).unwrap_or(u32::MAX));
        count(index + 1) >= part * count(values.len())
    });
    below.map_or(f64::NAN, |(_, value)| *value)
}

/// Unit of the times in `/proc`, in ticks per second: 100 on every architecture of Linux.
const TICKS_PER_SECOND: u32 = 100;

/// Processor time and memory of a process.
#[derive(Debug, Clone, Copy)]
pub(super) struct Usage {
    /// Processor time of all threads, in user mode and in the kernel.
    pub(super) processor: Duration,
    /// Resident memory of the process, 10^6 bytes.
    pub(super) resident_mb: f64,
}

impl Usage {
    /// Reads the memory of the process `pid`, and its processor time since its start.
    ///
    /// # Errors
    /// The process has ended.
    pub(super) fn of(pid: u32) -> anyhow::Result<Self> {
        let read = |name| {
            let path = format!("/proc/{pid}/{name}");
            fs::read_to_string(&path).context(path)
        };
        Self::parse(&read("stat")?, &read("status")?).context("an unknown format of /proc")
    }

    /// Returns the processor time since `before`, and the current memory.
    pub(super) fn since(self, before: &Self) -> Self {
        Self { processor: self.processor.saturating_sub(before.processor), ..self }
    }

    fn parse(stat: &str, status: &str) -> Option<Self> {
        // Start after the second field, which is in parentheses and can contain any character.
        // `utime` and `stime` are fields 14 and 15.
        let fields = stat.rsplit_once(')')?.1.split_whitespace();
        let ticks = fields.skip(11).take(2).map(|field| field.parse::<u32>().ok());
        let ticks: u32 = ticks.sum::<Option<u32>>()?;
        let resident = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
        let kib: u32 = resident.trim().strip_suffix(" kB")?.trim().parse().ok()?;
        Some(Self {
            processor: Duration::from_secs(1) * ticks / TICKS_PER_SECOND,
            resident_mb: f64::from(kib) * 1024.0 / 1e6,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(start: Instant, ms: &[(u64, u64)]) -> Times {
        let at = |(window, ms): &(u64, u64)| (*window, start + Duration::from_millis(*ms));
        ms.iter().map(at).collect()
    }

    #[test]
    fn intervals_latency_and_loss_of_known_times() {
        let start = Instant::now();
        let sent = times(start, &[(0, 0), (1, 60), (2, 125), (3, 190), (4, 250), (5, 10_000)]);
        let arrived = times(start, &[(0, 5), (1, 61), (2, 128), (4, 254), (9, 260)]);
        let usage = Usage { processor: Duration::from_millis(100), resident_mb: 7.0 };
        let span = [start, start + Duration::from_secs(10)];
        let figures = Figures::new(&sent, &arrived, span, &usage);
        assert_eq!((figures.codes, figures.lost), (4, 1));
        let rounded = |values: &[f64]| values.iter().map(|x| x.round()).collect::<Vec<_>>();
        assert_eq!(rounded(&figures.intervals_ms), [56.0, 67.0]);
        assert_eq!(rounded(&figures.sent_intervals_ms), [60.0, 65.0, 65.0, 60.0]);
        for (figure, expected) in [
            (figures.interval_mean_ms, 61.5),
            (figures.interval_sd_ms, 5.5),
            (figures.interval_max_ms, 67.0),
            (figures.deviation_p99_ms, 6.5),
            (figures.latency_median_ms, 3.0),
            (figures.latency_p99_ms, 5.0),
            (figures.sent_sd_ms, 2.5),
            (figures.cpu_percent, 1.0),
            (figures.rss_mb, 7.0),
        ] {
            assert!((figure - expected).abs() < 1e-6, "{figure} is not {expected}");
        }
    }

    #[test]
    fn a_burst_has_one_code_more_than_intervals() {
        assert_eq!(longest_burst(&[62.0, 63.0]), 1);
        assert_eq!(longest_burst(&[62.0, 0.1, 0.2, 180.0, 0.1]), 3);
    }

    #[test]
    fn a_quantile_is_one_of_the_values() {
        let values: Vec<f64> = (1..=100).map(f64::from).collect();
        let quantiles = [0.0, 0.5, 0.99, 1.0].map(|part| quantile(&values, part).to_string());
        assert_eq!(quantiles, ["1", "50", "99", "100"]);
        assert!(quantile(&[], 0.5).is_nan());
    }

    #[test]
    fn a_name_with_spaces_and_parentheses_moves_no_field() {
        let stat = "7 (a) b (c) S 1 7 7 0 -1 4 5 6 7 8 250 50 0 0 20 0 3 0";
        let status = "Name:\ta\nVmHWM:\t 9000 kB\nVmRSS:\t    2000 kB\n";
        let usage = Usage::parse(stat, status).expect("both files are complete");
        assert_eq!(usage.processor, Duration::from_secs(3));
        assert!((usage.resident_mb - 2.048).abs() < 1e-9);
        assert!(Usage::parse("7 (a", status).is_none());
    }
}
