//! A run of the virtual board: a source's samples go to the board, the board's frames to a port.

use std::{
    io,
    sync::atomic::{AtomicBool, Ordering},
    time::{Duration, Instant},
};

use ads1299::SamplerCounters;
use device::CHIPS;
use link::{Start, Stats, Streams};
use new_file::NewFileError;
use offline::first_channels;
use pipeline::{Mains, Sample};
use recordings::{RecordingError, VirtualAdc};

use crate::contact::Contact;
use crate::fault::Faults;
use crate::outbox::{Outbox, WhenFull};
use crate::synthetic::Generator;
use crate::trigger::Trigger;
use crate::virtual_board::{Identity, VirtualBoard};

mod device_clock;
mod json_lines;
mod port;
mod recorded_edges;
mod tcp;

pub use device_clock::{DeviceClock, Pace};
pub use port::{FileRules, Output, Port, PortError};
pub use recorded_edges::RecordedEdges;

/// Time limit at the end of a run: once for writing the queued frames, then again for the host to
/// read them.
const DRAIN_TIMEOUT: Duration = Duration::from_secs(3);

/// Longest pause between two frames written to a file at the end of a run; after it, the file
/// counts as failed. A disk that must first spin up takes less.
const STALL_TIMEOUT: Duration = Duration::from_secs(30);

/// Time limit for each wait for a command, or for room in the outbox; then `stop` is checked again.
const IDLE_POLL: Duration = Duration::from_millis(20);

/// Configuration of a run of the virtual board.
#[derive(Clone, Debug)]
pub struct Session {
    /// Destination of the frames; it is opened when the run starts.
    pub output: Output,
    /// Which existing files an output that is a file may replace.
    pub file_rules: FileRules,
    /// Streams that go to an output that is a file. A host selects its streams itself.
    pub streams: Streams,
    /// Real time or virtual time; decides whether a slow host loses frames or delays the board.
    pub pace: Pace,
    /// Error of the board's clock in real time, parts per million; positive: the clock is fast.
    pub clock_ppm: f64,
    /// Mains frequency that the notch filter removes until a host selects another one.
    pub mains: Mains,
    /// Session id and chip id that the board reports in `Hello`.
    pub identity: Identity,
    /// Number of ADC samples after which the run ends; `None` for no limit. While no host has
    /// started a stream, the run ends when the time that the remaining samples would take has
    /// passed.
    pub limit: Option<u64>,
    /// Schedule of the faults of converters and electrodes.
    pub faults: Faults,
    /// Impedances of the electrodes.
    pub contacts: Vec<Contact>,
    /// Simulated trigger input; `None` for an input without edges.
    pub trigger: Option<Trigger>,
    /// Further trigger edges, which mark the events of a recording.
    pub recorded_edges: RecordedEdges,
}

/// Why a run failed.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// The output could not be opened.
    #[error("cannot open the output {0}")]
    Port(Output, #[source] PortError),
    /// At least one frame could not be written to a file.
    #[error(
        "{frames} frames could not be written to {output}; make room on the disk and run again"
    )]
    Write {
        /// Destination of the frames, from [`Session::output`].
        output: Output,
        /// Number of frames that were not written.
        frames: u32,
        /// Error from the first write that failed.
        #[source]
        source: io::Error,
    },
    /// The complete file could not be moved from its temporary name to the output's name.
    #[error(transparent)]
    Finish(#[from] NewFileError),
    /// The rest of the recording could not be read; the samples before the error were processed and
    /// sent.
    #[error("the recording broke off after {samples} samples of the ADC; they were sent")]
    Source {
        /// Number of ADC samples read before the error.
        samples: u64,
        /// Error from the file's reader.
        #[source]
        source: RecordingError,
    },
}

impl SessionError {
    /// Returns the exit status of the program: 1 if the output cannot be written any further, 2 if
    /// the input or the output's name cannot be used, 3 if the port cannot be opened.
    pub fn exit_status(&self) -> u8 {
        match self {
            Self::Write { .. } | Self::Finish(_) => 1,
            Self::Source { .. } => 2,
            Self::Port(_, error) if error.is_wrong_name() => 2,
            Self::Port(..) => 3,
        }
    }
}

