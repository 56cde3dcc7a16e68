//! Connects the acquisition's frames to the bridge's core.

use std::collections::BTreeSet;
use std::time::Duration;

use bridge::{BridgeError, Feed, FeedEvent};
use bridge_core::HostTime;
use neuro_ros::{DiagnosticStatus, NeuroFrame};
use pipeline::Mains;
use tokio::time::{Instant, sleep_until, timeout_at};

use crate::frames::Frames;
use crate::refusal::Refusal;
use crate::sequence::Arrival;
use crate::source::Source;
use crate::source_status::{SourceFacts, status};

/// Longest time that the first frame waits for the bridge to start the device's streams. Starting
/// takes microseconds, unless the user has stopped the streams.
const START_TIMEOUT: Duration = Duration::from_secs(1);

/// Time without bytes for the host after which the device sends its counters.
const STATS_PERIOD: Duration = Duration::from_secs(1);

/// The acquisition, which looks like a device to the bridge's core.
pub(crate) struct SourceFeed {
    frames: Frames,
    mains: Mains,
    session_id: u32,
    /// Encoder of the frames; `None` before the first frame that can be encoded.
    source: Option<Source>,
    /// First frame since the device's start, its arrival, and a deadline. The frame is encoded as
    /// soon as the bridge has started the streams, at the latest at the deadline.
    held: Option<(NeuroFrame, HostTime, Instant)>,
    /// Time at which the newest bytes that were passed to the host count as read.
    read: HostTime,
    /// Time at which bytes were last passed to the host.
    passed: Instant,
    /// Time at which the newest frame arrived.
    newest: Option<HostTime>,
    /// Kinds of refusals, and `pause`, that the log has already reported.
    logged: BTreeSet<&'static str>,
    refused: u64,
    refusal: Option<String>,
    /// Facts of the previous report, which the next report is compared with.
    reported: SourceFacts,
}

impl SourceFeed {
    pub(crate) fn new(frames: Frames, mains: Mains, session_id: u32) -> SourceFeed {
        tracing::info!("waiting for frames on {}", frames.name());
        SourceFeed {
            frames,
            mains,
            session_id,
            source: None,
            held: None,
            read: HostTime::now(),
            passed: Instant::now(),
            newest: None,
            logged: BTreeSet::new(),
            refused: 0,
            refusal: None,
            reported: SourceFacts::default(),
        }
    }

    /// Moves bytes for the host to `buffer`, and returns how many; `None` if there are none.
    fn pass_bytes(&mut self, buffer: &mut [u8]) -> Option<usize> {
        let source = self.source.as_mut()?;
        let (read, mut bytes) = source.next_bytes()?;
        let count = bytes.len().min(buffer.len());
        buffer[..count].copy_from_slice(&bytes[..count]);
        if count < bytes.len() {
            bytes.drain(..count);
            source.put_back(read, bytes);
        }
        self.read = read;
        self.passed = Instant::now();
        Some(count)
    }

    /// Handles a frame with the time of its arrival, or the reason why a frame cannot be used.
    /// Returns true if the frame has created the device, which then counts as connected.
    fn handle_received(&mut self, received: Result<(NeuroFrame, HostTime), Refusal>) -> bool {
        let handled = received.and_then(|(frame, read)| {
            self.newest = Some(read);
            self.handle_frame(frame, read)
        });
        handled.unwrap_or_else(|refusal| {
            self.refuse(&refusal);
            false
        })
    }

    fn handle_frame(&mut self, frame: NeuroFrame, read: HostTime) -> Result<bool, Refusal> {
        let Some(source) = &mut self.source else {
            let source = Source::new(&frame, self.mains, self.session_id)?;
            log_source(&source, self.frames.name());
            self.source = Some(source);
            self.held = Some((frame, read, Instant::now() + START_TIMEOUT));
            return Ok(true);
        };
        match source.check(&frame)? {
            Arrival::Lost(frames) => {
                tracing::debug!(frames, before = frame.neuroheader.seq, "frames lost");
                source.encode(&frame, frames, read);
            }
            Arrival::Restarted => {
                tracing::warn!(
                    seq = frame.neuroheader.seq,
                    "the acquisition started again; codes go on as after a board's restart"
                );
                source.restart(read)?;
                self.held = Some((frame, read, Instant::now() + START_TIMEOUT));
            }
            // `check` returns an error for a repeated frame, so `Repeated` does not occur here.
            Arrival::Next | Arrival::Repeated => source.encode(&frame, 0, read),
        }
        self.log_first_pause();
        Ok(false)
    }

