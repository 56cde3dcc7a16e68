//! Streams that the user wants, and those that a device is asked for.

use link::Streams;

use crate::settings::{RawForm, with_codes};

/// Streams that the user wants, and those of them that `Start` asks for: fewer after the device refused some.
#[derive(Clone, Debug)]
pub(crate) struct WantedStreams {
    /// Streams that the user requested, with the stream of codes added unless packed blocks are among them.
    /// Samples can be requested in both forms, of which the device sends one.
    wanted: Streams,
    /// Streams to ask for, one choice after the other: a refusal does not say which stream it means.
    choices: Vec<Streams>,
    /// Index of the choice that `Start` asks for.
    asked: usize,
}

impl WantedStreams {
    pub(crate) fn new(streams: Streams) -> WantedStreams {
        let wanted = with_codes(streams);
        WantedStreams {
            wanted,
            choices: choices(wanted),
            asked: 0,
        }
    }

    /// Asks for all streams again, because the device may be another one.
    pub(crate) fn ask_for_all(&mut self) {
        self.asked = 0;
    }

    /// Streams that `Start` asks for.
    pub(crate) fn asked(&self) -> Streams {
        self.choices[self.asked]
    }

    /// Streams that the user wants and the device refused.
    pub(crate) fn refused(&self) -> Streams {
        let asked = self.asked();
        let refused = self.wanted.without(asked);
        if RawForm::any_in(asked) {
            refused.without(RawForm::Any.streams())
        } else {
            refused
        }
    }

    /// Asks for the next choice after a refused `Start`. Returns false if that was the last one.
    pub(crate) fn ask_for_fewer(&mut self) -> bool {
        let has_fewer = self.asked + 1 < self.choices.len();
        self.asked += usize::from(has_fewer);
        has_fewer
    }
}

/// Returns the choices of the streams to ask for, best first: all sets of samples with the best encoders, then with
/// the next ones, and then codes alone, which firmware before 0.2 is limited to. Last come packed blocks in place of
/// codes, for a device without the network.
fn choices(wanted: Streams) -> Vec<Streams> {
    let mut choices = Vec::new();
    for streams in encoder_choices(wanted).into_iter().flat_map(sample_choices) {
        if !choices.contains(&streams) {
            choices.push(streams);
        }
    }
    let codes_alone = [Streams::CODES];
    let without_network = sample_choices(wanted.without(Streams::CODES) | Streams::PACKED);
    for streams in codes_alone.into_iter().chain(without_network) {
        if !choices.contains(&streams) {
            choices.push(streams);
        }
    }
    choices
}

/// Returns `wanted` with the encoders that a device may have: all; the packed code alone, so without codes; the network
/// alone, so with codes in place of packed blocks.
fn encoder_choices(wanted: Streams) -> Vec<Streams> {
    if !wanted.contains(Streams::PACKED) {
        return vec![wanted];
    }
    vec![
        wanted,
        wanted.without(Streams::CODES),
        wanted.without(Streams::PACKED) | Streams::CODES,
    ]
}

/// Returns `wanted` with the samples that a device's port may carry: raw ones in either form, only one of which is
/// asked for, filtered ones alone, none.
fn sample_choices(wanted: Streams) -> [Streams; 4] {
    let [raw, compressed] = [Streams::RAW, Streams::COMPRESSED_RAW];
    let first = if wanted.contains(raw) {
        wanted.without(compressed)
    } else {
        wanted
    };
    let filtered = wanted.without(RawForm::Any.streams());
    [
        first,
        wanted.without(raw),
        filtered,
        filtered.without(Streams::FILTERED),
    ]
}
