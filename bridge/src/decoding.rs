//! The thread that reconstructs.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

use neuro_ros::FrameSink;

use crate::{Reconstruction, Window};

/// Windows that may wait for the decoder: 16 s at 16 Hz. One takes some milliseconds.
const QUEUE_WINDOWS: usize = 256;

/// The thread that reconstructs and publishes, so that decoding delays no byte of the link.
#[derive(Debug)]
pub(crate) struct Decoding {
    work: Sender<Work>,
    waiting: Arc<AtomicUsize>,
    thread: JoinHandle<()>,
    undecoded: u64,
}

enum Work {
    /// Another device.
    Begin(Box<Reconstruction>),
    Window(Window),
}

impl Decoding {
    pub(crate) fn start(sink: Box<dyn FrameSink>) -> std::io::Result<Decoding> {
        let (work, receiver) = channel();
        let waiting = Arc::new(AtomicUsize::new(0));
        let left = Arc::clone(&waiting);
        let thread = std::thread::Builder::new()
            .name("decoder".to_owned())
            .spawn(move || decode(sink, &receiver, &left))?;
        Ok(Decoding {
            work,
            waiting,
            thread,
            undecoded: 0,
        })
    }

    /// Windows from here on belong to this device.
    pub(crate) fn begin(&self, reconstruction: Reconstruction) {
        // An error means that the thread has gone because its sink ended.
        let _ = self.work.send(Work::Begin(Box::new(reconstruction)));
    }

    /// Never waits. When too many wait already, the window's code is taken out and counted: the
    /// frame becomes a filler, which costs no time, and the number of samples stays right.
    pub(crate) fn window(&mut self, mut window: Window) {
        if self.waiting.fetch_add(1, Ordering::Relaxed) >= QUEUE_WINDOWS && window.z.is_some() {
            window.z = None;
            self.undecoded += 1;
        }
        let _ = self.work.send(Work::Window(window));
    }

    /// Finish what is queued; returns how many windows were not decoded.
    pub(crate) fn finish(self) -> u64 {
        drop(self.work);
        if self.thread.join().is_err() {
            tracing::error!("the decoder failed; reconstructed frames are missing");
        }
        self.undecoded
    }
}

fn decode(mut sink: Box<dyn FrameSink>, work: &Receiver<Work>, waiting: &AtomicUsize) {
    let mut reconstruction = None;
    for work in work {
        let window = match work {
            Work::Begin(new) => {
                reconstruction = Some(new);
                continue;
            }
            Work::Window(window) => window,
        };
        waiting.fetch_sub(1, Ordering::Relaxed);
        let Some(frame) = reconstruction
            .as_mut()
            .and_then(|known| known.push(&window))
        else {
            continue;
        };
        if let Err(error) = sink.publish(frame) {
            tracing::error!(%error, "reconstructed frames end here");
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use neuro_ros::{NeuroFrame, Sink, SinkError, Stamp};

    use super::{Decoding, Ordering, QUEUE_WINDOWS};
    use crate::{TriWords, Window};

    /// Counts frames.
    struct Count(Arc<Mutex<u64>>);

    impl Sink<NeuroFrame> for Count {
        fn publish(&mut self, _: &NeuroFrame) -> Result<(), SinkError> {
            *self.0.lock().unwrap() += 1;
            Ok(())
        }

        fn dropped(&self) -> u64 {
            0
        }
    }

    #[test]
    fn windows_that_find_no_room_are_counted() {
        let count = Arc::new(Mutex::new(0));
        let mut decoding = Decoding::start(Box::new(Count(Arc::clone(&count)))).unwrap();
        // More than the thread takes away meanwhile.
        decoding.waiting.store(2 * QUEUE_WINDOWS, Ordering::Relaxed);
        let (stamp, words) = (Stamp::default(), TriWords::default());
        for _ in 0..3 {
            let z = Some(Box::new([0.0; 128]));
            decoding.window(Window { z, stamp, words });
        }
        // No device was announced, so there is nothing to publish.
        assert_eq!(decoding.finish(), 3);
        assert_eq!(*count.lock().unwrap(), 0);
    }
}
