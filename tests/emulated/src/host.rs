//! Frames that host-sim's virtual board sends for the same samples.

use std::time::Duration;

use host_sim::{Identity, Outbox, VirtualBoard, WhenFull};
use link::{Start, Streams};
use model::ADC_RATE_HZ;
use pipeline::{Mains, Sample};

/// Returns the bytes that host-sim's virtual board sends when it streams these samples. The board
/// starts at device time 0 with the default mains frequency, as the image does with the argument
/// `start`.
///
/// # Panics
/// When the outbox is closed, which does not happen.
pub fn sent(streams: Streams, samples: &[Sample]) -> Vec<u8> {
    let identity = Identity {
        session_id: 0,
        chip_uid: [0; 12],
        ..Identity::default()
    };
    // This outbox grows, so the board drops no frame.
    let outbox = Outbox::new(WhenFull::Wait);
    let mut board = VirtualBoard::new(identity, Mains::default(), outbox.clone());
    let start = Start {
        streams,
        mains_hz: 0,
    };
    board.start(start, 0);
    for (index, sample) in (0..).zip(samples) {
        board.process_sample(sample, index * 1_000_000 / u64::from(ADC_RATE_HZ));
    }
    let mut sent = Vec::new();
    while !outbox.drain(Duration::ZERO) {
        sent.extend(outbox.pop().expect("the outbox is open"));
        outbox.mark_written();
    }
    sent
}
