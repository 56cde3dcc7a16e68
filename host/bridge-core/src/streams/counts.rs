//! Numbers of received, lost and filled data of one stream.

use crate::streams::ledger::Ledger;

/// Numbers of received and missing items of a stream with one item per hop.
#[derive(Clone, Debug, Default)]
pub(crate) struct HopCounts {
    pub(crate) ledger: Ledger,
    /// Number of items that are missing between two runs of the device, which did not make them.
    pub(crate) between_runs: u64,
    pub(crate) fillers: u64,
    /// Number of missing items without a filler, because more are missing than fit into the queues of
    /// subscribers.
    pub(crate) unfilled: u64,
}

/// Numbers of unusable and clipped codes.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct CodeCounts {
    /// Number of codes whose model or format is not the one that the device reported.
    pub(crate) foreign: u64,
    /// Number of cells of the encoder's input that the device clipped to int8. A cell counts once
    /// for each window that contains it.
    pub(crate) clipped: u64,
    /// Number of values in codes that the device clipped to the range of the code's format.
    pub(crate) clipped_values: u64,
}

/// Numbers of packed blocks by their status.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PackedCounts {
    /// Number of bits of all blocks, without those of their frames.
    pub(crate) bits: u64,
    /// Number of blocks without prediction.
    pub(crate) resets: u64,
    /// Number of blocks with the flag `MISFIT`, after the filters have settled: until then, no signal fits.
    pub(crate) misfits: u64,
    /// Number of blocks with the flag `BLANK`, after the filters have settled.
    pub(crate) blanks: u64,
    /// Number of blocks that the device quantised more coarsely than its rate, because they were too long.
    pub(crate) coarser: u64,
    /// Number of electrode values that the device clipped to the range of the inputs.
    pub(crate) clipped: u64,
}

impl HopCounts {
    /// Number of items that no frame from the device holds: lost ones, and those between two runs.
    pub(crate) fn missing(&self) -> u64 {
        self.ledger.lost() + self.between_runs
    }
}

/// Numbers of received, lost and unpublished samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct SampleCounts {
    pub(crate) received: u64,
    pub(crate) lost: u64,
    /// Number of samples that are missing between two runs of the device, which did not make them.
    pub(crate) between_runs: u64,
    /// Number of samples that no published frame contains: samples of a frame that was unfinished
    /// when the stream ended; lost samples of a gap in excess of two minutes; and, without
    /// fillers, all samples of a frame that would contain a lost sample.
    pub(crate) unpublished: u64,
    /// Number of messages whose content does not match the device's capabilities.
    pub(crate) malformed: u64,
    /// Value of `missing` at the last report to `/diagnostics`, which shows the difference.
    pub(crate) reported: u64,
}

impl SampleCounts {
    /// Number of samples that are in no message from the device: lost samples, and samples missing
    /// between two runs.
    pub(crate) fn missing(&self) -> u64 {
        self.lost.saturating_add(self.between_runs)
    }
}