/// Result of a run of the virtual board.
#[derive(Clone, Copy, Debug)]
pub struct Report {
    /// Counters of the board at the end of the run.
    pub stats: Stats,
    /// Number of packed blocks that the board has made.
    pub packed_blocks: u64,
    /// Counters of the converters' driver at the end of the run.
    pub converters: SamplerCounters<CHIPS>,
    /// Fault found when the converters were initialised; `None` if there was none.
    pub failure: Option<ads1299::Error>,
    /// Wall-clock time from the first sample to the end of the run.
    pub elapsed: Duration,
    /// Number of bytes in a pseudo-terminal that the host had not read at the end; 0 for other
    /// outputs.
    pub unread_bytes: u64,
}

impl Report {
    /// Returns the duration of the processed signal in seconds, from the number of samples.
    #[expect(clippy::cast_precision_loss, reason = "sample counts are far below 2^52")]
    pub fn signal_s(&self) -> f64 {
        self.stats.samples as f64 / f64::from(model::ADC_RATE_HZ)
    }
}

impl Session {
    /// Runs the board until the source ends, the limit is reached or `stop` is set. Calls
    /// `on_second` after each second of signal, with the board's counters and its number of packed
    /// blocks.
    ///
    /// # Errors
    /// The output cannot be opened, a file cannot be written, or the recording cannot be read.
    pub fn run(
        &self,
        source: &mut Source,
        stop: &AtomicBool,
        mut on_second: impl FnMut(&Stats, u64),
    ) -> Result<Report, SessionError> {
        let outbox = Outbox::new(self.when_full());
        let cannot_open = |error| SessionError::Port(self.output.clone(), error);
        let port = Port::open(&self.output, &self.file_rules, &outbox);
        let mut port = port.map_err(cannot_open)?;
        let faults = self.faults.clone();
        let mut board =
            VirtualBoard::with_faults(self.identity, self.mains, faults, outbox.clone())
                .with_trigger(self.trigger)
                .with_contacts(&self.contacts);
        let mut recorded_edges = self.recorded_edges.clone();
        let mut clock = DeviceClock::new(self.pace, model::ADC_RATE_HZ.into(), self.clock_ppm);
        if self.output.file().is_some() {
            // An output that is a file has no host that could send a `Start`, so start the board
            // here.
            let start = Start { streams: self.streams, mains_hz: 0 };
            board.start(start, clock.now_us());
        }

        let mut started = None;
        let mut samples = 0;
        let mut last_sample = Instant::now();
        let outcome = loop {
            let is_unread = self.output.is_stdout() && outbox.reader_has_left();
            if is_unread || stop.load(Ordering::Relaxed) || self.limit == Some(samples) {
                break Ok(());
            }
            for bytes in port.received() {
                board.receive(&bytes, clock.now_us());
            }
            if !board.is_streaming() {
                if self.is_over(samples, last_sample) {
                    break Ok(());
                }
                if let Some(bytes) = port.receive_timeout(IDLE_POLL) {
                    board.receive(&bytes, clock.now_us());
                }
                if board.is_streaming() {
                    clock.start();
                }
                continue;
            }
            if !outbox.wait_for_room(IDLE_POLL) {
                if port.lacks_host() && self.is_over(samples, last_sample) {
                    break Ok(());
                }
                continue;
            }
            started.get_or_insert_with(Instant::now);
            clock.wait_for_next();
            match source.next_sample() {
                Ok(Some(sample)) => {
                    let drdy_us = clock.next_drdy_us();
                    let signal_us = samples * 1_000_000 / u64::from(model::ADC_RATE_HZ);
                    while let Some(edge) = recorded_edges.take_due(signal_us) {
                        board.capture_edge(edge.kind, drdy_us.saturating_sub(edge.early_us));
                    }
                    board.process_sample(&sample, drdy_us);
                }
                Ok(None) => break Ok(()),
                Err(source) => break Err(SessionError::Source { samples, source }),
            }
            samples += 1;
            last_sample = Instant::now();
            if samples.is_multiple_of(model::ADC_RATE_HZ.into()) {
                on_second(&board.stats(), board.packed_blocks());
            }
        };
        let elapsed = started.map_or(Duration::ZERO, |started: Instant| started.elapsed());
        board.send_stats(clock.now_us());
        if self.output.file().is_some() {
            self.complete_writing(&outbox, &mut port)?;
        }
        // If no sample was processed, the host has no stream to read to its end, so do not wait for
        // it.
        let unread_bytes = if samples > 0 && outbox.drain(DRAIN_TIMEOUT) {
            port.wait_until_read(DRAIN_TIMEOUT, stop)
        } else {
            0
        };
        outbox.close();
        // Complete the file before returning an error of the source, because all frames in it are
        // whole.
        let finished = port.finish_file();
        outcome?;
        finished?;
        Ok(Report {
            stats: board.stats(),
            packed_blocks: board.packed_blocks(),
            converters: *board.converters().sampler().counters(),
            failure: board.converters().failure(),
            elapsed,
            unread_bytes,
        })
    }

