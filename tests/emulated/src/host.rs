//! Frames that host-sim's virtual board sends for the same samples.

use std::thread;
use std::time::Duration;

use host_sim::{Identity, Outbox, VirtualBoard, WhenFull};
use link::{Start, Streams};
use model::ADC_RATE_HZ;
use pipeline::{Mains, Sample};

/// Longest wait for the last frames to leave the queue.
const DRAIN_TIMEOUT: Duration = Duration::from_secs(20);

/// Bytes that a virtual board sends when it streams these samples from device time 0, with the default mains
/// frequency, as the image starts itself.
///
/// # Panics
/// When the virtual board drops a frame.
pub fn sent(streams: Streams, samples: &[Sample]) -> Vec<u8> {
    let outbox = Outbox::new(WhenFull::Wait);
    let identity = Identity {
        session_id: 0,
        chip_uid: [0; 12],
    };
    let mut board = VirtualBoard::new(identity, Mains::default(), outbox.clone());
    let sent = thread::scope(|scope| {
        let reader = scope.spawn(|| {
            let mut sent = Vec::new();
            while let Some(frame) = outbox.take() {
                sent.extend(frame);
                outbox.written();
            }
            sent
        });
        let start = Start {
            streams,
            mains_hz: 0,
        };
        board.start(start, 0);
        for (index, sample) in (0..).zip(samples) {
            board.sample(sample, index * 1_000_000 / u64::from(ADC_RATE_HZ));
        }
        outbox.drain(DRAIN_TIMEOUT);
        outbox.close();
        reader.join()
    });
    let sent = sent.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
    assert_eq!(outbox.dropped(), 0, "host-sim has dropped frames");
    sent
}
