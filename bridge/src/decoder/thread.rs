//! The thread that decodes codes and audits them.

use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use neuro_ros::{DiagnosticStatus, FrameSink};

use crate::decoder::audit::AuditedWindow;
use crate::decoder::counts::DecoderCounts;
use crate::decoder::model::Model;
use crate::decoder::reconstruction::{Reconstruction, TimedCode};
use crate::diagnostics::audit::AuditCounts;

/// Maximum number of codes that wait for the decoder: 68 minutes at 16 codes per second, as long
/// as the longest gap that is filled. A waiting code takes about 0.6 KB, so a full queue takes
/// 40 MB.
const QUEUE_WINDOWS: u64 = 65_536;

/// Maximum number of audits that wait for this thread. One audit arrives every 10 s, and its
/// comparison takes about 10 ms.
const QUEUE_AUDITS: usize = 4;

/// How much less urgent than the rest of the program the decoder is, in steps of Unix's `nice`.
const NICE: i32 = 10;

/// Thread that decodes codes, publishes the reconstructed signals and compares audits, so that this
/// work does not delay the link.
#[derive(Debug)]
pub(crate) struct DecoderThread {
    work: Sender<Work>,
    progress: Arc<Progress>,
    thread: JoinHandle<()>,
    not_decoded: u64,
    skipped_audits: u64,
}

/// Lengths of the queues, and what the thread has done.
#[derive(Debug, Default)]
struct Progress {
    /// Number of queued codes; placeholders for lost codes do not count.
    waiting: AtomicU64,
    decoded: AtomicU64,
    not_needed: AtomicU64,
    longest_wait_us: AtomicU64,
    /// Number of frames that were dropped for slow subscribers.
    dropped: AtomicU64,
    audits_waiting: AtomicUsize,
    audits: Mutex<AuditCounts>,
}

enum Work {
    /// Reconstruction for the device that sends the codes queued after this item.
    Device(Box<Reconstruction>),
    /// A code, and when it was queued.
    Code(TimedCode, Instant),
    Audit(Box<AuditedWindow>, Arc<Model>),
}

impl DecoderThread {
    pub(crate) fn start(sink: Box<dyn FrameSink>) -> std::io::Result<DecoderThread> {
        let (work, receiver) = channel();
        let progress = Arc::new(Progress::default());
        let thread_progress = Arc::clone(&progress);
        let thread = std::thread::Builder::new()
            .name("decoder".to_owned())
            .spawn(move || run(sink, &receiver, &thread_progress))?;
        Ok(DecoderThread {
            work,
            progress,
            thread,
            not_decoded: 0,
            skipped_audits: 0,
        })
    }

    /// Sets the reconstruction for the device that sends the following codes.
    pub(crate) fn start_device(&self, reconstruction: Reconstruction) {
        // Sending fails only if the thread has ended because its sink failed.
        let _ = self.work.send(Work::Device(Box::new(reconstruction)));
    }

    /// Queues a code without blocking. If the queue is full, the code is discarded and counted, and
    /// a filler is published in its place. Fillers need no decoding and keep the number of samples
    /// correct.
    pub(crate) fn decode(&mut self, mut window: TimedCode) {
        if window.z.is_some() {
            if self.progress.waiting.load(Ordering::Relaxed) < QUEUE_WINDOWS {
                self.progress.waiting.fetch_add(1, Ordering::Relaxed);
            } else {
                window.z = None;
                self.not_decoded += 1;
            }
        }
        let _ = self.work.send(Work::Code(window, Instant::now()));
    }

    /// Queues an audit without blocking. If the queue is full, the audit is skipped and counted.
    pub(crate) fn audit(&mut self, window: AuditedWindow, model: Arc<Model>) {
        if self.progress.audits_waiting.load(Ordering::Relaxed) >= QUEUE_AUDITS {
            self.skipped_audits += 1;
            return;
        }
        self.progress.audits_waiting.fetch_add(1, Ordering::Relaxed);
        let _ = self.work.send(Work::Audit(Box::new(window), model));
    }

    /// Returns the results of the audits for `/diagnostics`; `None` before the first audit.
    pub(crate) fn audit_status(&self) -> Option<DiagnosticStatus> {
        let counts = self.progress.audits.lock();
        let counts = counts.unwrap_or_else(PoisonError::into_inner);
        counts.status(self.skipped_audits)
    }

    pub(crate) fn counts(&self) -> DecoderCounts {
        self.progress.counts(self.not_decoded)
    }

    /// Number of frames that were dropped for slow subscribers.
    pub(crate) fn dropped(&self) -> u64 {
        self.progress.dropped.load(Ordering::Relaxed)
    }

    /// Returns whether the thread has ended, after which no signals are reconstructed.
    pub(crate) fn has_ended(&self) -> bool {
        self.thread.is_finished()
    }

    /// Waits until the queue is empty and returns the final counts.
    pub(crate) fn finish(self) -> DecoderCounts {
        drop(self.work);
        if self.thread.join().is_err() {
            tracing::error!("the decoder thread panicked; reconstructed frames are missing");
        }
        self.progress.counts(self.not_decoded)
    }
}

