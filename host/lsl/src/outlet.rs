//! The thread that sends frames and events through liblsl.

use std::collections::BTreeMap;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use bridge_core::StampPoint;

use crate::clock_map::ClockMap;
use crate::description::{Acquisition, Shape, StreamKind, events_info};
use crate::liblsl::{CallError, Functions, Outlet};
use crate::library::Library;
use crate::row_times::{IncreasingTimes, RowTimes};
use crate::sink::{EventSink, Frame, FrameSink, Job, SinkMaker, StampScale};

/// Longest time between two readings of the clocks.
const CLOCK_PERIOD: Duration = Duration::from_millis(100);
/// Time for which the streams stay open at the end, so that receivers get the newest samples.
const LINGER: Duration = Duration::from_millis(500);

/// Options of the streams.
#[derive(Clone, Debug)]
pub struct LslOptions {
    /// First part of the names of the streams, and of their source ids.
    pub name: String,
    /// Point in time to which a frame's stamp refers.
    pub stamp: StampPoint,
}

/// The streams of a bridge as outlets of the Lab Streaming Layer.
#[derive(Debug)]
pub struct Lsl {
    maker: SinkMaker,
    received: Arc<AtomicUsize>,
    thread: JoinHandle<()>,
}

impl Lsl {
    /// Starts the thread that sends.
    ///
    /// # Errors
    ///
    /// The operating system's error if no thread can be started.
    pub fn start(library: Library, options: LslOptions) -> io::Result<Lsl> {
        let (jobs, queued) = channel();
        let received = Arc::<AtomicUsize>::default();
        let failed = Arc::<AtomicBool>::default();
        let of_thread = (Arc::clone(&failed), Arc::clone(&received));
        let thread = std::thread::Builder::new().name("lsl".to_owned());
        let thread = thread.spawn(move || {
            let (failed, received) = of_thread;
            let mut streams = Streams::new(library.functions, options);
            if let Err(error) = streams.run(&queued, &received) {
                tracing::error!("Lab Streaming Layer: {error}");
                failed.store(true, Ordering::Relaxed);
            }
        })?;
        Ok(Lsl { maker: SinkMaker { jobs, failed, scale: Arc::default() }, received, thread })
    }

    /// Creates the sink of a stream. At most `room` frames wait; further frames are dropped.
    pub fn frames(&self, kind: StreamKind, room: usize) -> FrameSink {
        self.maker.frames(kind, room)
    }

    /// Creates the sink of events. At most `room` events wait; further events are dropped.
    pub fn events(&self, room: usize) -> EventSink {
        self.maker.events(room)
    }

    /// Returns the scale of the stamps. The caller must keep this scale up to date.
    pub fn scale(&self) -> Arc<StampScale> {
        Arc::clone(&self.maker.scale)
    }

    /// Sets the device that the following frames come from.
    pub fn set_device(&self, device: Acquisition) {
        // Fails only if the thread has failed, which the sinks report.
        let _ = self.maker.jobs.send(Job::Device(device));
    }

    /// Returns the number of streams that have a receiver at present.
    pub fn received(&self) -> usize {
        self.received.load(Ordering::Relaxed)
    }

    /// Sends what is queued, gives receivers half a second to take it, and closes the streams.
    pub fn finish(self) {
        let _ = self.maker.jobs.send(Job::End);
        if self.thread.join().is_err() {
            tracing::error!("the thread of the Lab Streaming Layer has panicked");
        }
    }
}

/// All open streams, in the thread that sends.
struct Streams {
    functions: &'static Functions,
    options: LslOptions,
    device: Acquisition,
    clock: ClockMap,
    signals: BTreeMap<&'static str, Signal>,
    /// Stream of events and of the beginnings and ends of fillers; `None` until the device is
    /// known.
    events: Option<Outlet>,
}

/// An open stream with a constant sampling rate.
struct Signal {
    outlet: Outlet,
    shape: Arc<Shape>,
    times: RowTimes,
    increasing: IncreasingTimes,
    /// Whether the newest sample was a filler.
    fills: bool,
}

