//! The frames that a board has sent.

use link::{Code, Decoder, Encoder, FrameError, MAX_FRAME, Quality, Stats, ToHost};

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
    pub(super) fault: String,
}

impl Heard {
    /// Takes all frames out of what was sent since boot.
    pub(super) fn of(mut sent: &[u8]) -> Self {
        let mut heard = Self::default();
        let mut decoder = Decoder::<MAX_FRAME>::new();
        let mut next_seq = 0;
        while let Some(outcome) = decoder.next::<ToHost<'_>>(&mut sent) {
            match outcome {
                Ok(frame) => {
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
        heard
    }

    fn take(&mut self, device_us: u64, message: &ToHost<'_>) {
        match message {
            ToHost::Hello(hello) => self.hellos.push(Hello {
                board: hello.board.to_owned(),
                model_id: hello.model_id,
                fault: hello.fault.to_owned(),
            }),
            ToHost::Capabilities(_) => self.capabilities.push(alone(message)),
            ToHost::Code(code) => self.codes.push((device_us, *code)),
            ToHost::Stats(stats) => self.stats.push(*stats),
            ToHost::Quality(quality) => self.quality.push(quality.clone()),
            ToHost::Ack(_) => {}
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

/// The message as the first frame of a device at time 0.
fn alone(message: &ToHost<'_>) -> Vec<u8> {
    let mut buffer = [0; MAX_FRAME];
    let frame = Encoder::starting_at(0).encode(0, message, &mut buffer);
    frame.map(<[u8]>::to_vec).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use pipeline::Sample;

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
        let heard = Heard::of(&sent.concat());
        assert_eq!((heard.frames, heard.damaged, heard.missing), (2, 1, 2));
        assert!(heard.first_damage.is_some());
        assert_eq!(heard.stats.len(), 2);
    }

    #[test]
    fn a_code_that_is_late_by_a_microsecond_shows() {
        let mut heard = super::super::host::heard(&vec![Sample::default(); 512]).expect("host-sim");
        // A window of 16 steps, then hops of 8: all of 4 samples.
        assert_eq!(heard.codes.len(), 15);
        assert_eq!((heard.hellos.len(), heard.capabilities.len()), (1, 1));
        assert_eq!(heard.jitter_us(), 0);
        heard.codes[7].0 += 1;
        assert_eq!(heard.jitter_us(), 1);
    }
}
