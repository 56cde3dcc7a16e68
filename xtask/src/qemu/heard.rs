//! The frames that a board has sent.

use link::{Ack, Code, Decoder, FrameError, MAX_FRAME, Quality, ResetCause, Stats, Timing, ToHost};

use super::frames;

/// What a board has sent, by kind, in order.
#[derive(Debug, Default)]
pub(super) struct Heard {
    /// Each time it has said who it is.
    pub(super) hellos: Vec<Hello>,
    /// What it measures, each as a frame of its own.
    pub(super) capabilities: Vec<Vec<u8>>,
    /// Codes and their device times, microseconds.
    pub(super) codes: Vec<(u64, Code)>,
    /// What each electrode delivered.
    pub(super) quality: Vec<Quality>,
    /// What it has counted.
    pub(super) stats: Vec<Stats>,
    /// How long its stages took.
    pub(super) timing: Vec<Timing>,
    /// What became of commands.
    pub(super) acks: Vec<Ack>,
    /// All frames.
    pub(super) frames: u32,
    /// Frames that could not be used, and the first reason.
    pub(super) damaged: u32,
    pub(super) first_damage: Option<FrameError>,
    /// Numbers that no frame had.
    pub(super) missing: u32,
}

/// Who a board says it is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Hello {
    pub(super) board: String,
    pub(super) model_id: [u8; 8],
    pub(super) cause: ResetCause,
    pub(super) fault: String,
}

impl Heard {
    /// Takes all frames out of what was sent, from boot to boot: each begins with a `Hello` that has the
    /// number 0. There is always one.
    pub(super) fn boots(mut sent: &[u8]) -> Vec<Self> {
        let mut boots = Vec::new();
        let mut heard = Self::default();
        let mut decoder = Decoder::<MAX_FRAME>::new();
        let mut next_seq = 0;
        while let Some(outcome) = decoder.next::<ToHost<'_>>(&mut sent) {
            match outcome {
                Ok(frame) => {
                    if frame.header.seq == 0 && heard.frames > 0 {
                        boots.push(std::mem::take(&mut heard));
                        next_seq = 0;
                    }
                    heard.frames += 1;
                    heard.missing += frame.header.seq.wrapping_sub(next_seq);
                    next_seq = frame.header.seq.wrapping_add(1);
                    heard.take(frame.header.device_time_us, &frame.message);
                }
                Err(error) => {
                    heard.damaged += 1;
                    heard.first_damage.get_or_insert(error);
                }
            }
        }
        boots.push(heard);
        boots
    }

    fn take(&mut self, device_us: u64, message: &ToHost<'_>) {
        match message {
            ToHost::Hello(hello) => self.hellos.push(Hello {
                board: hello.board.to_owned(),
                model_id: hello.model_id,
                cause: hello.reset_cause,
                fault: hello.fault.to_owned(),
            }),
            ToHost::Capabilities(_) => self.capabilities.push(frames::alone(message)),
            ToHost::Code(code) => self.codes.push((device_us, *code)),
            ToHost::Stats(stats) => self.stats.push(*stats),
            ToHost::Quality(quality) => self.quality.push(quality.clone()),
            ToHost::Timing(timing) => self.timing.push(timing.clone()),
            ToHost::Ack(ack) => self.acks.push(*ack),
            ToHost::Raw(_)
            | ToHost::Filtered(_)
            | ToHost::Audit(_)
            | ToHost::Event(_)
            | ToHost::Converters(_)
            | ToHost::SelfTest(_)
            | ToHost::ClockReading(_) => {}
        }
    }

    /// The longest that a code's device time differs from a whole number of hops behind the first,
    /// microseconds.
    pub(super) fn jitter_us(&self) -> u64 {
        let Some((begin, _)) = self.codes.first() else {
            return 0;
        };
        let due = |index: u64| {
            begin + index * model::HOP as u64 * 1_000_000 / u64::from(model::STEP_RATE_HZ)
        };
        let late = (0..)
            .zip(&self.codes)
            .map(|(index, (time, _))| time.abs_diff(due(index)));
        late.max().unwrap_or(0)
    }
}

