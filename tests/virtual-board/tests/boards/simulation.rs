//! What host-sim sends for the samples that the virtual converters deliver.

use std::thread;
use std::time::Duration;

use host_sim::{Identity, Outbox, VirtualBoard as Simulator, WhenFull};
use link::{Encoder, MAX_FRAME, Start, Streams, ToDevice};
use pipeline::{Mains, Sample};
use virtual_board::{Inbox, eeg};

/// Number of samples between the starts of two windows or packed blocks.
pub(crate) const HOP: u64 = 32;

/// Returns what host-sim sends after `commands` and a `Start` of `streams`, for `samples` samples, starting with
/// sample `first`.
pub(crate) fn simulated(
    streams: Streams,
    commands: &[ToDevice],
    first: u64,
    samples: u64,
) -> Inbox {
    let outbox = Outbox::new(WhenFull::Wait);
    let identity = Identity {
        session_id: 0,
        chip_uid: [0; 12],
        ..Identity::default()
    };
    let mut board = Simulator::new(identity, Mains::default(), outbox.clone());
    let bytes = thread::scope(|scope| {
        let reader = scope.spawn(|| {
            let mut bytes = Vec::new();
            while let Some(frame) = outbox.pop() {
                bytes.extend(frame);
                outbox.mark_written();
            }
            bytes
        });
        let mut encoder = Encoder::default();
        for command in commands {
            let mut buffer = [0; MAX_FRAME];
            let frame = encoder.encode(0, command, &mut buffer);
            board.receive(frame.expect("a command fits a frame"), 0);
        }
        let start = Start {
            streams,
            mains_hz: 0,
        };
        board.start(start, 0);
        for number in 0..samples {
            let mut sample = Sample::default();
            for (channel, count) in sample.counts.iter_mut().enumerate() {
                *count = eeg::count(first + number, channel);
            }
            board.process_sample(&sample, number * 1_000_000 / 512);
        }
        outbox.drain(Duration::from_secs(20));
        outbox.close();
        reader.join().expect("the reader ends")
    });
    let mut inbox = Inbox::default();
    inbox.decode(&bytes);
    inbox
}
