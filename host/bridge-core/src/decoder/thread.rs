//! The thread that decodes codes and packed blocks, and audits codes.

#[cfg(test)]
mod tests;

use std::fmt;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use neuro_ros::{DiagnosticStatus, FrameSink, NeuroFrame, SinkError};

use crate::decoder::audit::{AuditResult, AuditedWindow};
use crate::decoder::model::Model;
use crate::decoder::packed::{PackedReconstruction, TimedPackedBlock};
use crate::decoder::reconstruction::{Reconstruction, TimedCode};
use crate::diagnostics::audit::AuditCounts;

/// Maximum number of codes and packed blocks that wait for the decoder: 68 minutes at 16 codes per
/// second, like the longest gap for which fillers are published. A waiting code takes about 0.6 KB,
/// so a full queue takes 40 MB.
const QUEUE_WINDOWS: u64 = 65_536;

/// Maximum number of audits that wait for the decoder's thread. One audit arrives every 10 s, and
/// its comparison takes about 10 ms.
const QUEUE_AUDITS: usize = 4;

/// Increase of the Unix `nice` value in the decoder's thread, which makes it less urgent than the
/// rest of the program.
const NICE: i32 = 10;

/// Time limit for the thread to end after it was told to stop. The thread still completes the
/// window that it is decoding.
const STOP_TIMEOUT: Duration = Duration::from_secs(1);
/// Time between two checks of whether the thread has ended.
const POLL: Duration = Duration::from_millis(10);

/// Thread that decodes codes and packed blocks, publishes the reconstructed signals and evaluates
/// audits. A separate thread keeps this work from delaying the link.
#[derive(Debug)]
pub struct DecoderThread {
    work: Sender<Work>,
    /// Work that the next [`DecoderThread::start_work`] passes to the thread.
    prepared: Vec<Work>,
    progress: Arc<Progress>,
    thread: JoinHandle<()>,
    not_decoded: u64,
    skipped_audits: u64,
}

/// Lengths of the thread's queues, and counts of its work as in [`DecoderCounts`].
#[derive(Debug, Default)]
struct Progress {
    /// Number of queued codes and packed blocks. Placeholders for lost packed blocks count too;
    /// placeholders for lost codes do not.
    waiting: AtomicU64,
    decoded: AtomicU64,
    malformed: AtomicU64,
    not_needed: AtomicU64,
    longest_wait_us: AtomicU64,
    /// Number of reconstructed frames that were dropped because a subscriber was too slow.
    dropped: AtomicU64,
    audits_waiting: AtomicUsize,
    audits: Mutex<AuditCounts>,
    /// Whether the thread must end before its queue is empty.
    stop: AtomicBool,
}

#[derive(Debug)]
enum Work {
    /// Reconstructions for the device that sends all codes and blocks queued after this item: one
    /// from codes, and one from packed blocks if the model has them.
    Device(Box<Reconstruction>, Option<Box<PackedReconstruction>>),
    /// A code, and the time at which it was queued.
    Code(TimedCode, Instant),
    /// A packed block, and the time at which it was queued.
    Block(TimedPackedBlock, Instant),
    /// No packed block follows, so the frame that waits for the next block must be published.
    FinishBlocks,
    Audit(Box<AuditedWindow>, Arc<Model>),
}

impl DecoderThread {
    /// Starts the thread, which publishes the reconstructed frames to `sink`.
    ///
    /// # Errors
    ///
    /// The operating system's error if it cannot start a thread.
    pub fn start(sink: Box<dyn FrameSink>) -> std::io::Result<DecoderThread> {
        let (work, receiver) = channel();
        let progress = Arc::new(Progress::default());
        let worker =
            Worker { sink, progress: Arc::clone(&progress), codes: None, packed: None, number: 0 };
        let thread = std::thread::Builder::new()
            .name("decoder".to_owned())
            .spawn(move || worker.run(&receiver))?;
        Ok(DecoderThread {
            work,
            prepared: Vec::new(),
            progress,
            thread,
            not_decoded: 0,
            skipped_audits: 0,
        })
    }