impl Progress {
    fn counts(&self, not_decoded: u64) -> DecoderCounts {
        DecoderCounts {
            decoded: self.decoded.load(Ordering::Relaxed),
            waiting: self.waiting.load(Ordering::Relaxed),
            longest_wait: Duration::from_micros(self.longest_wait_us.load(Ordering::Relaxed)),
            not_decoded,
            not_needed: self.not_needed.load(Ordering::Relaxed),
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
    for work in work {
        let (window, queued) = match work {
            Work::Device(mut new) => {
                if let Some(before) = &reconstruction {
                    new.continue_from(before);
                }
                reconstruction = Some(new);
                continue;
            }
            Work::Audit(window, model) => {
                let result = window.compare(&model);
                progress.audits_waiting.fetch_sub(1, Ordering::Relaxed);
                if result.is_wrong() {
                    tracing::error!(?result, "the device's code differs from its model");
                }
                let counts = progress.audits.lock();
                counts
                    .unwrap_or_else(PoisonError::into_inner)
                    .record(result);
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
        let frame = known.next_frame(&window);
        if holds_code {
            progress.decoded.fetch_add(1, Ordering::Relaxed);
        }
        let Some(frame) = frame else { continue };
        if let Err(error) = sink.publish(frame) {
            tracing::error!(%error, "reconstructed frames cannot be published any more");
            return;
        }
        progress.dropped.store(sink.dropped(), Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use link::{CODE_LEN, Capabilities, Hello, ResetCause};
    use neuro_ros::{NeuroFrame, Sink, SinkError, Stamp};

    use super::{DecoderThread, Ordering, QUEUE_WINDOWS};
    use crate::decoder::model::Model;
    use crate::decoder::reconstruction::{Reconstruction, TimedCode};
    use crate::device::Device;
    use crate::settings::{AnnouncedStream, EventStamps, FillerPolicy, Settings, StampPoint};
    use crate::streams::tri::TriWords;

    /// Sink that records the sequence number of every frame.
    struct Numbers(Arc<Mutex<Vec<u32>>>);

    impl Sink<NeuroFrame> for Numbers {
        fn publish(&mut self, frame: &NeuroFrame) -> Result<(), SinkError> {
            self.0.lock().unwrap().push(frame.neuroheader.seq);
            Ok(())
        }

        fn dropped(&self) -> u64 {
            0
        }
    }

    fn reconstruction() -> Reconstruction {
        let model = Arc::new(Model::embedded().unwrap());
        let labels = model.electrodes().join(" ");
        let hello = Hello {
            firmware: "test",
            board: "board",
            chip_uid: [7; 12],
            model_id: model.id(),
            session_id: 1,
            reset_cause: ResetCause::PowerOn,
            fault: "",
        };
        let capabilities = Capabilities {
            adc_rate_hz: 512,
            step_rate_hz: 128,
            window_steps: 16,
            hop_steps: 8,
            channels: 64,
            lsb_nv: 22.351_742,
            mains_hz: 50,
            group_delay_us: 10_000,
            labels: &labels,
            filters: "none",
            code_format: link::CodeFormat::Int8,
            code_scale: heapless::Vec::from_array([0.5; CODE_LEN]),
            code_zero_point: heapless::Vec::from_array([1; CODE_LEN]),
        };
        let device = Device::new(&hello, &capabilities).unwrap();
        let settings = Settings {
            stamp: StampPoint::First,
            mains_hz: 0,
            filler: FillerPolicy::Last,
            low_latency: false,
            announced: AnnouncedStream::Encoded,
            streams: link::Streams::CODES,
            event_stamps: EventStamps::Scalp,
        };
        Reconstruction::new(&device, model, settings)
    }

    #[test]
    fn codes_beyond_a_full_queue_are_counted() {
        let count = Arc::new(Mutex::new(Vec::new()));
        let mut decoder = DecoderThread::start(Box::new(Numbers(Arc::clone(&count)))).unwrap();
        // Simulate more waiting codes than the thread can decode during this test.
        decoder
            .progress
            .waiting
            .store(QUEUE_WINDOWS, Ordering::Relaxed);
        let (stamp, words) = (Stamp::default(), TriWords::default());
        for _ in 0..3 {
            let z = Some(Box::new([0.0; 128]));
            decoder.decode(TimedCode { z, stamp, words });
        }
        // No device was announced with `start_device`, so there is nothing to publish.
        assert_eq!(decoder.finish().not_decoded, 3);
        assert!(count.lock().unwrap().is_empty());
    }

    #[test]
    fn every_filler_of_a_long_outage_is_published_and_numbers_continue_with_another_device() {
        let count = Arc::new(Mutex::new(Vec::new()));
        let mut decoder = DecoderThread::start(Box::new(Numbers(Arc::clone(&count)))).unwrap();
        for _ in 0..2 {
            decoder.start_device(reconstruction());
            for window in 0..2500 {
                decoder.decode(TimedCode {
                    z: None,
                    stamp: Stamp::default(),
                    words: TriWords {
                        window,
                        ..TriWords::default()
                    },
                });
            }
        }
        assert_eq!(decoder.dropped(), 0);
        assert_eq!(decoder.finish().not_decoded, 0);
        assert_eq!(*count.lock().unwrap(), (1..=5000).collect::<Vec<u32>>());
    }

    #[test]
    fn every_code_of_a_burst_after_a_stall_is_decoded() {
        let count = Arc::new(Mutex::new(Vec::new()));
        let mut decoder = DecoderThread::start(Box::new(Numbers(Arc::clone(&count)))).unwrap();
        decoder.start_device(reconstruction());
        // 37 s of codes at once, far more than the thread decodes meanwhile.
        for window in 0..600 {
            decoder.decode(TimedCode {
                z: Some(Box::new([0.0; CODE_LEN])),
                stamp: Stamp::default(),
                words: TriWords {
                    window,
                    ..TriWords::default()
                },
            });
        }
        let counts = decoder.finish();
        assert_eq!((counts.decoded, counts.not_decoded), (600, 0));
        assert_eq!((counts.waiting, count.lock().unwrap().len()), (0, 600));
        assert!(counts.longest_wait > std::time::Duration::ZERO);
    }
}
