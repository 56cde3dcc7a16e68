//! Streams that the user wants, and those that a device is asked for.

use link::Streams;

use crate::settings::{RawForm, with_codes};

/// Streams that the user wants, and those of them that `Start` asks for: fewer after the device refused some.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WantedStreams {
    /// Streams that the user requested, with the stream of codes added unless packed blocks are among them.
    /// Samples can be requested in both forms, of which the device sends one.
    wanted: Streams,
    asked: Streams,
}

impl WantedStreams {
    pub(crate) fn new(streams: Streams) -> WantedStreams {
        let wanted = with_codes(streams);
        WantedStreams {
            wanted,
            asked: first_choice(wanted),
        }
    }

    /// Asks for all streams again, because the device may be another one.
    pub(crate) fn ask_for_all(&mut self) {
        self.asked = first_choice(self.wanted);
    }

    /// Streams that `Start` asks for.
    pub(crate) fn asked(self) -> Streams {
        self.asked
    }

    /// Streams that the user wants and the device refused.
    pub(crate) fn refused(self) -> Streams {
        let refused = self.wanted.without(self.asked);
        if RawForm::any_in(self.asked) {
            refused.without(RawForm::Any.streams())
        } else {
            refused
        }
    }

    /// Asks for fewer streams after a refused `Start`. Returns false if there are no fewer.
    pub(crate) fn ask_for_fewer(&mut self) -> bool {
        let fewer = self.fewer();
        self.asked = fewer.unwrap_or(Streams::CODES);
        fewer.is_some()
    }

    /// Returns the streams to ask for after a refused `Start`: with raw samples in the other form if
    /// both are wanted, without raw samples, then without filtered steps, then with the packed code alone or codes in
    /// its place, then codes alone, which firmware before 0.2 is limited to.
    fn fewer(self) -> Option<Streams> {
        let compressed = Streams::COMPRESSED_RAW;
        if self.asked.contains(Streams::RAW) && self.wanted.contains(compressed) {
            return Some(self.asked.without(Streams::RAW) | compressed);
        }
        let removable = [Streams::RAW, compressed, Streams::FILTERED];
        let removable = removable
            .into_iter()
            .find(|stream| self.asked.contains(*stream));
        match removable {
            Some(stream) => Some(self.asked.without(stream)),
            None if self.asked.contains(Streams::PACKED) => Some(self.fewer_than_packed()),
            None if self.asked == Streams::CODES => None,
            None => Some(Streams::CODES),
        }
    }

    /// Returns the streams to ask for after a refused `Start` with packed blocks: those without audits, which need
    /// the network that an image with the packed code may lack, then codes in place of the blocks.
    fn fewer_than_packed(self) -> Streams {
        let needs_network = Streams::CODES | Streams::AUDIT;
        let alone = self.asked.without(needs_network);
        if alone != self.asked {
            return alone;
        }
        let samples = RawForm::Any.streams() | Streams::FILTERED;
        self.wanted.without(samples).without(Streams::PACKED) | Streams::CODES
    }
}

/// Returns the streams that a device is asked for at first: samples in one form only.
fn first_choice(wanted: Streams) -> Streams {
    if wanted.contains(Streams::RAW) {
        wanted.without(Streams::COMPRESSED_RAW)
    } else {
        wanted
    }
}
