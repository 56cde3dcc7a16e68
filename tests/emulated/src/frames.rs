//! Frames that a board has sent, decoded in order and sorted by kind.

use link::{
    Ack, ClockReading, Code, Decoder, Encoder, FrameError, Header, MAX_FRAME, Message, Quality,
    ResetCause, Stats, Timing, ToHost,
};
use model::{HOP, STEP_RATE_HZ};

use crate::compare;

/// Calls `look` with header and message of every intact frame, in order.
pub fn for_each(mut sent: &[u8], mut look: impl FnMut(Header, &ToHost<'_>)) {
    let mut decoder = Decoder::<MAX_FRAME>::new();
    while let Some(outcome) = decoder.next::<ToHost<'_>>(&mut sent) {
        if let Ok(frame) = outcome {
            look(frame.header, &frame.message);
        }
    }
}

/// Encodes a message as the first frame of a sender at time 0; equal messages have equal bytes.
///
/// # Panics
/// When the message is longer than a frame.
pub fn encoded<'m>(message: &impl Message<'m>) -> Vec<u8> {
    let mut buffer = [0; MAX_FRAME];
    let frame = Encoder::starting_at(0).encode(0, message, &mut buffer);
    frame.expect("the message fits a frame").to_vec()
}

/// Fields of the link's `Hello` that the tests check.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Hello {
    /// Type of the board; "qemu-mps2" for the emulated boards.
    pub board: String,
    /// Id of the model in the board's flash.
    pub model_id: [u8; 8],
    /// Cause of the reset before this boot.
    pub cause: ResetCause,
    /// Fault of the previous boot, or damage found at the start; empty without a fault.
    pub fault: String,
}

/// Everything that a board has sent from one reset to the next.
#[derive(Debug, Clone, Default)]
pub struct Boot {
    /// `Hello` frames: one at the start of the boot, and one per `Identify`.
    pub hellos: Vec<Hello>,
    /// `Capabilities` in the form of [`encoded`].
    pub capabilities: Vec<Vec<u8>>,
    /// Codes with their device times in microseconds.
    pub timed_codes: Vec<(u64, Code)>,
    /// Reports on the electrodes' quality, one per second.
    pub quality: Vec<Quality>,
    /// Counters of the board, one frame per second.
    pub stats: Vec<Stats>,
    /// Reported times of the pipeline's stages; each report counts from the start of the boot.
    pub timing: Vec<Timing>,
    /// Answers to commands, in the order sent.
    pub acks: Vec<Ack>,
    /// Answers to `SyncTime`, with the device times of their frames in microseconds.
    pub clock_readings: Vec<(u64, ClockReading)>,
    /// Number of intact frames.
    pub frames: u32,
    /// `Capabilities` messages, each encoded by [`encoded`].
    pub damaged: u32,
    /// Decoding error of the first damaged frame.
    pub first_damage: Option<FrameError>,
    /// Number of sequence numbers that no frame had.
    pub missing: u32,
    /// Device time of the latest frame in microseconds.
    pub latest_us: u64,
    /// Device time of the last answer in microseconds.
    pub last_ack_us: u64,
}

impl Boot {
    /// Decodes what was sent, and splits it at each frame with the sequence number 0. Returns at least one boot.
    pub fn split(mut sent: &[u8]) -> Vec<Self> {
        let mut boots = Vec::new();
        let mut boot = Self::default();
        let mut decoder = Decoder::<MAX_FRAME>::new();
        let mut next_seq = 0;
        while let Some(outcome) = decoder.next::<ToHost<'_>>(&mut sent) {
            match outcome {
                Ok(frame) => {
                    let Header {
                        seq,
                        device_time_us,
                        ..
                    } = frame.header;
                    if seq == 0 && boot.frames > 0 {
                        boots.push(std::mem::take(&mut boot));
                        next_seq = 0;
                    }
                    boot.frames += 1;
                    boot.missing = boot.missing.wrapping_add(seq.wrapping_sub(next_seq));
                    next_seq = seq.wrapping_add(1);
                    boot.add(device_time_us, &frame.message);
                }
                Err(error) => {
                    boot.damaged += 1;
                    boot.first_damage.get_or_insert(error);
                }
            }
        }
        boots.push(boot);
        boots
    }

    /// Decodes what was sent by a board that has not reset itself.
    ///
    /// # Panics
    /// When there are several boots.
    pub fn only(sent: &[u8]) -> Self {
        let mut boots = Self::split(sent);
        assert_eq!(
            boots.len(),
            1,
            "the board has reset itself: {:?}",
            boots.iter().map(|boot| &boot.hellos).collect::<Vec<_>>()
        );
        boots.remove(0)
    }

    fn add(&mut self, device_us: u64, message: &ToHost<'_>) {
        self.latest_us = self.latest_us.max(device_us);
        match message {
            ToHost::Hello(hello) => self.hellos.push(Hello {
                board: hello.board.to_owned(),
                model_id: hello.model_id,
                cause: hello.reset_cause,
                fault: hello.fault.to_owned(),
            }),
            ToHost::Capabilities(_) => self.capabilities.push(encoded(message)),
            ToHost::Code(code) => self.timed_codes.push((device_us, *code)),
            ToHost::Stats(stats) => self.stats.push(*stats),
            ToHost::Quality(quality) => self.quality.push(quality.clone()),
            ToHost::Timing(timing) => self.timing.push(timing.clone()),
            ToHost::Ack(ack) => {
                self.acks.push(*ack);
                self.last_ack_us = device_us;
            }
            ToHost::ClockReading(reading) => self.clock_readings.push((device_us, *reading)),
            ToHost::Raw(_)
            | ToHost::Filtered(_)
            | ToHost::Audit(_)
            | ToHost::Event(_)
            | ToHost::Converters(_)
            | ToHost::SelfTest(_) => {}
        }
    }

    /// Returns the codes without their times.
    pub fn codes(&self) -> Vec<Code> {
        self.timed_codes.iter().map(|(_, code)| *code).collect()
    }

    /// Returns the last counters; zeros without any.
    pub fn last_stats(&self) -> Stats {
        self.stats.last().copied().unwrap_or_default()
    }

    /// Largest deviation of a code's device time from a whole number of hops after the first code,
    /// in microseconds.
    pub fn jitter_us(&self) -> u64 {
        let Some((first, _)) = self.timed_codes.first() else {
            return 0;
        };
        let due = |index: u64| first + index * HOP as u64 * 1_000_000 / u64::from(STEP_RATE_HZ);
        let differences = (0..)
            .zip(&self.timed_codes)
            .map(|(index, (time, _))| time.abs_diff(due(index)));
        differences.max().unwrap_or(0)
    }

    /// Checks that codes and reports on electrodes equal the expected ones of host-sim.
    ///
    /// # Panics
    /// When they differ; the message names the first code, or the number of reports.
    pub fn assert_equal_outputs(&self, expected: &Self) {
        if let Some(difference) = compare::first_different_code(&expected.codes(), &self.codes()) {
            panic!("the codes are not host-sim's: {difference}");
        }
        let different = compare::count_differences(&expected.quality, &self.quality);
        assert_eq!(different, 0, "reports that are not host-sim's");
    }
}

