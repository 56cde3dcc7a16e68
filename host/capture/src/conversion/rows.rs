//! The second pass over a recording: rows and events go to files.

use std::io;

use neuro_ros::NeuroFrame;

use crate::conversion::block::{Block, TimedEvent};
use crate::conversion::collector::Listener;

/// What a file is told about its stream before the first row.
pub(crate) struct StreamFile<'a> {
    /// The stream's first frame: labels, units, ranges, rate.
    pub(crate) first: &'a NeuroFrame,
    /// Number of rows that will follow.
    pub(crate) rows: u64,
    /// Wall clock at the first row, nanoseconds since 1970.
    pub(crate) start_ns: i64,
    /// Rows of all events, in the order of the rows.
    pub(crate) events: Vec<(u64, TimedEvent)>,
}

impl StreamFile<'_> {
    /// Labels of the values in a row: electrodes, then spare channels.
    pub(crate) fn labels(&self) -> impl Iterator<Item = &String> {
        let eeg = self.first.eeg.info.labels.iter();
        eeg.chain(&self.first.exg.info.labels)
    }
}

/// Writes the rows of one stream in a file format.
pub(crate) trait RowWriter {
    /// Writes the next rows.
    ///
    /// # Errors
    ///
    /// The operating system's error, or `InvalidInput` for what the format cannot hold.
    fn write(&mut self, block: &Block) -> io::Result<()>;

    /// Completes the file.
    ///
    /// # Errors
    ///
    /// As [`RowWriter::write`].
    fn finish(self: Box<Self>) -> io::Result<()>;
}

/// The writers of all streams, by their numbers, and the first error of each.
#[derive(Default)]
pub(crate) struct Rows {
    pub(crate) writers: [Option<Box<dyn RowWriter>>; 4],
    /// Number of the stream whose file failed, with the error.
    pub(crate) failed: Option<(usize, io::Error)>,
}

impl Listener for Rows {
    const DECODES: bool = true;

    fn block(&mut self, block: Block) {
        let stream = block.stream as usize;
        if let Some(writer) = &mut self.writers[stream]
            && let Err(error) = writer.write(&block)
        {
            self.failed.get_or_insert((stream, error));
        }
    }

    fn event(&mut self, _: TimedEvent) {}
}
