//! Decodes the frames of a board and sorts their messages by kind, and makes host-sim's frames for
//! the same samples.

use host_sim::{Identity, Outbox, VirtualBoard, WhenFull};
use link::{
    Ack, ClockReading, Decoder, FrameError, Header, MAX_FRAME, Message, Quality, ResetCause, Start,
    Stats, Streams, Timing, ToHost, VERSION,
};
use model::{ADC_RATE_HZ, HOP, STEP_RATE_HZ};
use pipeline::{Mains, Sample};

use crate::compare::first_difference;

/// Calls `select` with header and message of each intact frame in `sent`, and collects the values
/// that `select` returns.
pub fn filter_map<T>(
    mut sent: &[u8],
    mut select: impl FnMut(Header, ToHost<'_>) -> Option<T>,
) -> Vec<T> {
    let mut selected = Vec::new();
    let mut decoder = Decoder::<MAX_FRAME>::new();
    while let Some(outcome) = decoder.next::<ToHost<'_>>(&mut sent) {
        let item = outcome.ok().and_then(|frame| select(frame.header, frame.message));
        selected.extend(item);
    }
    selected
}

/// Encodes a message as a frame of this sequence number and protocol version at device time 0.
///
/// # Panics
/// When the message is longer than a frame.
pub fn frame<'m>(seq: u32, version: u8, message: &impl Message<'m>) -> Vec<u8> {
    let header = Header { version, seq, device_time_us: 0 };
    let mut buffer = [0; MAX_FRAME];
    let frame = link::encode(&header, message, &mut buffer);
    frame.expect("the message fits a frame").to_vec()
}

/// Encodes a message as a frame with a constant header, so that equal messages have equal bytes.
///
/// # Panics
/// When the message is longer than a frame.
pub fn encoded<'m>(message: &impl Message<'m>) -> Vec<u8> {
    frame(0, VERSION, message)
}

/// Returns the bytes that host-sim's virtual board sends for `samples` with the streams `streams`.
/// Like the image with the argument `start`, the board starts at device time 0 with the default
/// mains frequency.
pub fn simulated(streams: Streams, samples: &[Sample]) -> Vec<u8> {
    // With `Wait` the queue of frames grows as needed, so the board drops no frame.
    let outbox = Outbox::new(WhenFull::Wait);
    let mut board = VirtualBoard::new(Identity::default(), Mains::default(), outbox.clone());
    let start = Start { streams, mains_hz: 0 };
    board.start(start, 0);
    for (index, sample) in (0..).zip(samples) {
        board.process_sample(sample, index * 1_000_000 / u64::from(ADC_RATE_HZ));
    }
    outbox.take_all().concat()
}

/// A code in a frame that a board has sent.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SentCode {
    /// Index of the code's window, from 0 at the last `Start`.
    pub window: u32,
    /// Values of the code as levels (integers).
    pub levels: Vec<i32>,
    /// The whole code message, encoded by [`encoded`] for comparison.
    pub bytes: Vec<u8>,
}

/// Everything that a board has sent between two resets.
#[derive(Debug, Clone, Default)]
pub struct Boot {
    /// Reset cause and fault in each `Hello`. A board sends a `Hello` at the start of the boot and
    /// one per `Identify`. The fault comes from the previous boot, or is damage found at the start;
    /// it is empty if there is neither.
    pub hellos: Vec<(ResetCause, String)>,
    /// Every `Capabilities` message, encoded by [`encoded`].
    pub capabilities: Vec<Vec<u8>>,
    /// Codes, each with the device time of its frame in microseconds.
    pub timed_codes: Vec<(u64, SentCode)>,
    /// Reports on the quality of the electrodes, one per second.
    pub quality: Vec<Quality>,
    /// Counters of the board, reported once per second.
    pub stats: Vec<Stats>,
    /// Times of the pipeline's stages over the whole boot, as the last `Timing` reported them;
    /// empty if there was none.
    pub timing: Timing,
    /// Replies to commands, in the order in which the board has sent them.
    pub acks: Vec<Ack>,
    /// Replies to `SyncTime`, each with the device time of its frame in microseconds.
    pub clock_readings: Vec<(u64, ClockReading)>,
    /// Number of frames that arrived intact.
    pub frames: u32,
    /// Decoding error of each damaged frame.
    pub damaged: Vec<FrameError>,
    /// Number of missing frames, computed from the gaps in the sequence numbers.
    pub missing: u32,
    /// Device time of the latest intact frame, microseconds.
    pub latest_us: u64,
    /// Device time of the frame with the last `Ack`, in microseconds.
    pub last_ack_us: u64,
}

