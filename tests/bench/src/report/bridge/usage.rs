//! Processor time and memory of a process, from `/proc`.

use std::fs;
use std::time::Duration;

use anyhow::Context;

/// Clock ticks per second of the times in `/proc`. Linux reports this value on every architecture.
const TICKS_PER_SECOND: u32 = 100;

/// Processor time and memory of a process.
#[derive(Debug, Clone, Copy)]
pub(in crate::report) struct Usage {
    /// Time in user mode and in the kernel, of all threads.
    pub(in crate::report) processor: Duration,
    /// Resident memory, 10^6 bytes.
    pub(in crate::report) resident_mb: f64,
}

impl Usage {
    /// Reads the usage of the process `pid` since its start.
    ///
    /// # Errors
    /// The process has ended.
    pub(in crate::report) fn of(pid: u32) -> anyhow::Result<Self> {
        let read = |name| {
            let path = format!("/proc/{pid}/{name}");
            fs::read_to_string(&path).context(path)
        };
        Self::parse(&read("stat")?, &read("status")?).context("an unknown format of /proc")
    }

    /// Returns the usage since `before`; the memory is that at the end.
    pub(in crate::report) fn since(self, before: &Self) -> Self {
        Self {
            processor: self.processor.saturating_sub(before.processor),
            ..self
        }
    }

    fn parse(stat: &str, status: &str) -> Option<Self> {
        // The second field, in parentheses, can contain any character. `utime` and `stime` are fields 14 and
        // 15.
        let fields = stat.rsplit_once(')')?.1.split_whitespace();
        let ticks = fields
            .skip(11)
            .take(2)
            .map(|field| field.parse::<u32>().ok());
        let ticks: u32 = ticks.sum::<Option<u32>>()?;
        let resident = status
            .lines()
            .find_map(|line| line.strip_prefix("VmRSS:"))?;
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

    #[test]
    fn a_name_with_spaces_and_parentheses_moves_no_field() {
        let stat = "7 (a) b (c) S 1 7 7 0 -1 4 5 6 7 8 250 50 0 0 20 0 3 0";
        let status = "Name:\ta\nVmHWM:\t 9000 kB\nVmRSS:\t    2000 kB\n";
        let usage = Usage::parse(stat, status).expect("both files are complete");
        assert_eq!(usage.processor, Duration::from_secs(3));
        assert!((usage.resident_mb - 2.048).abs() < 1e-9);
        assert!(Usage::parse("7 (a", status).is_none());
    }

    #[test]
    fn this_process_has_used_the_processor_and_memory() {
        let before = Usage::of(std::process::id()).expect("this process runs");
        let start = std::time::Instant::now();
        while start.elapsed() < Duration::from_millis(100) {
            std::hint::spin_loop();
        }
        let used = Usage::of(std::process::id()).expect("this process runs");
        assert!(used.since(&before).processor >= Duration::from_millis(10));
        assert!(used.resident_mb > 1.0);
        assert!(Usage::of(0).is_err());
    }
}
