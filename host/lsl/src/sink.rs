//! The sinks of frames and events. They put messages into the queue of the thread that sends, and
//! never wait.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI64, AtomicUsize, Ordering};
use std::sync::mpsc::Sender;

use bridge_core::HostTime;
use neuro_ros::{NeuroEvent, NeuroFrame, Sink, SinkError, TRI_LABELS};

use crate::description::{Acquisition, Shape, StreamKind};

/// Flag in a sample's first status word: the sample replaces a lost one.
const FILLER: i32 = 0x8000;

/// Relates the bridge's stamps to the host's monotonic time and its event stamps to the events, at
/// present; shared by all sinks.
#[derive(Debug)]
pub struct StampScale {
    /// Stamp minus the host's monotonic time, nanoseconds.
    offset_ns: AtomicI64,
    /// Time by which stamps of events are later than the events, microseconds.
    event_shift_us: AtomicI64,
}

impl Default for StampScale {
    fn default() -> StampScale {
        let now = HostTime::now();
        StampScale {
            offset_ns: AtomicI64::new(now.wall_ns - now.monotonic_us * 1000),
            event_shift_us: AtomicI64::new(0),
        }
    }
}

impl StampScale {
    /// Sets by how much stamps are larger than the host's monotonic time, nanoseconds, and by how
    /// much stamps of events are later than the events themselves, microseconds.
    pub fn set(&self, offset_ns: i64, event_shift_us: i64) {
        self.offset_ns.store(offset_ns, Ordering::Relaxed);
        self.event_shift_us.store(event_shift_us, Ordering::Relaxed);
    }

    /// Converts a stamp to the host's monotonic time, microseconds.
    #[expect(
        clippy::cast_precision_loss,
        reason = "the difference is below 2^53 ns (104 days) times 1000"
    )]
    fn host_us(&self, stamp_ns: i64) -> f64 {
        (stamp_ns - self.offset_ns.load(Ordering::Relaxed)) as f64 * 1e-3
    }
}

/// Work that the sinks queue for the thread.
pub(crate) enum Job {
    /// The device that the following frames come from.
    Device(Acquisition),
    Frame(Frame),
    Event {
        text: String,
        host_us: f64,
        queue: Arc<Queue>,
    },
    /// Send what is queued, and end.
    End,
}

/// Samples for one stream.
pub(crate) struct Frame {
    pub(crate) shape: Arc<Shape>,
    /// Values, sample by sample: the electrodes, then the spare channels.
    pub(crate) values: Vec<f32>,
    /// Whether each sample replaces a lost one.
    pub(crate) fillers: Vec<bool>,
    /// Time of the stamp on the host's monotonic clock, microseconds.
    pub(crate) stamp_us: f64,
    pub(crate) queue: Arc<Queue>,
}

/// Number of waiting messages of one sink, and the limit of this number.
#[derive(Debug)]
pub(crate) struct Queue {
    waiting: AtomicUsize,
    room: usize,
}

impl Queue {
    /// Notes that the thread has taken a message.
    pub(crate) fn take(&self) {
        self.waiting.fetch_sub(1, Ordering::Relaxed);
    }
}

/// The sink's end of the queue. Counts the messages for which there is no room.
#[derive(Debug)]
struct Entry {
    jobs: Sender<Job>,
    queue: Arc<Queue>,
    dropped: u64,
    /// Whether the thread cannot send any more.
    failed: Arc<AtomicBool>,
}

impl Entry {
    /// Queues the job that `job` returns, or counts it as dropped if there is no room.
    fn push(&mut self, job: impl FnOnce(Arc<Queue>) -> Job) -> Result<(), SinkError> {
        if self.failed.load(Ordering::Relaxed) {
            return Err(SinkError::Closed);
        }
        if self.queue.waiting.load(Ordering::Relaxed) >= self.queue.room {
            self.dropped += 1;
            return Ok(());
        }
        self.queue.waiting.fetch_add(1, Ordering::Relaxed);
        let job = job(Arc::clone(&self.queue));
        self.jobs.send(job).map_err(|_| SinkError::Closed)
    }
}

/// Creates the sinks of one [`Lsl`](crate::Lsl).
#[derive(Clone, Debug)]
pub(crate) struct SinkMaker {
    pub(crate) jobs: Sender<Job>,
    pub(crate) failed: Arc<AtomicBool>,
    pub(crate) scale: Arc<StampScale>,
}

impl SinkMaker {
    fn entry(&self, room: usize) -> Entry {
        Entry {
            jobs: self.jobs.clone(),
            queue: Arc::new(Queue { waiting: AtomicUsize::new(0), room }),
            dropped: 0,
            failed: Arc::clone(&self.failed),
        }
    }

    pub(crate) fn frames(&self, kind: StreamKind, room: usize) -> FrameSink {
        FrameSink { kind, shape: None, entry: self.entry(room), scale: Arc::clone(&self.scale) }
    }

    pub(crate) fn events(&self, room: usize) -> EventSink {
        EventSink { entry: self.entry(room), scale: Arc::clone(&self.scale) }
    }
}

/// Sink of the frames of one stream; created by [`Lsl::frames`](crate::Lsl::frames).
#[derive(Debug)]
pub struct FrameSink {
    kind: StreamKind,
    shape: Option<Arc<Shape>>,
    entry: Entry,
    scale: Arc<StampScale>,
}

