//! Events of a recording (rows of GDF event tables, and EDF+ annotations), and the times at which
//! they start when the recording is played.

use std::fmt;

/// What an event means, in the form in which the file's format states it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum EventLabel {
    /// A GDF event type, such as 0x0300 = 768 for the start of a trial. A type with bit 15 set
    /// marks the end of the event that the same type without this bit starts.
    Type(u16),
    /// A sample of a sparsely sampled signal: GDF type 0x7fff in an event table of mode 3. Holds
    /// the digital value as 32 raw bits; the [`crate::SampleType`] of [`Event::signal`] decodes it.
    /// The file stores the value in the duration column, so the event has no duration. Tables of
    /// mode 1 have no duration column; in them, type 0x7fff is an ordinary [`EventLabel::Type`].
    SparseSample(u32),
    /// Text of an EDF+ or BDF+ annotation.
    Text(String),
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
}

impl Onsets {
    /// Collects the starts of all events within the signal. Ends of events, rows without an event,
    /// and sparse samples are left out.
    pub(crate) fn new(events: &[Event], timeline: &Timeline) -> Self {
        let starts = events.iter().filter(|event| is_start(&event.label));
        let mut placed: Vec<(f64, EventLabel)> = Vec::new();
        let mut outside = 0;
        for event in starts {
            match timeline.place(event.onset_s) {
                Some(place) => placed.push((place, event.label.clone())),
                None => outside += 1,
            }
        }
        placed.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        let (seconds, labels) = placed.into_iter().unzip();
        Self {
            seconds,
            labels,
            outside,
        }
    }
}

fn is_start(label: &EventLabel) -> bool {
    match label {
        EventLabel::Text(_) => true,
        EventLabel::SparseSample(_) | EventLabel::Type(NO_EVENT | SPARSE_SAMPLE) => false,
        EventLabel::Type(kind) => kind & END_OF_EVENT == 0,
    }
}

/// Converts times in the file to times in the played signal, which has no gaps between records.
#[derive(Debug, Default)]
pub(crate) struct Timeline {
    /// Start of each record in the file, and its start in the signal, s; ascending.
    pub(crate) records: Vec<(f64, f64)>,
    /// Duration of a record, s.
    pub(crate) record_s: f64,
    /// Duration of the whole signal, s.
    pub(crate) end_s: f64,
}

impl Timeline {
    /// Adds record `record` with its start in the file, s, if the file states one. Ignores a record
    /// that does not start after the previous one.
    #[expect(clippy::cast_precision_loss, reason = "records stay below 2^53")]
    pub(crate) fn add_record(&mut self, record: u64, start_s: Option<f64>) {
        let last = self.records.last().map(|(start, _)| *start);
        if let Some(start) = start_s
            && last.is_none_or(|last| last < start)
        {
            self.records.push((start, record as f64 * self.record_s));
        }
    }

    /// Converts a time in the file to a time in the signal, s; `None` if it is outside the signal.
    /// A time within a gap becomes the end of the record before the gap.
    pub(crate) fn place(&self, file_s: f64) -> Option<f64> {
        let after = self.records.partition_point(|(start, _)| *start <= file_s);
        let place = match after.checked_sub(1) {
            Some(record) => {
                let (start, place) = self.records[record];
                place + (file_s - start).min(self.record_s)
            }
            // Without stated record times, which only EDF+ and BDF+ have, the signal has the file's
            // times.
            None if self.records.is_empty() => file_s,
            None => return None,
        };
        (0.0..self.end_s).contains(&place).then_some(place)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn event(onset_s: f64, label: EventLabel) -> Event {
        Event {
            onset_s,
            duration_s: None,
            signal: None,
            label,
        }
    }

    #[test]
    fn gdf_rows_that_are_no_start_of_an_event_have_no_onset() {
        let timeline = Timeline {
            end_s: 10.0,
            ..Timeline::default()
        };
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
            labels: vec![EventLabel::Type(0x0300), EventLabel::Type(0x0301)],
            outside: 2,
        };
        assert_eq!(Onsets::new(&events, &timeline), expected);
    }

    #[test]
    fn gaps_between_records_are_closed() {
        // Records of 1 s start at 0.5 s and 1.5 s and, after a gap of 7.5 s, at 10 s.
        let timeline = Timeline {
            records: vec![(0.5, 0.0), (1.5, 1.0), (10.0, 2.0)],
            record_s: 1.0,
            end_s: 3.0,
        };
        for (file_s, place) in [
            (0.4, None),
            (0.5, Some(0.0)),
            (1.75, Some(1.25)),
            (5.0, Some(2.0)),
            (10.25, Some(2.25)),
            (11.0, None),
        ] {
            assert_eq!(timeline.place(file_s), place, "{file_s} s");
        }
    }
}