    fn log_first_pause(&mut self) {
        let counts = self.source.as_ref().map(Source::counts).unwrap_or_default();
        if counts.pauses > 0 && self.logged.insert("pause") {
            tracing::warn!(
                "the acquisition paused for {:.1} s and lost no frame: nothing is filled, and stamps go on after \
                 the pause; if samples are missing, let the acquisition count neuroheader.seq up for lost frames; \
                 /diagnostics counts further pauses",
                seconds(i64::try_from(counts.paused_us).unwrap_or(i64::MAX))
            );
        }
    }

    /// Counts a refused frame. Logs the first refusal of each kind.
    fn refuse(&mut self, refusal: &Refusal) {
        self.refused += 1;
        self.refusal = Some(refusal.to_string());
        if self.logged.insert(refusal.kind()) {
            tracing::error!(
                "frames on {} are refused: {refusal}; /diagnostics counts further ones",
                self.frames.name()
            );
        }
    }

    fn facts(&self) -> SourceFacts {
        let source = self.source.as_ref();
        let silent_us =
            self.newest.map(|newest| HostTime::now().monotonic_us - newest.monotonic_us);
        let delay_us = source.map_or(0, Source::delay_us);
        SourceFacts {
            topic: self.frames.name().to_owned(),
            is_stream: matches!(self.frames, Frames::Stream(_)),
            layout: source.map(|source| source.layout().to_string()),
            publishers: self.frames.publishers(),
            unreachable: self.frames.unreachable(),
            counts: source.map(Source::counts).unwrap_or_default(),
            refused: self.refused,
            refusal: self.refusal.clone(),
            dropped: self.frames.dropped(),
            silent_s: silent_us.map(seconds),
            is_unnumbered: source.is_some_and(Source::is_unnumbered),
            delay_s: seconds(i64::try_from(delay_us).unwrap_or(i64::MAX)),
        }
    }
}

fn seconds(us: i64) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "within 2^53 us (285 years)")]
    let seconds = us as f64 / 1e6;
    seconds
}

impl Feed for SourceFeed {
    async fn next_event(
        &mut self,
        buffer: &mut [u8],
        outgoing: &mut Vec<u8>,
    ) -> Result<FeedEvent, BridgeError> {
        loop {
            if let Some(count) = self.pass_bytes(buffer) {
                return Ok(FeedEvent::Bytes(count));
            }
            if let Some(source) = &mut self.source {
                if !outgoing.is_empty() {
                    source.receive(outgoing, HostTime::now());
                    outgoing.clear();
                    continue;
                }
                if let Some((_, _, deadline)) = &self.held {
                    if !source.is_streaming() && Instant::now() < *deadline {
                        sleep_until(*deadline).await;
                    }
                    if let Some((frame, read, _)) = self.held.take() {
                        source.encode(&frame, 0, read);
                    }
                    continue;
                }
            }
            // Use an absolute deadline, because the caller drops this future at each of its ticks.
            let deadline = self.passed + STATS_PERIOD;
            match timeout_at(deadline, self.frames.recv()).await {
                Ok(Some(received)) => {
                    if self.handle_received(received) {
                        return Ok(FeedEvent::Opened);
                    }
                }
                // The node has shut down, so the program is about to end anyway.
                Ok(None) => std::future::pending().await,
                Err(_) => {}
            }
            if self.passed.elapsed() >= STATS_PERIOD
                && let Some(source) = &mut self.source
            {
                source.send_stats();
                self.passed = Instant::now();
            }
        }
    }

    fn is_open(&self) -> bool {
        self.source.is_some()
    }

    fn name(&self) -> String {
        self.frames.name().to_owned()
    }

    fn read_time(&self) -> HostTime {
        self.read
    }

    fn status(&mut self) -> Option<DiagnosticStatus> {
        let facts = self.facts();
        let status = status(&facts, &self.reported);
        self.reported = facts;
        Some(status)
    }
}

/// Logs what is encoded, which channels are not used, and how late codes are.
fn log_source(source: &Source, topic: &str) {
    tracing::info!("encoding {topic}: {}", source.layout());
    // Interpolated electrodes are left out: the core logs them when the device introduces itself.
    let unused = source.map().unused();
    if !unused.is_empty() {
        tracing::info!("channels that no electrode uses: {}", unused.join(" "));
    }
    for warning in source.map().warnings() {
        tracing::warn!("{warning}");
    }
    if source.delay_us() > 0 {
        tracing::info!(
            "{} Hz is resampled to {} Hz: codes come {} ms later than without; their stamps are right",
            source.layout().rate_hz,
            model::ADC_RATE_HZ,
            source.delay_us().div_ceil(1000)
        );
    }
}
