//! The status `packed code` of `/diagnostics`.

use neuro_ros::{DiagnosticArray, DiagnosticLevel, DiagnosticStatus, KeyValue};

use crate::streams::ledger::PackedCounts;
use crate::streams::packed::PackedStream;

const NAME: &str = "packed code";

/// Adds `malformed`, the total number of malformed blocks, to the status `packed code` of a report.
/// The core cannot add it, because only the decoder knows it. If `since`, the number since the last
/// report, is above 0, the status becomes an error.
pub fn report_malformed(report: &mut DiagnosticArray, malformed: u64, since: u64) {
    let statuses = report.status.iter_mut();
    for status in statuses.filter(|status| status.name.ends_with(NAME)) {
        status.values.push(KeyValue::new("malformed", &malformed));
        if since > 0 {
            status.level = DiagnosticLevel::Error;
            status.message = format!(
                "{since} blocks are no blocks of the model and count as lost; bring firmware and this program to \
                 the same release"
            );
        }
    }
}

/// Counts of packed blocks at the last report to `/diagnostics`; the next report subtracts them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct PackedReport {
    time_us: i64,
    bits: u64,
    blocks: u64,
    misfits: u64,
    blanks: u64,
    coarser: u64,
    missing: u64,
}

impl PackedReport {
    /// Returns the number of blocks of `stream` that are missing since the last report.
    pub(crate) fn missing_since(&self, stream: &PackedStream) -> u64 {
        stream.timeline.counts().missing().saturating_sub(self.missing)
    }

    /// Returns the status `packed code` at the host time `now_us`; `None` before the first block.
    /// Keeps the present counts for the next report.
    pub(crate) fn status(
        &mut self,
        stream: &PackedStream,
        now_us: i64,
    ) -> Option<DiagnosticStatus> {
        let rate = stream.rate?;
        let hops = stream.timeline.counts();
        let PackedCounts { bits, resets, misfits, blanks, coarser, clipped } = stream.counts;
        let now = PackedReport {
            time_us: now_us,
            bits,
            blocks: hops.ledger.received,
            misfits,
            blanks,
            coarser,
            missing: hops.missing(),
        };
        let before = std::mem::replace(self, now);
        let since = |now: u64, before: u64| now.saturating_sub(before);
        let blocks = since(now.blocks, before.blocks);
        let elapsed_us = now_us - before.time_us;
        let has_elapsed = before.time_us > 0 && elapsed_us > 0;
        #[expect(clippy::cast_precision_loss, reason = "counts of one second")]
        let per_second = since(bits, before.bits) as f64 * 1e6 / elapsed_us as f64;
        let bits_per_second = has_elapsed.then(|| format!("{per_second:.0}"));
        let misfits_since = since(misfits, before.misfits);
        let blanks_since = since(blanks, before.blanks);
        let state = if blanks_since > 0 {
            let message = format!(
                "{blanks_since} of {blocks} blocks were too long and have no content; check the electrodes, or \
                 choose a coarser rate"
            );
            (DiagnosticLevel::Warn, message)
        } else if 2 * misfits_since > blocks {
            let message = format!(
                "{misfits_since} of {blocks} blocks do not fit the model: an electrode without contact, or \
                 another cap than it was trained for"
            );
            (DiagnosticLevel::Warn, message)
        } else {
            let bits = bits_per_second.as_ref();
            let bits = bits.map_or_else(String::new, |bits| format!(", {bits} bits per second"));
            let coarser = match since(coarser, before.coarser) {
                0 => String::new(),
                count => format!(", {count} of {blocks} blocks too long and coarser"),
            };
            (DiagnosticLevel::Ok, format!("rate {rate}{bits}{coarser}"))
        };
        let bits = bits_per_second.map(|bits| KeyValue::new("bits per second", &bits));
        let counts = [
            KeyValue::new("made", &hops.ledger.made()),
            KeyValue::new("received", &hops.ledger.received),
            KeyValue::new("lost", &hops.ledger.lost),
            KeyValue::new("missing between runs", &hops.between_runs),
            KeyValue::new("longest burst", &hops.ledger.longest_burst),
            KeyValue::new("fillers", &hops.fillers),
            KeyValue::new("lost and not filled", &hops.unfilled),
            KeyValue::new("without prediction", &resets),
            KeyValue::new("misfits", &misfits),
            KeyValue::new("too long, coarser", &coarser),
            KeyValue::new("too long, no content", &blanks),
            KeyValue::new("values clipped", &clipped),
        ];
        let values = [KeyValue::new("rate", &rate)].into_iter();
        let values = values.chain(bits).chain(counts).collect();
        Some(DiagnosticStatus::new(NAME, state, values))
    }
}