/// Splits the bytes sent into frames, and removes the `Timing` frames, which hold measured times.
pub fn without_timing(sent: &[u8]) -> Vec<&[u8]> {
    let is_timing = |frame: &&[u8]| {
        let terminated = [frame, &[0][..]].concat();
        let mut decoder = Decoder::<MAX_FRAME>::new();
        let outcome = decoder.next::<ToHost<'_>>(&mut &terminated[..]);
        matches!(outcome, Some(Ok(frame)) if matches!(frame.message, ToHost::Timing(_)))
    };
    let frames = sent.split(|byte| *byte == 0);
    frames.filter(|frame| !is_timing(frame)).collect()
}

#[cfg(test)]
mod tests {
    use link::Streams;
    use pipeline::Sample;

    use super::*;
    use crate::host;

    /// Encodes messages as frames with sequence numbers from 0.
    fn frames(messages: &[ToHost<'_>]) -> Vec<Vec<u8>> {
        let mut encoder = Encoder::starting_at(0);
        let mut buffer = [0; MAX_FRAME];
        let frames = messages.iter().map(|message| {
            let frame = encoder.encode(5, message, &mut buffer);
            frame.expect("a frame").to_vec()
        });
        frames.collect()
    }

    fn stats(count: usize) -> Vec<Vec<u8>> {
        frames(&vec![ToHost::Stats(Stats::default()); count])
    }

    #[test]
    fn a_missing_frame_and_a_damaged_one_are_counted() {
        let mut sent = stats(4);
        sent.remove(1);
        sent[1][4] ^= 1;
        let boot = Boot::only(&sent.concat());
        assert_eq!((boot.frames, boot.damaged, boot.missing), (2, 1, 2));
        assert!(boot.first_damage.is_some());
        assert_eq!(boot.stats.len(), 2);
    }

    #[test]
    fn only_the_times_are_left_out() {
        let stats = || ToHost::Stats(Stats::default());
        let all = frames(&[stats(), ToHost::Timing(Timing::default()), stats()]);
        let rest = [&all[0][..], &all[2]].concat();
        let without = |sent: &[u8]| without_timing(sent).concat();
        assert_eq!(without(&all.concat()), without(&rest));
        assert_ne!(without(&all.concat()), without(&all[0]));
    }

    #[test]
    fn a_boot_starts_with_the_sequence_number_0() {
        // The reset cuts the last frame of the first boot.
        let cut = &stats(3).concat()[..stats(2).concat().len() + 7];
        let boots = Boot::split(&[cut, &stats(4).concat()].concat());
        assert!(boots.iter().map(|boot| boot.frames).eq([2, 4]));
        assert_eq!(boots[1].missing, 0);
    }

    #[test]
    fn a_code_that_is_late_by_a_microsecond_shows() {
        let sent = host::sent(Streams::CODES, &vec![Sample::default(); 512]);
        let mut boot = Boot::only(&sent);
        // A window of 16 steps, then hops of 8: 4 samples per step.
        assert_eq!(boot.timed_codes.len(), 15);
        assert_eq!((boot.hellos.len(), boot.capabilities.len()), (1, 1));
        assert_eq!(boot.jitter_us(), 0);
        boot.timed_codes[7].0 += 1;
        assert_eq!(boot.jitter_us(), 1);
    }
}