    /// Sets the reconstructions, from codes and from packed blocks, for the device that sends the
    /// codes and packed blocks which are queued after this call.
    pub fn start_device(
        &mut self,
        reconstruction: Reconstruction,
        packed: Option<PackedReconstruction>,
    ) {
        let packed = packed.map(Box::new);
        self.prepared.push(Work::Device(Box::new(reconstruction), packed));
    }

    /// Queues a code without blocking. If the queue is full, the code is discarded and counted, and
    /// a filler is published in its place. A filler needs no decoding, and keeps the number of
    /// published samples correct.
    pub fn decode(&mut self, mut window: TimedCode) {
        if window.z.is_some() && !self.takes_one_more() {
            window.z = None;
        }
        self.prepared.push(Work::Code(window, Instant::now()));
    }

    /// Queues a packed block without blocking; if the queue is full, a placeholder takes the place
    /// of the block. A placeholder for a lost block counts as waiting too, because its prediction
    /// can take as long as decoding a block, but it is queued even if the queue is full.
    pub fn decode_block(&mut self, mut block: TimedPackedBlock) {
        if block.block.is_none() || !self.takes_one_more() {
            block.block = None;
            self.progress.waiting.fetch_add(1, Ordering::Relaxed);
        }
        self.prepared.push(Work::Block(block, Instant::now()));
    }

    /// Queues the publication of the frame that waits to be corrected by the next packed block.
    /// Call this when no block follows.
    pub fn finish_blocks(&mut self) {
        self.prepared.push(Work::FinishBlocks);
    }

    /// Counts a code or packed block as waiting, or as not decoded if the queue is full. Returns
    /// whether the queue has room for it.
    fn takes_one_more(&mut self) -> bool {
        let has_room = self.progress.waiting.load(Ordering::Relaxed) < QUEUE_WINDOWS;
        if has_room {
            self.progress.waiting.fetch_add(1, Ordering::Relaxed);
        } else {
            self.not_decoded += 1;
        }
        has_room
    }

    /// Queues an audit without blocking. If the queue is full, the audit is skipped and counted.
    pub fn audit(&mut self, window: AuditedWindow, model: Arc<Model>) {
        if self.progress.audits_waiting.load(Ordering::Relaxed) >= QUEUE_AUDITS {
            self.skipped_audits += 1;
            return;
        }
        self.progress.audits_waiting.fetch_add(1, Ordering::Relaxed);
        self.prepared.push(Work::Audit(Box::new(window), model));
    }

    /// Returns whether work was queued that [`Self::start_work`] has not yet passed to the thread.
    pub fn has_prepared_work(&self) -> bool {
        !self.prepared.is_empty()
    }

    /// Passes the queued work to the thread. Call this after the codes were written to the
    /// subscribers, because the thread then takes the processor for milliseconds.
    pub fn start_work(&mut self) {
        for work in self.prepared.drain(..) {
            // Sending fails only if the thread has ended because its sink failed.
            let _ = self.work.send(work);
        }
    }

    /// Returns the results of the audits for `/diagnostics`; `None` before the first audit.
    pub fn audit_status(&self) -> Option<DiagnosticStatus> {
        let counts = self.progress.audits.lock();
        let counts = counts.unwrap_or_else(PoisonError::into_inner);
        counts.status(self.skipped_audits)
    }

    /// Returns the numbers of codes and packed blocks that were decoded, wait or were not decoded.
    pub fn counts(&self) -> DecoderCounts {
        self.progress.counts(self.not_decoded)
    }

    /// Returns the number of reconstructed frames that were dropped for slow subscribers.
    pub fn dropped(&self) -> u64 {
        self.progress.dropped.load(Ordering::Relaxed)
    }

    /// Returns whether the thread has ended, after which no signals are reconstructed.
    pub fn has_ended(&self) -> bool {
        self.thread.is_finished()
    }

    /// Waits until the queue is empty, but not longer than `limit`, then ends the thread and
    /// returns the final counts. Windows that still wait after `limit` count as not decoded.
    pub fn finish(mut self, limit: Duration) -> DecoderCounts {
        self.start_work();
        drop(self.work);
        if !ends_within(&self.thread, limit) {
            self.progress.stop.store(true, Ordering::Relaxed);
            ends_within(&self.thread, STOP_TIMEOUT);
        }
        // Do not join a thread that is still blocked by its sink; the process ends without it.
        if self.thread.is_finished() && self.thread.join().is_err() {
            tracing::error!("the decoder thread panicked; reconstructed frames are missing");
        }
        let mut counts = self.progress.counts(self.not_decoded);
        counts.not_decoded += std::mem::take(&mut counts.waiting);
        counts
    }
}

