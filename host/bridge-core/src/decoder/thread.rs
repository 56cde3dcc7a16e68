//! The thread that decodes codes and packed blocks, and audits codes.

#[cfg(test)]
pub(crate) mod tests;

use std::fmt;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use neuro_ros::{DiagnosticStatus, FrameSink, NeuroFrame};

use crate::decoder::audit::{AuditResult, AuditedWindow};
use crate::decoder::model::Model;
use crate::decoder::packed::{PackedReconstruction, TimedPackedBlock};
use crate::decoder::reconstruction::{Reconstruction, TimedCode};
use crate::diagnostics::audit::AuditCounts;

/// Maximum number of codes and packed blocks that wait for the decoder: 68 minutes at 16 codes per
/// second, as long as the longest gap that is filled. A waiting code takes about 0.6 KB, so a full
/// queue takes 40 MB.
const QUEUE_WINDOWS: u64 = 65_536;

/// Maximum number of audits that wait for this thread. One audit arrives every 10 s, and its
/// comparison takes about 10 ms.
const QUEUE_AUDITS: usize = 4;

/// How much less urgent than the rest of the program the decoder is, in steps of Unix's `nice`.
const NICE: i32 = 10;

/// Time after a request to stop in which the thread ends: it completes at most one window.
const STOP_TIMEOUT: Duration = Duration::from_secs(1);
/// Time between two checks whether the thread has ended.
const POLL: Duration = Duration::from_millis(10);

/// Thread that decodes codes and packed blocks, publishes the reconstructed signals and compares
/// audits, so that this work does not delay the link.
#[derive(Debug)]
pub struct DecoderThread {
    work: Sender<Work>,
    /// Work that [`DecoderThread::start_work`] has not passed to the thread yet.
    prepared: Vec<Work>,
    progress: Arc<Progress>,
    thread: JoinHandle<()>,
    not_decoded: u64,
    skipped_audits: u64,
}

/// Lengths of the queues, and what the thread has done.
#[derive(Debug, Default)]
struct Progress {
    /// Number of queued codes and packed blocks. Placeholders for lost blocks count, those for lost
    /// codes do not.
    waiting: AtomicU64,
    decoded: AtomicU64,
    /// Number of packed blocks that were malformed.
    malformed: AtomicU64,
    not_needed: AtomicU64,
    longest_wait_us: AtomicU64,
    /// Number of frames that were dropped for slow subscribers.
    dropped: AtomicU64,
    audits_waiting: AtomicUsize,
    audits: Mutex<AuditCounts>,
    /// Whether the thread shall end before the queue is empty.
    stop: AtomicBool,
}

#[derive(Debug)]
enum Work {
    /// Reconstructions for the device that sends what is queued after this item: from codes, and
    /// from packed blocks if the model has them.
    Device(Box<Reconstruction>, Option<Box<PackedReconstruction>>),
    /// A code, and when it was queued.
    Code(TimedCode, Instant),
    /// A packed block, and when it was queued.
    Block(TimedPackedBlock, Instant),
    /// No packed block follows the newest one.
    FinishBlocks,
    Audit(Box<AuditedWindow>, Arc<Model>),
}

impl DecoderThread {
    /// Starts the thread, which publishes to `sink`.
    ///
    /// # Errors
    ///
    /// The operating system's error if it provides no thread.
    pub fn start(sink: Box<dyn FrameSink>) -> std::io::Result<DecoderThread> {
        let (work, receiver) = channel();
        let progress = Arc::new(Progress::default());
        let thread_progress = Arc::clone(&progress);
        let thread = std::thread::Builder::new()
            .name("decoder".to_owned())
            .spawn(move || run(sink, &receiver, &thread_progress))?;
        Ok(DecoderThread {
            work,
            prepared: Vec::new(),
            progress,
            thread,
            not_decoded: 0,
            skipped_audits: 0,
        })
    }

    /// Sets the reconstructions for the device that sends the following codes and packed blocks.
    pub fn start_device(
        &mut self,
        reconstruction: Reconstruction,
        packed: Option<PackedReconstruction>,
    ) {
        let packed = packed.map(Box::new);
        self.prepared
            .push(Work::Device(Box::new(reconstruction), packed));
    }

