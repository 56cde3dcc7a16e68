//! What host-sim's virtual board sends for the same samples.

use std::thread;
use std::time::Duration;

use host_sim::{Identity, Outbox, VirtualBoard, WhenFull};
use link::{Start, Streams};
use model::ADC_RATE_HZ;
use pipeline::{Mains, Sample};

use crate::benchmark::inputs::unusable;
use crate::failure::Failure;

/// What taking the last frames out of a queue may take.
const PATIENCE: Duration = Duration::from_secs(20);

/// What a virtual board sends when it takes the samples, with the start that the image gives itself.
///
/// # Errors
/// It drops a frame.
pub(super) fn sent(samples: &[Sample]) -> Result<Vec<u8>, Failure> {
    sent_of(Streams::CODES, samples)
}

/// The same of other streams.
///
/// # Errors
/// It drops a frame.
pub(super) fn sent_of(streams: Streams, samples: &[Sample]) -> Result<Vec<u8>, Failure> {
    let outbox = Outbox::new(WhenFull::Wait);
    let identity = Identity {
        session_id: 0,
        chip_uid: [0; 12],
    };
    let mut board = VirtualBoard::new(identity, Mains::default(), outbox.clone());
    let sent = thread::scope(|scope| {
        let reader = scope.spawn(|| {
            let mut sent = Vec::new();
            while let Some(frame) = outbox.pop() {
                sent.extend(frame);
                outbox.mark_written();
            }
            sent
        });
        let start = Start {
            streams,
            mains_hz: 0,
        };
        board.start(start, 0);
        for (index, sample) in (0..).zip(samples) {
            board.process_sample(sample, index * 1_000_000 / u64::from(ADC_RATE_HZ));
        }
        outbox.drain(PATIENCE);
        outbox.close();
        reader.join()
    });
    let sent = sent.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
    if outbox.dropped() > 0 {
        return Err(unusable(
            "host-sim has dropped frames; is the PC very busy?",
        ));
    }
    Ok(sent)
}
