//! The thread that decodes codes and audits them.

use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

use neuro_ros::{DiagnosticStatus, FrameSink};

use crate::decoder::audit::AuditedWindow;
use crate::decoder::model::Model;
use crate::decoder::reconstruction::{Reconstruction, TimedCode};
use crate::diagnostics::audit::AuditCounts;

/// Maximum number of codes that wait for the decoder: 16 s at 16 codes per second. Decoding a code
/// takes several milliseconds.
const QUEUE_WINDOWS: usize = 256;

/// Maximum number of audits that wait for this thread. One audit arrives every 10 s, and its
/// comparison takes about 10 ms.
const QUEUE_AUDITS: usize = 4;

/// Thread that decodes codes, publishes the reconstructed signals and compares audits, so that this
/// work does not delay the link.
#[derive(Debug)]
pub(crate) struct DecoderThread {
    work: Sender<Work>,
    waiting: Arc<AtomicUsize>,
    dropped: Arc<AtomicU64>,
    thread: JoinHandle<()>,
    undecoded: u64,
    audits: Arc<Audits>,
    skipped_audits: u64,
}

/// Number of queued audits, and the results of the finished ones.
#[derive(Debug, Default)]
struct Audits {
    waiting: AtomicUsize,
    counts: Mutex<AuditCounts>,
}

enum Work {
    /// Reconstruction for the device that sends the codes queued after this item.
    Device(Box<Reconstruction>),
    Code(TimedCode),
    Audit(Box<AuditedWindow>, Arc<Model>),
}

impl DecoderThread {
    pub(crate) fn start(sink: Box<dyn FrameSink>) -> std::io::Result<DecoderThread> {
        let (work, receiver) = channel();
        let waiting = Arc::new(AtomicUsize::new(0));
        let thread_waiting = Arc::clone(&waiting);
        let dropped = Arc::new(AtomicU64::new(0));
        let thread_dropped = Arc::clone(&dropped);
        let audits = Arc::new(Audits::default());
        let results = Arc::clone(&audits);
        let thread = std::thread::Builder::new()
            .name("decoder".to_owned())
            .spawn(move || run(sink, &receiver, &thread_waiting, &thread_dropped, &results))?;
        Ok(DecoderThread {
            work,
            waiting,
            dropped,
            thread,
            undecoded: 0,
            audits,
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
        if self.waiting.fetch_add(1, Ordering::Relaxed) >= QUEUE_WINDOWS && window.z.is_some() {
            window.z = None;
            self.undecoded += 1;
        }
        let _ = self.work.send(Work::Code(window));
    }

    /// Queues an audit without blocking. If the queue is full, the audit is skipped and counted.
    pub(crate) fn audit(&mut self, window: AuditedWindow, model: Arc<Model>) {
        if self.audits.waiting.load(Ordering::Relaxed) >= QUEUE_AUDITS {
            self.skipped_audits += 1;
            return;
        }
        self.audits.waiting.fetch_add(1, Ordering::Relaxed);
        let _ = self.work.send(Work::Audit(Box::new(window), model));
    }

    /// Returns the results of the audits for `/diagnostics`; `None` before the first audit.
    pub(crate) fn audit_status(&self) -> Option<DiagnosticStatus> {
        let counts = self.audits.counts.lock();
        let counts = counts.unwrap_or_else(PoisonError::into_inner);
        counts.status(self.skipped_audits)
    }

    /// Number of codes that were not decoded because the queue was full.
    pub(crate) fn undecoded(&self) -> u64 {
        self.undecoded
    }

    /// Number of frames that were dropped for slow subscribers.
    pub(crate) fn dropped(&self) -> u64 {
        self.dropped.load(Ordering::Relaxed)
    }

    /// Returns whether the thread has ended, after which no signals are reconstructed.
    pub(crate) fn has_ended(&self) -> bool {
        self.thread.is_finished()
    }

    /// Waits until the queue is empty and returns the number of codes that were not decoded.
    pub(crate) fn finish(self) -> u64 {
        drop(self.work);
        if self.thread.join().is_err() {
            tracing::error!("the decoder thread panicked; reconstructed frames are missing");
        }
        self.undecoded
    }
}

fn run(
    mut sink: Box<dyn FrameSink>,
    work: &Receiver<Work>,
    waiting: &AtomicUsize,
    dropped: &AtomicU64,
    audits: &Audits,
) {
    let mut reconstruction: Option<Box<Reconstruction>> = None;
    for work in work {
        let window = match work {
            Work::Device(mut new) => {
                if let Some(before) = &reconstruction {
                    new.continue_from(before);
                }
                reconstruction = Some(new);
                continue;
            }
            Work::Audit(window, model) => {
                let result = window.compare(&model);
                audits.waiting.fetch_sub(1, Ordering::Relaxed);
                if result.is_wrong() {
                    tracing::error!(?result, "the device's code differs from its model");
                }
                let counts = audits.counts.lock();
                counts
                    .unwrap_or_else(PoisonError::into_inner)
                    .record(result);
                continue;
            }
            Work::Code(window) => window,
        };
        waiting.fetch_sub(1, Ordering::Relaxed);
        let Some(frame) = reconstruction
            .as_mut()
            .and_then(|known| known.next_frame(&window))
        else {
            continue;
        };
        if let Err(error) = sink.publish(frame) {
            tracing::error!(%error, "reconstructed frames cannot be published any more");
            return;
        }
        dropped.store(sink.dropped(), Ordering::Relaxed);
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
        decoder.waiting.store(2 * QUEUE_WINDOWS, Ordering::Relaxed);
        let (stamp, words) = (Stamp::default(), TriWords::default());
        for _ in 0..3 {
            let z = Some(Box::new([0.0; 128]));
            decoder.decode(TimedCode { z, stamp, words });
        }
        // No device was announced with `start_device`, so there is nothing to publish.
        assert_eq!(decoder.finish(), 3);
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
        assert_eq!((decoder.undecoded(), decoder.dropped()), (0, 0));
        assert_eq!(decoder.finish(), 0);
        assert_eq!(*count.lock().unwrap(), (1..=5000).collect::<Vec<u32>>());
    }
}
