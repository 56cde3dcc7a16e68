//! Events of a recording (rows of GDF event tables, and EDF+ annotations), and the times at which
//! they start during playback.

use std::{collections::HashMap, fmt};

/// What an event means, in the form that its file format uses.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum EventLabel {
    /// A GDF event type, such as 0x0300 = 768 for the start of a trial. If bit 15 is set, the type
    /// ends the event that the same type without bit 15 started. If no such event has started, the
    /// type is an event of its own: OpenViBE numbers its stimulations from 0x8000.
    Type(u16),
    /// A sample of a sparsely sampled signal: GDF type 0x7fff in an event table of mode 3. Holds
    /// the digital value as 32 raw bits; the [`crate::SampleType`] of [`Event::signal`] decodes it.
    /// The file stores the value in the duration column, so the event has no duration. Tables of
    /// mode 1 have no duration column; in them, type 0x7fff is an ordinary [`EventLabel::Type`].
    SparseSample(u32),
    /// Text of an EDF+ or BDF+ annotation.
    Text(String),
}

impl EventLabel {
    /// Returns the name by which a user refers to the event: the text without blanks around it, or
    /// the type as a decimal number.
    pub fn name(&self) -> String {
        match self {
            Self::Type(kind) => kind.to_string(),
            Self::Text(text) => text.trim().to_owned(),
            Self::SparseSample(_) => self.to_string(),
        }
    }
}

impl fmt::Display for EventLabel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Type(kind) => write!(f, "{kind:#06x}"),
            Self::SparseSample(_) => f.write_str("sparse sample"),
            Self::Text(text) => f.write_str(text),
        }
    }
}

/// An event: a row of a GDF event table or an EDF+ annotation.
#[derive(Debug, Clone, PartialEq)]
pub struct Event {
    /// Start of the event in seconds since the start of the file.
    pub onset_s: f64,
    /// Duration, s; `None` if the file does not state it.
    pub duration_s: Option<f64>,
    /// Index of the signal to which the event belongs; `None` if it belongs to all signals.
    pub signal: Option<u16>,
    /// What the event means: a GDF type, a sparse sample or the text of an annotation.
    pub label: EventLabel,
}

/// GDF type of a table row that is not an event.
const NO_EVENT: u16 = 0;
/// GDF type of a sample of a sparsely sampled signal, whose value is in the row's duration column.
pub(crate) const SPARSE_SAMPLE: u16 = 0x7fff;
/// Bit of a GDF type that marks the end of an event.
const END_OF_EVENT: u16 = 0x8000;

/// Times at which the events of a recording start when it is played.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Onsets {
    /// Starts in ascending order, in seconds since the start of the signal that a
    /// [`crate::VirtualAdc`] plays. Events that start together have one entry each.
    pub seconds: Vec<f64>,
    /// Label of each event in `seconds`, in the same order.
    pub labels: Vec<EventLabel>,
    /// Number of events that were left out, because they start before or after the played signal.
    pub outside: usize,
    /// Number of sparse samples, which were left out.
    pub sparse_samples: u64,
}

impl Onsets {
    /// Collects the starts of all events within the signal. `events` pairs each event with its time
    /// in the signal, `None` if it is outside. Leaves out ends of events that have begun, rows
    /// without an event, and sparse samples.
    pub(crate) fn new(mut events: Vec<(Event, Option<f64>)>) -> Self {
        events.sort_by(|(a, _), (b, _)| a.onset_s.total_cmp(&b.onset_s));
        let mut onsets = Self::default();
        let mut begun: HashMap<(u16, Option<u16>), u64> = HashMap::new();
        for (event, place) in events {
            match event.label {
                EventLabel::SparseSample(_) | EventLabel::Type(SPARSE_SAMPLE) => {
                    onsets.sparse_samples += 1;
                    continue;
                }
                EventLabel::Type(NO_EVENT) => continue,
                EventLabel::Type(kind) if kind & END_OF_EVENT == 0 => {
                    *begun.entry((kind, event.signal)).or_default() += 1;
                }
                EventLabel::Type(kind) => {
                    let open = begun.get_mut(&(kind & !END_OF_EVENT, event.signal));
                    if let Some(open) = open.filter(|open| **open > 0) {
                        *open -= 1;
                        continue;
                    }
                }
                EventLabel::Text(_) => {}
            }
            match place {
                Some(place) => {
                    onsets.seconds.push(place);
                    onsets.labels.push(event.label);
                }
                None => onsets.outside += 1,
            }
        }
        onsets
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn event(onset_s: f64, label: EventLabel) -> Event {
        Event { onset_s, duration_s: None, signal: None, label }
    }

    fn onsets(events: &[Event]) -> Onsets {
        let place = |event: &Event| (0.0..10.0).contains(&event.onset_s).then_some(event.onset_s);
        Onsets::new(events.iter().map(|event| (event.clone(), place(event))).collect())
    }

    #[test]
    fn gdf_rows_that_are_no_start_of_an_event_have_no_onset() {
        let events = [
            event(2.0, EventLabel::Type(0x0301)),
            event(3.0, EventLabel::Type(0x8301)),
            event(1.0, EventLabel::Type(0x0300)),
            event(4.0, EventLabel::Type(0x7fff)),
            event(4.0, EventLabel::SparseSample(7)),
            event(5.0, EventLabel::Type(0)),
            event(-0.1, EventLabel::Type(1)),
            event(10.0, EventLabel::Type(1)),
        ];
        let expected = Onsets {
            seconds: vec![1.0, 2.0],
            labels: [0x0300, 0x0301].map(EventLabel::Type).into(),
            outside: 2,
            sparse_samples: 2,
        };
        assert_eq!(onsets(&events), expected);
    }

    #[test]
    fn a_type_with_bit_15_is_an_event_of_its_own_unless_it_ends_one() {
        // 0x8205, a stimulation of OpenViBE, ends no event, because 0x0205 has not begun. The first
        // 0x8300 ends the event that began at 2 s; the second has no event to end.
        let times = [(1.0, 0x8205), (2.0, 0x0300), (3.0, 0x8300), (4.0, 0x8300), (5.0, 0x8205)];
        let events = times.map(|(time, kind)| event(time, EventLabel::Type(kind)));
        assert_eq!(onsets(&events).seconds, [1.0, 2.0, 4.0, 5.0]);
        let mut other_signal = events.clone();
        other_signal[2].signal = Some(3);
        assert_eq!(onsets(&other_signal).seconds, [1.0, 2.0, 3.0, 5.0]);
    }
}