impl Sink<NeuroFrame> for FrameSink {
    fn publish(&mut self, frame: &NeuroFrame) -> Result<(), SinkError> {
        let shape = match &self.shape {
            Some(shape) if shape.is_of(frame) => Arc::clone(shape),
            _ => Arc::clone(self.shape.insert(Shape::new(self.kind, frame))),
        };
        let stamp_us = self.scale.host_us(frame.header.stamp.nanoseconds());
        self.entry.push(|queue| {
            Job::Frame(Frame {
                values: values(frame),
                fillers: fillers(frame),
                shape,
                stamp_us,
                queue,
            })
        })
    }

    fn dropped(&self) -> u64 {
        self.entry.dropped
    }
}

/// Returns the frame's values sample by sample: in each sample the electrodes, then the spare
/// channels.
fn values(frame: &NeuroFrame) -> Vec<f32> {
    let (eeg, exg) = (&frame.eeg, &frame.exg);
    if exg.data.is_empty() {
        return eeg.data.clone();
    }
    let rows = eeg.data.chunks_exact(eeg.info.labels.len().max(1));
    let spare = exg.data.chunks_exact(exg.info.labels.len().max(1));
    let rows = rows.zip(spare);
    rows.flat_map(|(eeg, exg)| eeg.iter().chain(exg)).copied().collect()
}

/// Returns whether each sample replaces a lost one.
fn fillers(frame: &NeuroFrame) -> Vec<bool> {
    let rows = frame.tri.data.chunks_exact(TRI_LABELS.len());
    rows.map(|words| words[0] & FILLER != 0).collect()
}

/// Sink of events; created by [`Lsl::events`](crate::Lsl::events).
#[derive(Debug)]
pub struct EventSink {
    entry: Entry,
    scale: Arc<StampScale>,
}

impl Sink<NeuroEvent> for EventSink {
    fn publish(&mut self, event: &NeuroEvent) -> Result<(), SinkError> {
        let shift_ns = self.scale.event_shift_us.load(Ordering::Relaxed) * 1000;
        let host_us = self.scale.host_us(event.header.stamp.nanoseconds() - shift_ns);
        let text = event.description.clone();
        self.entry.push(|queue| Job::Event { text, host_us, queue })
    }

    fn dropped(&self) -> u64 {
        self.entry.dropped
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use neuro_ros::NeuroDataInfo;

    use super::*;

    fn frame(electrodes: u16, spare: u16) -> NeuroFrame {
        let info = |count: u16| NeuroDataInfo {
            nsamples: 2,
            ..NeuroDataInfo::default().with_labels((0..count).map(|i| i.to_string()).collect())
        };
        let mut frame = NeuroFrame::zeros(512, "electrodes", info(electrodes), info(spare));
        frame.eeg.data = (0..2 * electrodes).map(f32::from).collect();
        frame.exg.data = (0..2 * spare).map(|value| f32::from(100 + value)).collect();
        frame.tri.data[8] = FILLER | 1;
        frame
    }

    #[test]
    fn what_finds_no_room_is_counted_and_a_dead_thread_is_an_error() {
        let (jobs, received) = channel();
        let failed = Arc::<AtomicBool>::default();
        let maker = SinkMaker { jobs, failed: Arc::clone(&failed), scale: Arc::default() };
        let (mut small, mut large) =
            (maker.frames(StreamKind::Raw, 3), maker.frames(StreamKind::Codes, 100));
        for _ in 0..10 {
            small.publish(&frame(2, 1)).unwrap();
            large.publish(&frame(2, 0)).unwrap();
        }
        assert_eq!((small.dropped(), large.dropped()), (7, 0));
        // When the thread has taken a message, the queue has room for another one.
        let Ok(Job::Frame(first)) = received.recv() else {
            panic!("no frame");
        };
        first.queue.take();
        small.publish(&frame(2, 1)).unwrap();
        assert_eq!(small.dropped(), 7);
        assert_eq!(first.values, [0.0, 1.0, 100.0, 2.0, 3.0, 101.0]);
        assert_eq!(first.fillers, [false, true]);
        failed.store(true, Ordering::Relaxed);
        assert!(matches!(large.publish(&frame(2, 0)), Err(SinkError::Closed)));
    }

    #[test]
    fn the_shape_is_shared_until_a_frame_has_another() {
        let (jobs, received) = channel();
        let maker = SinkMaker { jobs, failed: Arc::default(), scale: Arc::default() };
        let mut sink = maker.frames(StreamKind::Raw, 10);
        for electrodes in [2, 2, 3] {
            sink.publish(&frame(electrodes, 1)).unwrap();
        }
        let shapes: Vec<Arc<Shape>> = received
            .try_iter()
            .map(|job| match job {
                Job::Frame(frame) => frame.shape,
                _ => panic!("no frame"),
            })
            .collect();
        assert!(Arc::ptr_eq(&shapes[0], &shapes[1]));
        assert_eq!((shapes[1].channels(), shapes[2].channels()), (3, 4));
    }

    #[test]
    fn events_have_the_time_at_which_they_happened() {
        let (jobs, received) = channel();
        let scale = Arc::<StampScale>::default();
        scale.set(5_000_000_000, 250_000);
        let maker = SinkMaker { jobs, failed: Arc::default(), scale };
        let mut event = NeuroEvent::on_bus();
        event.header.stamp = neuro_ros::Stamp::from_nanoseconds(7_500_000_000);
        maker.events(10).publish(&event).unwrap();
        let Ok(Job::Event { host_us, .. }) = received.recv() else {
            panic!("no event");
        };
        assert!((host_us - 2_250_000.0).abs() < 1e-3, "{host_us}");
    }
}