/// Waits until `thread` ends, but not longer than `limit`. Returns whether it has ended.
fn ends_within(thread: &JoinHandle<()>, limit: Duration) -> bool {
    let deadline = Instant::now() + limit;
    while !thread.is_finished() && Instant::now() < deadline {
        std::thread::sleep(POLL);
    }
    thread.is_finished()
}

impl Progress {
    fn counts(&self, not_decoded: u64) -> DecoderCounts {
        DecoderCounts {
            decoded: self.decoded.load(Ordering::Relaxed),
            waiting: self.waiting.load(Ordering::Relaxed),
            longest_wait: Duration::from_micros(self.longest_wait_us.load(Ordering::Relaxed)),
            not_decoded,
            not_needed: self.not_needed.load(Ordering::Relaxed),
            malformed: self.malformed.load(Ordering::Relaxed),
        }
    }

    /// Records that a code or packed block, queued at `queued`, has left the queue.
    fn record_start(&self, queued: Instant) {
        self.waiting.fetch_sub(1, Ordering::Relaxed);
        let waited_us = u64::try_from(queued.elapsed().as_micros()).unwrap_or(u64::MAX);
        self.longest_wait_us.fetch_max(waited_us, Ordering::Relaxed);
    }
}

/// State that belongs to the decoder's thread.
struct Worker {
    sink: Box<dyn FrameSink>,
    progress: Arc<Progress>,
    codes: Option<Box<Reconstruction>>,
    packed: Option<Box<PackedReconstruction>>,
    /// Sequence number of the newest published frame. The reconstructions from codes and from
    /// packed blocks share it, because both publish on one topic, whose frames are numbered without
    /// a gap.
    number: u32,
}

impl Worker {
    /// Does queued work until the queue is closed, the thread is told to stop or the sink fails.
    fn run(mut self, work: &Receiver<Work>) {
        // Lower the priority of this thread, so that decoding does not delay publication of codes.
        if let Err(error) = rustix::process::nice(NICE) {
            tracing::debug!(%error, "the decoder is as urgent as the link");
        }
        if let Err(error) = self.do_all(work) {
            tracing::error!(%error, "reconstructed frames cannot be published any more");
        }
    }

    fn do_all(&mut self, work: &Receiver<Work>) -> Result<(), SinkError> {
        for work in work {
            if self.progress.stop.load(Ordering::Relaxed) {
                return Ok(());
            }
            match work {
                Work::Device(codes, packed) => self.replace_device(codes, packed),
                Work::Code(window, queued) => self.decode(&window, queued)?,
                Work::Block(block, queued) => self.decode_block(&block, queued)?,
                Work::FinishBlocks => self.finish_blocks()?,
                Work::Audit(window, model) => self.audit(&window, &model),
            }
        }
        self.finish_blocks()
    }

    /// Replaces the reconstructions by `codes` and `packed` for another device. The new
    /// reconstructions continue the frames of the old ones.
    fn replace_device(
        &mut self,
        mut codes: Box<Reconstruction>,
        mut packed: Option<Box<PackedReconstruction>>,
    ) {
        if let Some(before) = &self.codes {
            codes.continue_from(before);
        }
        if let (Some(new), Some(before)) = (&mut packed, &mut self.packed) {
            new.continue_from(before);
        }
        (self.codes, self.packed) = (Some(codes), packed);
    }

    /// Publishes the frame that a code completes. Does not decode if nobody receives the frame.
    fn decode(&mut self, window: &TimedCode, queued: Instant) -> Result<(), SinkError> {
        let holds_code = window.z.is_some();
        if holds_code {
            self.progress.record_start(queued);
        }
        let Some(codes) = &mut self.codes else {
            return Ok(());
        };
        codes.set_number(self.number);
        let frame = if holds_code && !self.sink.has_receivers() {
            codes.skip_frame();
            self.progress.not_needed.fetch_add(1, Ordering::Relaxed);
            None
        } else {
            let decoded = u64::from(holds_code);
            self.progress.decoded.fetch_add(decoded, Ordering::Relaxed);
            codes.next_frame(window)
        };
        if let Some(frame) = frame {
            publish(frame, self.sink.as_mut(), &self.progress)?;
        }
        self.number = codes.number();
        Ok(())
    }