    /// Queues a code without blocking. If the queue is full, the code is discarded and counted, and
    /// a filler is published in its place. Fillers of codes need no decoding and keep the number of
    /// samples correct.
    pub fn decode(&mut self, mut window: TimedCode) {
        if window.z.is_some() && !self.takes_one_more() {
            window.z = None;
        }
        self.prepared.push(Work::Code(window, Instant::now()));
    }

    /// Queues a packed block as [`Self::decode`] does a code. Placeholders count among those that
    /// wait, because a prediction can take as long as a block; a full queue takes them
    /// nevertheless.
    pub fn decode_block(&mut self, mut block: TimedPackedBlock) {
        if block.block.is_none() {
            self.progress.waiting.fetch_add(1, Ordering::Relaxed);
        } else if !self.takes_one_more() {
            block.block = None;
            self.progress.waiting.fetch_add(1, Ordering::Relaxed);
        }
        self.prepared.push(Work::Block(block, Instant::now()));
    }

    /// Queues the frame that waits for another packed block: none follows.
    pub fn finish_blocks(&mut self) {
        self.prepared.push(Work::FinishBlocks);
    }

    /// Counts one more item in the queue, or as not decoded if the queue is full.
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

    /// Returns whether work is queued that the thread does not know yet.
    pub fn has_prepared_work(&self) -> bool {
        !self.prepared.is_empty()
    }

    /// Wakes the thread for the queued work. Call this after the codes themselves were written to
    /// the subscribers, because the thread takes the processor for milliseconds.
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

    /// Returns what the thread has decoded so far, and what waits.
    pub fn counts(&self) -> DecoderCounts {
        self.progress.counts(self.not_decoded)
    }

    /// Number of frames that were dropped for slow subscribers.
    pub fn dropped(&self) -> u64 {
        self.progress.dropped.load(Ordering::Relaxed)
    }

    /// Returns whether the thread has ended, after which no signals are reconstructed.
    pub fn has_ended(&self) -> bool {
        self.thread.is_finished()
    }

    /// Waits until the queue is empty, but not longer than `limit`, and returns the final counts.
    /// The windows that wait then count as not decoded.
    pub fn finish(mut self, limit: Duration) -> DecoderCounts {
        self.start_work();
        drop(self.work);
        if !ends_within(&self.thread, limit) {
            self.progress.stop.store(true, Ordering::Relaxed);
            ends_within(&self.thread, STOP_TIMEOUT);
        }
        // A thread whose sink is blocked is not joined: the process ends without it.
        if self.thread.is_finished() && self.thread.join().is_err() {
            tracing::error!("the decoder thread panicked; reconstructed frames are missing");
        }
        let mut counts = self.progress.counts(self.not_decoded);
        counts.not_decoded += std::mem::take(&mut counts.waiting);
        counts
    }
}

/// Waits until a thread ends. Returns whether it ended within `limit`.
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

    /// Records that a code left the queue in which it was put at `queued`.
    fn record_start(&self, queued: Instant) {
        self.waiting.fetch_sub(1, Ordering::Relaxed);
        let waited_us = u64::try_from(queued.elapsed().as_micros()).unwrap_or(u64::MAX);
        self.longest_wait_us.fetch_max(waited_us, Ordering::Relaxed);
    }
}

