//! Compares a virtual board's frames with those that host-sim sends for the same samples.

use std::fmt::Debug;
use std::ops::RangeInclusive;

use host_sim::{Identity, Outbox, VirtualBoard as Simulator, WhenFull};
use link::{AckResult, Encoder, ExclusionPolicy, Flags, MAX_FRAME, Start, Streams, ToDevice};
use pipeline::{Mains, Sample};
use virtual_board::{BoardError, Frame, Inbox, ReceivedCode, VirtualBoard, electrode_count};

use crate::session::{answer, start};

/// Number of samples between the starts of two consecutive windows or packed blocks.
pub(crate) const HOP: u64 = 32;

/// Command that excludes two electrodes, and all electrodes that the board itself finds bad.
pub(crate) const EXCLUDE: ToDevice<'_> = ToDevice::SetExclusion(ExclusionPolicy {
    always: 1 << 20 | 1 << 45,
    ..ExclusionPolicy::AUTOMATIC
});

/// A board's run that host-sim repeats, so that the frames of both can be compared.
#[derive(Clone, Debug)]
pub(crate) struct Repeatable {
    streams: Streams,
    /// Commands that the board receives before the command `Start`.
    commands: Vec<ToDevice<'static>>,
    /// Numbers of the samples with which the run may have started: the samples between the command
    /// `Start` and its acknowledgement.
    first: RangeInclusive<u64>,
}

impl Repeatable {
    /// Sends `commands` to a board, and then starts `streams` on it.
    pub(crate) fn start(
        board: &mut VirtualBoard,
        streams: Streams,
        commands: &[ToDevice<'static>],
    ) -> Result<Self, BoardError> {
        for command in commands {
            assert_eq!(answer(board, command)?, AckResult::Done);
        }
        let before = board.converters().samples_delivered();
        start(board, streams)?;
        let after = board.converters().samples_delivered();
        let first = before.saturating_sub(1)..=after + 1;
        Ok(Self { streams, commands: commands.to_vec(), first })
    }

    /// Asserts that the items that `select` picks from the board's frames equal host-sim's bit for
    /// bit. Returns the number of compared items, and host-sim's frames. `hop` is the number of
    /// samples from one item to the next.
    pub(crate) fn assert_equal<T: Debug + PartialEq>(
        self,
        board: &VirtualBoard,
        hop: u64,
        select: fn(&[Frame]) -> Vec<T>,
    ) -> (usize, Inbox) {
        let made = select(board.inbox().frames());
        let simulated = |first, samples| simulated(self.streams, &self.commands, first, samples);
        let mut candidates = self.first.clone();
        let first = candidates
            .find(|&sample| select(simulated(sample, 2 * HOP).frames()).first() == made.first());
        let first = first.expect("the first frame equals none of host-sim's");
        let inbox = simulated(first, hop * (made.len() as u64 + 2));
        let expected = select(inbox.frames());
        assert!(expected.len() >= made.len(), "{} frames", expected.len());
        for (number, (made, expected)) in made.iter().zip(&expected).enumerate() {
            assert_eq!(made, expected, "frame {number}");
        }
        (made.len(), inbox)
    }
}

/// Asserts that all codes or blocks have the flag for substituted electrodes, which [`EXCLUDE`]
/// causes.
pub(crate) fn assert_substituted(codes: &[ReceivedCode]) {
    let is_substituted = |code: &ReceivedCode| code.flags.contains(Flags::SUBSTITUTED);
    assert!(codes.iter().all(is_substituted));
}

/// Returns the frames that host-sim sends when it receives `commands` and a `Start` of `streams`
/// and then processes `samples` samples. `first` is the number of the first of these samples.
fn simulated(streams: Streams, commands: &[ToDevice<'_>], first: u64, samples: u64) -> Inbox {
    let outbox = Outbox::new(WhenFull::Wait);
    let mut board = Simulator::new(Identity::default(), Mains::default(), outbox.clone());
    for command in commands {
        let mut buffer = [0; MAX_FRAME];
        let frame = Encoder::default().encode(0, command, &mut buffer);
        board.receive(frame.expect("a command fits a frame"), 0);
    }
    let start = Start { streams, mains_hz: 0 };
    board.start(start, 0);
    for number in 0..samples {
        let sample = Sample {
            counts: std::array::from_fn(|channel| electrode_count(first + number, channel)),
        };
        board.process_sample(&sample, number * 1_000_000 / 512);
    }
    let mut inbox = Inbox::default();
    inbox.decode(&outbox.take_all().concat());
    inbox
}
