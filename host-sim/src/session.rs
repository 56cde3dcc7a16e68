//! One run of the virtual board: from its start to the end of its source.

use std::{
    sync::atomic::{AtomicBool, Ordering},
    time::{Duration, Instant},
};

use ads1299::SamplerCounters;
use link::{Start, Stats, Streams};
use pipeline::Mains;
use recordings::RecordingError;

use crate::{
    CHIPS, DeviceClock, Faults, Identity, Outbox, Output, Pace, Port, PortError, Source, Trigger,
    VirtualBoard, WhenFull,
};

/// How long to wait for a host that does not read, at the end.
const FAREWELL: Duration = Duration::from_secs(3);

/// How often an idle board looks for the signal to stop.
const IDLE: Duration = Duration::from_millis(20);

/// What to run.
#[derive(Clone, Debug)]
pub struct Session {
    /// Where the frames go.
    pub output: Output,
    /// Real time or as fast as possible.
    pub pace: Pace,
    /// Mains frequency until a host asks for another.
    pub mains: Mains,
    /// Who the board says it is.
    pub identity: Identity,
    /// ADC samples to take at most.
    pub limit: Option<u64>,
    /// What breaks.
    pub faults: Faults,
    /// Edges that are made up.
    pub trigger: Option<Trigger>,
}

/// Why a run ended early.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// The output could not be opened.
    #[error("cannot open the output {output}")]
    Port {
        /// The output.
        output: Output,
        /// Why.
        #[source]
        source: PortError,
    },
    /// Frames could not be written to a file.
    #[error("cannot write to {output}; is the disk full?")]
    Write {
        /// The output.
        output: Output,
        /// Why.
        #[source]
        source: std::io::Error,
    },
    /// The recording could not be read on; what came before was sent.
    #[error("the recording broke off after {samples} samples of the ADC; they were sent")]
    Source {
        /// Samples before.
        samples: u64,
        /// Why.
        #[source]
        source: RecordingError,
    },
}

impl SessionError {
    /// Whether the output failed, not the input.
    pub fn is_of_output(&self) -> bool {
        !matches!(self, Self::Source { .. })
    }
}

/// What a run did.
#[derive(Clone, Copy, Debug)]
pub struct Report {
    /// The board's counters.
    pub stats: Stats,
    /// What the converters' driver has counted.
    pub converters: SamplerCounters<CHIPS>,
    /// Why the converters did not come up as they should.
    pub failure: Option<ads1299::Error>,
    /// From the first `Start` to the last sample.
    pub elapsed: Duration,
    /// Bytes that were written to a pseudo-terminal and that nobody had read at the end.
    pub unread_bytes: u64,
}

impl Report {
    /// Seconds of signal that were processed.
    #[expect(
        clippy::cast_precision_loss,
        reason = "sample counts are far below 2^52"
    )]
    pub fn signal_s(&self) -> f64 {
        self.stats.samples as f64 / f64::from(model::ADC_RATE_HZ)
    }
}

impl Session {
    /// Runs the board until the source ends, the limit is reached or `stop` is set; `watch` is
    /// called once per second of signal.
    ///
    /// # Errors
    /// When the output cannot be opened, a file not be written or the recording not be read on.
    pub fn run(
        &self,
        source: &mut Source,
        stop: &AtomicBool,
        mut watch: impl FnMut(&Stats),
    ) -> Result<Report, SessionError> {
        let outbox = Outbox::new(self.when_full());
        let port = Port::open(&self.output, &outbox).map_err(|source| SessionError::Port {
            output: self.output.clone(),
            source,
        })?;
        let faults = self.faults.clone();
        let mut board =
            VirtualBoard::with_faults(self.identity, self.mains, faults, outbox.clone())
                .with_trigger(self.trigger);
        let mut clock = DeviceClock::new(self.pace, model::ADC_RATE_HZ.into());
        if let Output::File(_) = self.output {
            // Nobody can send a command.
            board.start(
                Start {
                    streams: Streams::CODES,
                    mains_hz: 0,
                },
                clock.now_us(),
            );
        }

        let mut begun = None;
        let mut samples = 0;
        let outcome = loop {
            if stop.load(Ordering::Relaxed) || self.limit == Some(samples) {
                break Ok(());
            }
            for bytes in port.received() {
                board.receive(&bytes, clock.now_us());
            }
            if !board.is_streaming() {
                if let Some(bytes) = port.wait(IDLE) {
                    board.receive(&bytes, clock.now_us());
                }
                if board.is_streaming() {
                    clock.begin();
                }
                continue;
            }
            if !outbox.wait_for_room(IDLE) {
                continue;
            }
            begun.get_or_insert_with(Instant::now);
            clock.wait_for_next();
            match source.next_sample() {
                Ok(Some(sample)) => board.sample(&sample, clock.next_drdy_us()),
                Ok(None) => break Ok(()),
                Err(source) => break Err(SessionError::Source { samples, source }),
            }
            samples += 1;
            if samples.is_multiple_of(model::ADC_RATE_HZ.into()) {
                watch(&board.stats());
            }
        };
        let elapsed = begun.map_or(Duration::ZERO, |begun: Instant| begun.elapsed());
        board.send_stats(clock.now_us());
        let unread_bytes = if outbox.drain(FAREWELL) {
            port.linger(FAREWELL)
        } else {
            0
        };
        outbox.close();
        outcome?;
        if let (Output::File(_), Some(source)) = (&self.output, outbox.failure()) {
            return Err(SessionError::Write {
                output: self.output.clone(),
                source,
            });
        }
        Ok(Report {
            stats: board.stats(),
            converters: *board.converters().sampler().counters(),
            failure: board.converters().failure(),
            elapsed,
            unread_bytes,
        })
    }

    fn when_full(&self) -> WhenFull {
        match (self.pace, &self.output) {
            (Pace::Realtime, Output::Pty(_) | Output::Tcp(_)) => WhenFull::DropOldest,
            _ => WhenFull::Wait,
        }
    }
}
