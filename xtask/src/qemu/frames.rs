//! A board's frames one by one, those of every kind.

use link::{Decoder, Encoder, Header, MAX_FRAME, ToHost};

/// Shows every sound frame of what was sent, in order.
pub(super) fn each(mut sent: &[u8], mut look: impl FnMut(Header, &ToHost<'_>)) {
    let mut decoder = Decoder::<MAX_FRAME>::new();
    while let Some(outcome) = decoder.next::<ToHost<'_>>(&mut sent) {
        if let Ok(frame) = outcome {
            look(frame.header, &frame.message);
        }
    }
}

/// What a run has made, its events apart: a frame without its number.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Made {
    pub(super) what: &'static str,
    /// Device time, microseconds.
    pub(super) at_us: u64,
    /// The message, as it is on the wire.
    pub(super) bytes: Vec<u8>,
}

impl Made {
    /// All of them, in order.
    pub(super) fn all(sent: &[u8]) -> Vec<Self> {
        let mut all = Vec::new();
        each(sent, |header, message| {
            let what = match message {
                ToHost::Code(_) => "code",
                ToHost::Quality(_) => "report",
                ToHost::Raw(_) => "raw samples",
                ToHost::Filtered(_) => "filtered steps",
                ToHost::Audit(_) => "audit",
                _ => return,
            };
            all.push(Self {
                what,
                at_us: header.device_time_us,
                bytes: alone(message),
            });
        });
        all
    }
}

/// The message as the first frame of a device at time 0.
pub(super) fn alone(message: &ToHost<'_>) -> Vec<u8> {
    let mut buffer = [0; MAX_FRAME];
    let frame = Encoder::starting_at(0).encode(0, message, &mut buffer);
    frame.map(<[u8]>::to_vec).unwrap_or_default()
}

/// How the frames differ from the expected ones: in what they hold, in their order, or in their time
/// behind the first of them. None where they do not.
pub(super) fn first_difference(expected: &[Made], found: &[Made]) -> Option<String> {
    let begin = |all: &[Made]| all.first().map_or(0, |made| made.at_us);
    let begins = [begin(expected), begin(found)];
    let pairs = expected.iter().zip(found).enumerate();
    for (index, (expected, found)) in pairs {
        let [due, at_us] = [(expected, begins[0]), (found, begins[1])]
            .map(|(made, begin)| made.at_us.wrapping_sub(begin));
        if expected.what != found.what {
            return Some(format!(
                "frame {index} is of {}, not of {}",
                found.what, expected.what
            ));
        }
        if expected.bytes != found.bytes {
            return Some(format!("frame {index}, {}, has other content", found.what));
        }
        if due != at_us {
            return Some(format!(
                "frame {index}, {}, is at {at_us} us, not {due}",
                found.what
            ));
        }
    }
    (expected.len() != found.len())
        .then(|| format!("{} frames, {} expected", found.len(), expected.len()))
}

#[cfg(test)]
mod tests {
    use pipeline::Sample;

    use super::*;
    use crate::qemu::host;

    #[test]
    fn a_frame_with_another_content_time_or_place_and_one_too_few_are_named() {
        let samples = vec![Sample::default(); 256];
        let sent = host::sent_of(link::Streams::ALL, &samples).expect("host-sim");
        let all = Made::all(&sent);
        assert!(all.iter().any(|made| made.what == "audit"), "{all:?}");
        let found = |change: fn(&mut Vec<Made>)| {
            let mut changed = all.clone();
            change(&mut changed);
            first_difference(&all, &changed).unwrap_or_default()
        };
        assert_eq!(found(|_| ()), "");
        // A board that has started later.
        let later = |made: &mut Vec<Made>| made.iter_mut().for_each(|made| made.at_us += 9);
        assert_eq!(found(later), "");
        let late = found(|made| made[5].at_us += 1);
        assert!(late.starts_with("frame 5, "), "{late}");
        assert!(late.contains(" us, not "), "{late}");
        assert!(found(|made| made[3].bytes[9] ^= 1).ends_with("has other content"));
        assert!(found(|made| made.swap(1, 2)).starts_with("frame 1 is of"));
        assert!(found(|made| made.truncate(9)).starts_with("9 frames,"));
    }
}
