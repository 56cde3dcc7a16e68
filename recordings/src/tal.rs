//! Time-stamped annotation lists of EDF+ and BDF+.

use crate::{Event, EventLabel};

/// Separates the texts of one list and ends each of them.
const TEXT_END: u8 = 0x14;
/// Stands between onset and duration.
const DURATION: u8 = 0x15;

/// The annotations of one record.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct RecordAnnotations {
    /// Start of the record, s after the start of the file, from the list without a text that
    /// EDF+ asks for at the beginning of each record.
    pub(crate) record_start_s: Option<f64>,
    pub(crate) events: Vec<Event>,
    /// Whether all bytes were lists or padding.
    pub(crate) intact: bool,
}

/// Reads the annotation bytes of one record: lists `+onset[0x15 duration]0x14 text 0x14 ... 0x00`,
/// padded with zeros (EDF+ specification, 2.2).
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
    // The last text is ended too, so the last part is empty.
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

/// An onset, which always has its sign.
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
    fn a_record_gives_its_start_and_its_annotations() {
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
    fn damage_ends_the_list_and_is_told() {
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
