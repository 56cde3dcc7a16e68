//! The thread that reconstructs.

use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;

use neuro_ros::FrameSink;

use crate::{Reconstruction, Window};

/// Windows that may wait for the decoder: 16 s at 16 Hz. One takes some milliseconds.
const QUEUE_WINDOWS: usize = 256;

/// The thread that reconstructs and publishes, so that decoding delays no byte of the link.
#[derive(Debug)]
pub(crate) struct Decoding {
    work: SyncSender<Work>,
    thread: JoinHandle<()>,
    dropped: u64,
}

enum Work {
    /// Another device.
    Begin(Box<Reconstruction>),
    Window(Window),
}

impl Decoding {
    pub(crate) fn start(sink: Box<dyn FrameSink>) -> std::io::Result<Decoding> {
        let (work, receiver) = sync_channel(QUEUE_WINDOWS);
        let thread = std::thread::Builder::new()
            .name("decoder".to_owned())
            .spawn(move || decode(sink, &receiver))?;
        Ok(Decoding {
            work,
            thread,
            dropped: 0,
        })
    }

    /// Windows from here on belong to this device.
    pub(crate) fn begin(&self, reconstruction: Reconstruction) {
        // Waits for room, some milliseconds: happens once per device, and must not be lost. An
        // error means that the thread has gone because its sink ended.
        let _ = self.work.send(Work::Begin(Box::new(reconstruction)));
    }

    /// Never waits; what finds no room is dropped and counted.
    pub(crate) fn window(&mut self, window: Window) {
        if let Err(TrySendError::Full(_)) = self.work.try_send(Work::Window(window)) {
            self.dropped += 1;
        }
    }

    /// Finish what is queued; returns how many windows were dropped.
    pub(crate) fn finish(self) -> u64 {
        drop(self.work);
        if self.thread.join().is_err() {
            tracing::error!("the decoder failed; reconstructed frames are missing");
        }
        self.dropped
    }
}

fn decode(mut sink: Box<dyn FrameSink>, work: &Receiver<Work>) {
    let mut reconstruction = None;
    for work in work {
        match (work, &mut reconstruction) {
            (Work::Begin(new), reconstruction) => *reconstruction = Some(new),
            (Work::Window(_), None) => {}
            (Work::Window(window), Some(reconstruction)) => {
                let Some(frame) = reconstruction.push(&window) else {
                    continue;
                };
                if let Err(error) = sink.publish(frame) {
                    tracing::error!(%error, "reconstructed frames end here");
                    return;
                }
            }
        }
    }
}