    /// Decodes a packed block and publishes the frame that it completes. The block is decoded even
    /// if nobody receives the frame, because later blocks depend on it.
    fn decode_block(&mut self, block: &TimedPackedBlock, queued: Instant) -> Result<(), SinkError> {
        self.progress.record_start(queued);
        let Some(packed) = &mut self.packed else {
            return Ok(());
        };
        packed.set_number(self.number);
        let before = packed.malformed();
        let published = match packed.next_frame(block) {
            Some(frame) if self.sink.has_receivers() => {
                publish(frame, self.sink.as_mut(), &self.progress)
            }
            _ => Ok(()),
        };
        self.number = packed.number();
        let malformed = packed.malformed() - before;
        let decoded = u64::from(block.block.is_some()) - malformed;
        self.progress.malformed.fetch_add(malformed, Ordering::Relaxed);
        self.progress.decoded.fetch_add(decoded, Ordering::Relaxed);
        published
    }

    /// Publishes the frame that waits to be corrected by the next packed block.
    fn finish_blocks(&mut self) -> Result<(), SinkError> {
        let Some(packed) = &mut self.packed else {
            return Ok(());
        };
        packed.set_number(self.number);
        if let Some(frame) = packed.finish()
            && self.sink.has_receivers()
        {
            publish(frame, self.sink.as_mut(), &self.progress)?;
        }
        self.number = packed.number();
        Ok(())
    }

    /// Audits a window: compares the device's code with the float network's code, and the window's
    /// signals with the signals of its packed blocks. Counts the results.
    fn audit(&self, window: &AuditedWindow, model: &Model) {
        let result = window.compare(model);
        if let Some(result) = result.filter(AuditResult::is_wrong) {
            tracing::error!("the device's code differs from its model: {result}");
        }
        let packed = self.packed.as_ref();
        let error = packed.and_then(|packed| window.compare_packed(model, packed));
        let counts = self.progress.audits.lock();
        let mut counts = counts.unwrap_or_else(PoisonError::into_inner);
        if let Some(result) = result {
            counts.record(result);
        }
        // If the code was compared, do not count missing packed blocks as a failure: a device that
        // sends codes need not send packed blocks.
        if result.is_none() || error.is_some() {
            counts.record_packed(error);
        }
        self.progress.audits_waiting.fetch_sub(1, Ordering::Relaxed);
    }
}

fn publish(
    frame: &NeuroFrame,
    sink: &mut dyn FrameSink,
    progress: &Progress,
) -> Result<(), SinkError> {
    sink.publish(frame)?;
    progress.dropped.store(sink.dropped(), Ordering::Relaxed);
    Ok(())
}

/// Numbers of windows that were decoded, that still wait, and, for each reason, that were not
/// decoded. Here a window is a code or a packed block. The program prints these numbers when it
/// ends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DecoderCounts {
    /// Number of codes and packed blocks decoded so far.
    pub decoded: u64,
    /// Number of codes and packed blocks that wait for the decoder at present.
    pub waiting: u64,
    /// Longest time that a code or packed block has waited for the decoder.
    pub longest_wait: Duration,
    /// Number of codes and packed blocks that were replaced by fillers because the decoder's queue
    /// was full, or that still waited when the program ended.
    pub not_decoded: u64,
    /// Number of codes that were not decoded because `/neurodata_reconstructed` had no subscriber.
    pub not_needed: u64,
    /// Number of packed blocks that arrived intact but that the model's decoder refuses. They count
    /// as lost.
    pub malformed: u64,
}

impl fmt::Display for DecoderCounts {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            formatter,
            "windows: decoded {} not decoded {} not needed {} longest wait {} ms",
            self.decoded,
            self.not_decoded,
            self.not_needed,
            self.longest_wait.as_millis()
        )?;
        if self.malformed > 0 {
            write!(formatter, "; packed blocks malformed {}", self.malformed)?;
        }
        Ok(())
    }
}