impl Boot {
    /// Decodes the frames in `sent` and returns their contents boot by boot. A frame with the
    /// sequence number 0 starts a new boot. Returns at least one boot.
    pub fn split(mut sent: &[u8]) -> Vec<Self> {
        let mut boots = Vec::new();
        let mut boot = Self::default();
        let mut decoder = Decoder::<MAX_FRAME>::new();
        let mut next_seq = 0;
        while let Some(outcome) = decoder.next::<ToHost<'_>>(&mut sent) {
            match outcome {
                Ok(frame) => {
                    let seq = frame.header.seq;
                    if seq == 0 && boot.frames > 0 {
                        boots.push(std::mem::take(&mut boot));
                        next_seq = 0;
                    }
                    boot.frames += 1;
                    boot.missing = boot.missing.wrapping_add(seq.wrapping_sub(next_seq));
                    next_seq = seq.wrapping_add(1);
                    boot.add(frame.header.device_time_us, &frame.message);
                }
                Err(error) => boot.damaged.push(error),
            }
        }
        boots.push(boot);
        boots
    }

    /// Decodes the frames of a board that has not been reset, and returns its only boot.
    ///
    /// # Panics
    /// When `sent` contains several boots.
    pub fn only(sent: &[u8]) -> Self {
        let mut boots = Self::split(sent);
        let hellos: Vec<_> = boots.iter().map(|boot| &boot.hellos).collect();
        assert_eq!(boots.len(), 1, "the board has reset itself: {hellos:?}");
        boots.remove(0)
    }

    fn add(&mut self, device_us: u64, message: &ToHost<'_>) {
        self.latest_us = self.latest_us.max(device_us);
        match message {
            ToHost::Hello(hello) => {
                let fault = hello.fault.to_owned();
                self.hellos.push((hello.reset_cause, fault));
            }
            ToHost::Capabilities(_) => self.capabilities.push(encoded(message)),
            ToHost::Code(code) => {
                let code = SentCode {
                    window: code.window,
                    levels: code.values.levels().collect(),
                    bytes: encoded(message),
                };
                self.timed_codes.push((device_us, code));
            }
            ToHost::Stats(stats) => self.stats.push(*stats),
            ToHost::Quality(quality) => self.quality.push(quality.clone()),
            ToHost::Timing(timing) => self.timing.clone_from(timing),
            ToHost::Ack(ack) => {
                self.acks.push(*ack);
                self.last_ack_us = device_us;
            }
            ToHost::ClockReading(reading) => self.clock_readings.push((device_us, *reading)),
            _ => {}
        }
    }

    /// Returns the codes without their device times.
    pub fn codes(&self) -> Vec<SentCode> {
        let codes = self.timed_codes.iter();
        codes.map(|(_, code)| code.clone()).collect()
    }

    /// Returns the counters of the last `Stats`; all are 0 if there was none.
    pub fn last_stats(&self) -> Stats {
        self.stats.last().copied().unwrap_or_default()
    }

    /// Returns the largest deviation of a code's device time from its due time, in microseconds.
    /// Codes are due at whole hops after the first code.
    pub fn jitter_us(&self) -> u64 {
        let Some((first, _)) = self.timed_codes.first() else {
            return 0;
        };
        let due = |index: u64| first + index * HOP as u64 * 1_000_000 / u64::from(STEP_RATE_HZ);
        let differences =
            (0..).zip(&self.timed_codes).map(|(index, (time, _))| time.abs_diff(due(index)));
        differences.max().unwrap_or(0)
    }

    /// Checks that the codes and the reports on electrodes equal the ones in `expected`, which
    /// host-sim has sent.
    ///
    /// # Panics
    /// When they differ; the message names the first difference.
    pub fn assert_equal_outputs(&self, expected: &Self) {
        let difference = first_difference(&expected.codes(), &self.codes());
        assert_eq!(difference, None, "a code is not host-sim's");
        let difference = first_difference(&expected.quality, &self.quality);
        assert_eq!(difference, None, "a report is not host-sim's");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns `count` frames with `Stats` messages; their sequence numbers start at 0.
    fn stats(count: u32) -> Vec<Vec<u8>> {
        let message = ToHost::Stats(Stats::default());
        (0..count).map(|seq| frame(seq, VERSION, &message)).collect()
    }

    #[test]
    fn a_missing_frame_and_a_damaged_one_are_counted() {
        let mut sent = stats(4);
        sent.remove(1);
        sent[1][4] ^= 1;
        let boot = Boot::only(&sent.concat());
        assert_eq!((boot.frames, boot.damaged.len(), boot.missing), (2, 1, 2));
        assert_eq!(boot.stats.len(), 2);
    }

    #[test]
    fn a_boot_starts_with_the_sequence_number_0() {
        // Simulate a reset that cuts the last frame of the first boot.
        let cut = &stats(3).concat()[..stats(2).concat().len() + 7];
        let boots = Boot::split(&[cut, &stats(4).concat()].concat());
        assert!(boots.iter().map(|boot| boot.frames).eq([2, 4]));
        assert_eq!(boots[1].missing, 0);
    }

    #[test]
    fn a_code_that_is_late_by_a_microsecond_shows() {
        let sent = simulated(Streams::CODES, &vec![Sample::default(); 512]);
        let mut boot = Boot::only(&sent);
        // 512 samples are 128 steps: a window of 16 steps and 14 hops of 8 steps, so 15 codes.
        assert_eq!(boot.timed_codes.len(), 15);
        assert_eq!(boot.jitter_us(), 0);
        boot.timed_codes[7].0 += 1;
        assert_eq!(boot.jitter_us(), 1);
    }
}