    /// Waits until every frame is in the file.
    fn complete_writing(&self, outbox: &Outbox, port: &mut Port) -> Result<(), SessionError> {
        let is_drained = outbox.drain_slowly(STALL_TIMEOUT);
        outbox.close();
        // The thread may never end if the file accepts no more bytes, so join it only if the outbox
        // is empty.
        let has_ended = is_drained && port.join_writer();
        let unknown = || {
            if is_drained {
                return io::Error::other("the thread that writes failed");
            }
            let reason = format!("nothing was written for {} s", STALL_TIMEOUT.as_secs());
            io::Error::new(io::ErrorKind::TimedOut, reason)
        };
        if self.output.is_stdout() && outbox.reader_has_left() {
            return Ok(());
        }
        let failure = outbox.take_failure();
        match failure.or_else(|| (!has_ended).then(unknown)) {
            None => Ok(()),
            Some(source) => Err(SessionError::Write {
                output: self.output.clone(),
                frames: outbox.dropped(),
                source,
            }),
        }
    }

    /// Returns whether the samples left up to the limit would have been processed by now if the run
    /// had continued after the last sample. A run without a streaming host then ends.
    fn is_over(&self, samples: u64, last_sample: Instant) -> bool {
        self.limit.is_some_and(|limit| {
            let left = limit.saturating_sub(samples);
            let left_us = left.saturating_mul(1_000_000) / u64::from(model::ADC_RATE_HZ);
            last_sample.elapsed() >= Duration::from_micros(left_us)
        })
    }

    fn when_full(&self) -> WhenFull {
        match (self.pace, &self.output) {
            (Pace::Realtime, Output::Pty(_) | Output::Tcp(_)) => WhenFull::DropOldest,
            _ => WhenFull::Wait,
        }
    }
}

/// A stream of samples at the ADC's rate.
pub enum Source {
    /// A recording, converted to samples by the virtual ADC; finite.
    Recording(Box<VirtualAdc>),
    /// Synthetic EEG; endless.
    Synthetic(Box<Generator>),
}

impl Source {
    /// Returns the next sample; `None` at the end of a recording.
    ///
    /// # Errors
    /// [`RecordingError`] if the rest of the recording cannot be read.
    pub fn next_sample(&mut self) -> Result<Option<Sample>, RecordingError> {
        match self {
            Self::Recording(adc) => adc.next().transpose().map(|counts| counts.map(first_channels)),
            Self::Synthetic(generator) => Ok(Some(first_channels(generator.next_sample()))),
        }
    }

    /// Returns the total number of samples; `None` for an endless source.
    pub fn samples(&self) -> Option<u64> {
        match self {
            Self::Recording(adc) => Some(adc.samples()),
            Self::Synthetic(_) => None,
        }
    }
}
