//! Parses the time-stamped annotation lists (TALs) of EDF+ and BDF+.

use crate::event::{Event, EventLabel};
use crate::header::decoded;

/// Byte that ends the time stamp and each text of an annotation list.
const TEXT_END: u8 = 0x14;
/// Byte between the onset and the duration in the time stamp of an annotation list.
const DURATION: u8 = 0x15;

/// Number of bytes of an invalid list that a warning shows.
const SHOWN: usize = 40;

/// The contents of the annotations in one record.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct RecordAnnotations {
    /// Start of the record, in seconds since the start of the file: the onset of the first list
    /// whose first text is empty. EDF+ requires such a list in each record; `None` if the record
    /// has none.
    pub(crate) record_start_s: Option<f64>,
    pub(crate) events: Vec<Event>,
    /// Number of invalid lists.
    pub(crate) invalid: u64,
    /// The start of the first invalid list, with escapes.
    pub(crate) first_invalid: Option<String>,
}

impl RecordAnnotations {
    /// Adds the lists of one annotation signal in a record: `+onset[0x15 duration]0x14 text 0x14
    /// ... 0x00`, padded with zeros (EDF+ specification, section 2.2). Leaves out invalid lists.
    pub(crate) fn add(&mut self, bytes: &[u8]) {
        let lists = bytes.split(|&byte| byte == 0);
        for list in lists.filter(|list| !list.is_empty()) {
            if !parse_list(list, self) {
                self.invalid += 1;
                let start = || list[..list.len().min(SHOWN)].escape_ascii().to_string();
                self.first_invalid.get_or_insert_with(start);
            }
        }
    }
}

fn parse_list(list: &[u8], found: &mut RecordAnnotations) -> bool {
    let mut parts = list.split(|&byte| byte == TEXT_END);
    let mut times = parts.next().unwrap_or_default().split(|&byte| byte == DURATION);
    let Some(onset_s) = times.next().and_then(signed_seconds) else {
        return false;
    };
    let duration_s = match times.next().map(seconds) {
        Some(None) => return false,
        Some(length) => length,
        None => None,
    };
    let texts: Vec<&[u8]> = parts.collect();
    // Every text, including the last, ends with a separator, so the last part must be empty.
    let Some((&[], texts)) = texts.split_last() else {
        return false;
    };
    for (i, text) in texts.iter().enumerate() {
        if text.is_empty() {
            if i == 0 && found.record_start_s.is_none() {
                found.record_start_s = Some(onset_s);
            }
            continue;
        }
        let label = EventLabel::Text(decoded(text));
        found.events.push(Event { onset_s, duration_s, signal: None, label });
    }
    true
}

/// Parses an onset in seconds, which must start with a sign.
fn signed_seconds(bytes: &[u8]) -> Option<f64> {
    if matches!(bytes.first(), Some(b'+' | b'-')) { seconds(bytes) } else { None }
}

fn seconds(bytes: &[u8]) -> Option<f64> {
    let value: f64 = std::str::from_utf8(bytes).ok()?.parse().ok()?;
    value.is_finite().then_some(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn event(onset_s: f64, duration_s: Option<f64>, text: &str) -> Event {
        Event { onset_s, duration_s, signal: None, label: EventLabel::Text(text.to_owned()) }
    }

    fn parse(bytes: &[u8]) -> RecordAnnotations {
        let mut found = RecordAnnotations::default();
        found.add(bytes);
        found
    }

    #[test]
    fn a_record_has_a_start_and_annotations() {
        let found =
            parse(b"+567\x14\x14\0+567.5\x152\x14Lights off\x14Closed\x14\0-1.5\x14x\x14\0\0\0");
        let expected = RecordAnnotations {
            record_start_s: Some(567.0),
            events: vec![
                event(567.5, Some(2.0), "Lights off"),
                event(567.5, Some(2.0), "Closed"),
                event(-1.5, None, "x"),
            ],
            ..RecordAnnotations::default()
        };
        assert_eq!(found, expected);
    }

    #[test]
    fn text_that_is_not_utf_8_is_windows_1252() {
        let found = parse(b"+1\x14\xb5V \x80\x14\0+2\x14\xc3\xa9t\xc3\xa9\x14\0");
        let expected = [event(1.0, None, "µV €"), event(2.0, None, "été")];
        assert_eq!(found.events, expected);
    }

    #[test]
    fn an_invalid_list_is_left_out_and_those_after_it_are_read() {
        for damaged in [
            &b"567\x14\x14"[..],
            b"+5x\x14\x14",
            b"+5\x15?\x14a\x14",
            b"+5\x15\x14a\x14",
            b"+5\x14a",
            b"+5",
        ] {
            let found = parse(&[damaged, b"\0+6\x14b\x14\0"].concat());
            assert_eq!(found.first_invalid, Some(damaged.escape_ascii().to_string()));
            assert_eq!(found.invalid, 1);
            assert_eq!(found.events, [event(6.0, None, "b")]);
        }
    }
}