impl Streams {
    fn new(functions: &'static Functions, options: LslOptions) -> Streams {
        Streams {
            functions,
            options,
            device: Acquisition::default(),
            clock: ClockMap::default(),
            signals: BTreeMap::new(),
            events: None,
        }
    }

    /// Handles queued jobs until [`Job::End`].
    fn run(&mut self, queued: &Receiver<Job>, received: &AtomicUsize) -> Result<(), CallError> {
        loop {
            let job = queued.recv_timeout(CLOCK_PERIOD);
            self.clock.read(|| self.functions.local_clock());
            match job {
                Ok(Job::Device(device)) => self.set_device(device)?,
                Ok(Job::Frame(frame)) => {
                    frame.queue.take();
                    self.send(&frame)?;
                }
                Ok(Job::Event { text, host_us, queue }) => {
                    queue.take();
                    self.mark(&text, self.clock.lsl_s(host_us).unwrap_or_default())?;
                }
                Err(RecvTimeoutError::Timeout) => {}
                Ok(Job::End) | Err(RecvTimeoutError::Disconnected) => break,
            }
            received.store(self.received(), Ordering::Relaxed);
        }
        if self.received() > 0 {
            std::thread::sleep(LINGER);
        }
        Ok(())
    }

    /// Returns the number of streams that have a receiver.
    fn received(&self) -> usize {
        let signals = self.signals.values().map(|signal| &signal.outlet);
        let outlets = signals.chain(&self.events);
        outlets.filter(|outlet| outlet.has_receivers()).count()
    }

    /// Sets the device. If the device has changed or no stream of events is open, closes all
    /// streams, and opens the stream of events.
    fn set_device(&mut self, device: Acquisition) -> Result<(), CallError> {
        if self.events.is_some() && device == self.device {
            return Ok(());
        }
        self.device = device;
        self.signals.clear();
        self.events = None;
        let info = events_info(self.functions, &self.options.name, &self.device)?;
        self.events = Some(Outlet::new(&info)?);
        Ok(())
    }

    /// Sends the samples of a frame, and marks where fillers begin and end. A stream opens with its
    /// first frame, and opens again when a frame has another shape.
    fn send(&mut self, frame: &Frame) -> Result<(), CallError> {
        let kind = frame.shape.kind;
        let known = self.signals.get(kind.name());
        if known.is_none_or(|known| known.shape != frame.shape) {
            // Close the old stream first: two streams with one source id would confuse receivers.
            self.signals.remove(kind.name());
            let signal = self.open(&frame.shape)?;
            self.signals.insert(kind.name(), signal);
        }
        let Some(signal) = self.signals.get_mut(kind.name()) else {
            return Ok(());
        };
        let (rows, holds_fillers) = (frame.fillers.len(), frame.fillers.contains(&true));
        let host_us = signal.times.of_frame(frame.stamp_us, rows, holds_fillers);
        let times_s = host_us.map(|us| self.clock.lsl_s(us).unwrap_or_default());
        let mut times_s: Vec<f64> = times_s.collect();
        signal.increasing.apply(&mut times_s);
        let mut marks = Vec::new();
        for (is_filler, time_s) in frame.fillers.iter().zip(&times_s) {
            if std::mem::replace(&mut signal.fills, *is_filler) != *is_filler {
                let change = if *is_filler { "begin" } else { "end" };
                marks.push((format!("filler {change} {}", kind.name()), *time_s));
            }
        }
        signal.outlet.push(&frame.values, &times_s)?;
        for (text, time_s) in marks {
            self.mark(&text, time_s)?;
        }
        Ok(())
    }

    fn open(&self, shape: &Arc<Shape>) -> Result<Signal, CallError> {
        let info = shape.info(self.functions, &self.options.name, &self.device)?;
        Ok(Signal {
            outlet: Outlet::new(&info)?,
            shape: Arc::clone(shape),
            times: RowTimes::new(shape.rate_hz, self.options.stamp),
            increasing: IncreasingTimes::default(),
            fills: false,
        })
    }

    /// Sends an event with a time on liblsl's clock, seconds.
    fn mark(&self, text: &str, time_s: f64) -> Result<(), CallError> {
        match &self.events {
            Some(events) => events.push_text(text, time_s),
            None => Ok(()),
        }
    }
}