/// The frames of what was sent, but for what the board measured of its own times.
pub(super) fn but_times(sent: &[u8]) -> Vec<&[u8]> {
    let is_timing = |frame: &&[u8]| {
        let ended = [frame, &[0][..]].concat();
        let mut decoder = Decoder::<MAX_FRAME>::new();
        let outcome = decoder.next::<ToHost<'_>>(&mut &ended[..]);
        outcome.is_some_and(|frame| {
            frame.is_ok_and(|frame| matches!(frame.message, ToHost::Timing(_)))
        })
    };
    let frames = sent.split(|byte| *byte == 0);
    frames.filter(|frame| !is_timing(frame)).collect()
}

#[cfg(test)]
mod tests {
    use link::Encoder;
    use pipeline::Sample;

    use super::super::host;
    use super::*;

    #[test]
    fn a_frame_that_is_missing_and_one_that_is_damaged_are_counted() {
        let mut encoder = Encoder::starting_at(0);
        let mut sent = Vec::new();
        for _ in 0..4 {
            let mut buffer = [0; MAX_FRAME];
            let stats = ToHost::Stats(Stats::default());
            let frame = encoder.encode(5, &stats, &mut buffer).expect("a frame");
            sent.push(frame.to_vec());
        }
        sent.remove(1);
        sent[1][4] ^= 1;
        let boots = Heard::boots(&sent.concat());
        let [heard] = &boots[..] else {
            panic!("one boot: {boots:?}");
        };
        assert_eq!((heard.frames, heard.damaged, heard.missing), (2, 1, 2));
        assert!(heard.first_damage.is_some());
        assert_eq!(heard.stats.len(), 2);
    }

    #[test]
    fn only_the_times_are_left_out() {
        let mut encoder = Encoder::starting_at(0);
        let mut frame = |message: &ToHost<'_>| {
            let mut buffer = [0; MAX_FRAME];
            let frame = encoder.encode(5, message, &mut buffer);
            frame.expect("a frame").to_vec()
        };
        let stats = frame(&ToHost::Stats(Stats::default()));
        let timing = frame(&ToHost::Timing(Timing::default()));
        let other = frame(&ToHost::Stats(Stats::default()));
        let all = [&stats[..], &timing, &other].concat();
        let rest = [&stats[..], &other].concat();
        assert_eq!(but_times(&all).concat(), but_times(&rest).concat());
        assert_ne!(but_times(&all).concat(), but_times(&stats).concat());
    }

    #[test]
    fn a_board_that_begins_again_is_heard_from_its_beginning() {
        let heard = |frames: &[u8]| Heard::boots(frames).into_iter().map(|heard| heard.frames);
        let frames = |count| {
            let mut encoder = Encoder::starting_at(0);
            let mut sent = Vec::new();
            for _ in 0..count {
                let mut buffer = [0; MAX_FRAME];
                let stats = ToHost::Stats(Stats::default());
                sent.extend(encoder.encode(5, &stats, &mut buffer).expect("a frame"));
            }
            sent
        };
        // The second boot cuts a frame of the first.
        let cut = &frames(3)[..frames(2).len() + 7];
        let sent = [cut, &frames(4)].concat();
        assert!(heard(&sent).eq([2, 4]));
        assert_eq!(Heard::boots(&sent)[1].missing, 0);
    }

    #[test]
    fn a_code_that_is_late_by_a_microsecond_shows() {
        let sent = host::sent(&vec![Sample::default(); 512]).expect("host-sim");
        let mut heard = Heard::boots(&sent).swap_remove(0);
        // A window of 16 steps, then hops of 8: all of 4 samples.
        assert_eq!(heard.codes.len(), 15);
        assert_eq!((heard.hellos.len(), heard.capabilities.len()), (1, 1));
        assert_eq!(heard.jitter_us(), 0);
        heard.codes[7].0 += 1;
        assert_eq!(heard.jitter_us(), 1);
    }
}
