//! Parses the time-stamped annotation lists (TALs) of EDF+ and BDF+.

use crate::event::{Event, EventLabel};

/// Byte after the time stamp and after each text of an annotation list.
const TEXT_END: u8 = 0x14;
/// Byte between the onset and the duration in the time stamp of an annotation list.
const DURATION: u8 = 0x15;

#[derive(Debug, Default, PartialEq)]
pub(crate) struct RecordAnnotations {
    /// Start of the record, in seconds since the start of the file: the onset of the first list
    /// whose first text is empty. EDF+ requires such a list in each record; `None` if it is
    /// missing.
    pub(crate) record_start_s: Option<f64>,
    pub(crate) events: Vec<Event>,
    /// True if all bytes were parsed, that is, no list was invalid.
    pub(crate) intact: bool,
}

/// Parses the annotation bytes of one record: lists `+onset[0x15 duration]0x14 text 0x14 ... 0x00`,
/// padded with zeros (EDF+ specification, section 2.2). Stops at the first invalid list.
pub(crate) fn parse(bytes: &[u8]) -> RecordAnnotations {
    let mut found = RecordAnnotations {
        intact: true,
        ..RecordAnnotations::default()
    };
    for list in bytes
        .split(|&byte| byte == 0)
        .filter(|list| !list.is_empty())
    {
        if !parse_list(list, &mut found) {
            found.intact = false;
            break;
        }
    }
    found
}

fn parse_list(list: &[u8], found: &mut RecordAnnotations) -> bool {
    let mut parts = list.split(|&byte| byte == TEXT_END);
    let mut times = parts
        .next()
        .unwrap_or_default()
        .split(|&byte| byte == DURATION);
    let Some(onset_s) = times.next().and_then(signed_seconds) else {
        return false;
    };
    let duration_s = match times.next().map(seconds) {
        Some(None) => return false,
        Some(length) => length,
        None => None,
    };
    let texts: Vec<&[u8]> = parts.collect();
    // Every text, also the last, ends with a separator, so the last part must be empty.
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
        let text = String::from_utf8_lossy(text).into_owned();
        let label = EventLabel::Text(text);
        found.events.push(Event {
            onset_s,
            duration_s,
            signal: None,
            label,
        });
    }
    true
}

/// Parses an onset in seconds, which must start with a sign.
fn signed_seconds(bytes: &[u8]) -> Option<f64> {
    if matches!(bytes.first(), Some(b'+' | b'-')) {
        seconds(bytes)
    } else {
        None
    }
}

fn seconds(bytes: &[u8]) -> Option<f64> {
    let value: f64 = std::str::from_utf8(bytes).ok()?.parse().ok()?;
    value.is_finite().then_some(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn event(onset_s: f64, duration_s: Option<f64>, text: &str) -> Event {
        Event {
            onset_s,
            duration_s,
            signal: None,
            label: EventLabel::Text(text.to_owned()),
        }
    }

    #[test]
    fn a_record_has_a_start_and_annotations() {
        let found =
            parse(b"+567\x14\x14\0+567.5\x152\x14Lights off\x14Closed\x14\0-1.5\x14x\x14\0\0\0");
        assert_eq!(found.record_start_s, Some(567.0));
        assert!(found.intact);
        assert_eq!(
            found.events,
            [
                event(567.5, Some(2.0), "Lights off"),
                event(567.5, Some(2.0), "Closed"),
                event(-1.5, None, "x"),
            ]
        );
    }

    #[test]
    fn an_invalid_list_ends_parsing_and_is_reported() {
        for damaged in [
            &b"567\x14\x14\0"[..],
            b"+5x\x14\x14\0",
            b"+5\x15?\x14a\x14\0",
            b"+5\x14a\0",
            b"+5",
        ] {
            let found = parse(damaged);
            assert!(!found.intact, "{}", damaged.escape_ascii());
            assert!(found.events.is_empty());
        }
    }
}