fn run(mut sink: Box<dyn FrameSink>, work: &Receiver<Work>, progress: &Progress) {
    // The urgency of this thread alone. Without it the decoder could delay the codes themselves.
    if let Err(error) = rustix::process::nice(NICE) {
        tracing::debug!(%error, "the decoder is as urgent as the link");
    }
    let mut reconstruction: Option<Box<Reconstruction>> = None;
    let mut packed: Option<Box<PackedReconstruction>> = None;
    // Both reconstructions publish on one topic, whose frames are numbered without a gap.
    let mut number = 0;
    for work in work {
        if progress.stop.load(Ordering::Relaxed) {
            return;
        }
        let (window, queued) = match work {
            Work::Device(mut new, mut new_packed) => {
                if let Some(before) = &reconstruction {
                    new.continue_from(before);
                }
                if let (Some(new), Some(before)) = (&mut new_packed, &mut packed) {
                    new.continue_from(before);
                }
                (reconstruction, packed) = (Some(new), new_packed);
                continue;
            }
            Work::Block(block, queued) => {
                progress.record_start(queued);
                let Some(known) = packed.as_mut() else {
                    continue;
                };
                known.set_number(number);
                if !run_block(known, &block, sink.as_mut(), progress) {
                    return;
                }
                number = known.number();
                continue;
            }
            Work::FinishBlocks => {
                let known = packed.as_deref_mut();
                if !finish_blocks(known, &mut number, sink.as_mut(), progress) {
                    return;
                }
                continue;
            }
            Work::Audit(window, model) => {
                let result = window.compare(&model);
                if let Some(result) = result.filter(AuditResult::is_wrong) {
                    tracing::error!("the device's code differs from its model: {result}");
                }
                let packed = packed.as_ref();
                let error = packed.and_then(|packed| window.compare_packed(&model, packed));
                let counts = progress.audits.lock();
                let mut counts = counts.unwrap_or_else(PoisonError::into_inner);
                if let Some(result) = result {
                    counts.record(result);
                }
                // Codes alone have no blocks to compare.
                if result.is_none() || error.is_some() {
                    counts.record_packed(error);
                }
                progress.audits_waiting.fetch_sub(1, Ordering::Relaxed);
                continue;
            }
            Work::Code(window, queued) => (window, queued),
        };
        let holds_code = window.z.is_some();
        if holds_code {
            progress.record_start(queued);
        }
        let Some(known) = reconstruction.as_mut() else {
            continue;
        };
        known.set_number(number);
        if holds_code && !sink.has_receivers() {
            known.skip_frame();
            number = known.number();
            progress.not_needed.fetch_add(1, Ordering::Relaxed);
            continue;
        }
        let frame = known.next_frame(&window);
        if holds_code {
            progress.decoded.fetch_add(1, Ordering::Relaxed);
        }
        if frame.is_some_and(|frame| !publish(frame, sink.as_mut(), progress)) {
            return;
        }
        number = known.number();
    }
    finish_blocks(packed.as_deref_mut(), &mut number, sink.as_mut(), progress);
}

/// Publishes the frame that waits for another packed block, with the number after `number`. Returns
/// false if frames cannot be published any more.
fn finish_blocks(
    packed: Option<&mut PackedReconstruction>,
    number: &mut u32,
    sink: &mut dyn FrameSink,
    progress: &Progress,
) -> bool {
    let Some(packed) = packed else { return true };
    packed.set_number(*number);
    let frame = packed.finish();
    let can_publish =
        frame.is_none_or(|frame| !sink.has_receivers() || publish(frame, sink, progress));
    *number = packed.number();
    can_publish
}

/// Decodes a packed block and publishes the frame that it completes. Every block is decoded,
/// because those after it build on it. Returns false if frames cannot be published any more.
fn run_block(
    packed: &mut PackedReconstruction,
    block: &TimedPackedBlock,
    sink: &mut dyn FrameSink,
    progress: &Progress,
) -> bool {
    let before = packed.malformed();
    let frame = packed.next_frame(block);
    let can_publish =
        frame.is_none_or(|frame| !sink.has_receivers() || publish(frame, sink, progress));
    let malformed = packed.malformed() - before;
    progress.malformed.fetch_add(malformed, Ordering::Relaxed);
    let decoded = u64::from(block.block.is_some()) - malformed;
    progress.decoded.fetch_add(decoded, Ordering::Relaxed);
    can_publish
}

/// Publishes a frame. Returns false if frames cannot be published any more.
fn publish(frame: &NeuroFrame, sink: &mut dyn FrameSink, progress: &Progress) -> bool {
    if let Err(error) = sink.publish(frame) {
        tracing::error!(%error, "reconstructed frames cannot be published any more");
        return false;
    }
    progress.dropped.store(sink.dropped(), Ordering::Relaxed);
    true
}

/// Number of windows that were decoded and that were not, by reason. Prints as a part of the
/// program's last line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DecoderCounts {
    /// Number of windows decoded so far.
    pub decoded: u64,
    /// Number of windows that wait for the decoder now.
    pub waiting: u64,
    /// Longest time that a window has waited for the decoder.
    pub longest_wait: Duration,
    /// Number of windows replaced by fillers because the decoder's queue was full, and of those
    /// that waited when the program ended.
    pub not_decoded: u64,
    /// Number of windows that were not decoded because `/neurodata_reconstructed` had no
    /// subscriber.
    pub not_needed: u64,
    /// Number of packed blocks that arrived intact, but are no blocks of the model; they count as
    /// lost.
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
