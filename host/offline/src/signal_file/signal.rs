//! The signal that a file holds, and the writer of its rows.

use std::io;

use link::Flags;

/// An event at a row of the signal.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct RowEvent {
    pub(crate) row: u64,
    pub(crate) text: String,
    /// Type in a GDF file.
    pub(crate) kind: u16,
}

/// What a file is told about the signal before its first row.
#[derive(Debug, Clone)]
pub(crate) struct Signal<'a> {
    /// Electrodes, in the order of the values in a row.
    pub(crate) labels: &'a [String],
    /// Rows per second, Hz.
    pub(crate) rate_hz: u32,
    /// Rows that are written together.
    pub(crate) rows_per_hop: u32,
    /// Number of all rows.
    pub(crate) rows: u64,
    /// Delay of the filters, microseconds: a row with the time t shows the electrodes at t less the delay.
    pub(crate) group_delay_us: u32,
    /// Largest magnitude of a value, microvolts.
    pub(crate) full_scale_uv: f32,
    /// Events in the order of their rows.
    pub(crate) events: Vec<RowEvent>,
    /// Text that identifies the signal.
    pub(crate) description: String,
}

/// Writes the rows of a signal in a file format.
pub(crate) trait SignalFile {
    /// Writes one hop: [`Signal::rows_per_hop`] rows with a value for each electrode, and the flags of all
    /// of them.
    ///
    /// # Errors
    /// The operating system's error, or `InvalidInput` for what the format cannot hold.
    fn write_hop(&mut self, uv: &[f32], flags: Flags) -> io::Result<()>;

    /// Completes the file. Returns the number of values that were limited to the format's range.
    ///
    /// # Errors
    /// As [`Self::write_hop`].
    fn finish(self: Box<Self>) -> io::Result<u64>;
}
