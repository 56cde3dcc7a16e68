//! Events of a recording, at the rows of its decoded signal.

use artifact::Description;
use recordings::{EventLabel, Onsets};

use crate::signal_file::RowEvent;
use crate::survey::Survey;

/// GDF type of the events that mark missing codes: the highest type without a fixed meaning.
const MISSING_TYPE: u16 = 0x00ff;
/// Highest GDF type that is assigned to a text. Types above 255 have fixed meanings, and 255 stands
/// for missing codes.
const LAST_TEXT_TYPE: usize = 0x00fe;

/// Events of a recording, in the order of their rows.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct RowEvents {
    pub(crate) rows: Vec<RowEvent>,
    /// Texts of events, each with the GDF type assigned to it. The types count from 1.
    pub(crate) types: Vec<(String, u16)>,
    /// Number of events that are omitted, because they are outside the decoded signal.
    pub(crate) outside: usize,
    /// Number of events for whose text no GDF type is left.
    pub(crate) untyped: usize,
}

impl RowEvents {
    /// Places the events of a recording, if there is one, at the rows that show them. Adds an event
    /// at the first row of each gap in the codes, and an event for each stretch of rows at which an
    /// electrode was excluded.
    pub(crate) fn new(onsets: Option<&Onsets>, survey: &Survey, description: &Description) -> Self {
        let mut events = Self::default();
        if let Some(onsets) = onsets {
            events.outside = onsets.outside;
            for (onset_s, label) in onsets.seconds.iter().zip(&onsets.labels) {
                match row_of(*onset_s, survey, description) {
                    Some(row) => events.rows.push(RowEvent {
                        rows: row..row,
                        text: label.to_string(),
                        kind: match label {
                            EventLabel::Type(kind) => Some(*kind),
                            EventLabel::Text(_) | EventLabel::SparseSample(_) => None,
                        },
                    }),
                    None => events.outside += 1,
                }
            }
        }
        let hop = description.window.hop as u64;
        let (items, _) = survey.kind.names();
        let gaps = survey.gaps.iter().map(|gap| (gap, u64::from(gap.first) * hop));
        let gaps = gaps.map(|(gap, row)| RowEvent {
            rows: row..row,
            text: format!("{items} missing: {}", gap.windows),
            kind: Some(MISSING_TYPE),
        });
        events.rows.extend(gaps);
        let labels = &description.montage.electrodes;
        let stretches = (survey.exclusions).stretches(labels.len(), survey.rows(description));
        events.rows.extend(stretches.into_iter().map(|stretch| RowEvent {
            // In the text of an annotation, the name of a signal after `@@` means that the
            // annotation is about this signal alone (https://www.edfplus.info/specs/edftexts.html).
            text: format!("substituted@@{}", labels[stretch.electrode]),
            rows: stretch.rows,
            kind: None,
        }));
        events.rows.sort_by_key(|event| event.rows.start);
        events
    }

    /// Assigns a GDF type to each text, because a GDF file has no texts. Counts the events whose
    /// text gets no type, because all types are taken.
    pub(crate) fn assign_types(&mut self) {
        let mut rows = std::mem::take(&mut self.rows);
        for event in rows.iter_mut().filter(|event| event.kind.is_none()) {
            event.kind = self.type_of(&event.text);
            self.untyped += usize::from(event.kind.is_none());
        }
        self.rows = rows;
    }

    /// Returns the GDF type of a text. A new text gets the next free type; `None` if all are taken.
    fn type_of(&mut self, text: &str) -> Option<u16> {
        if let Some((_, kind)) = self.types.iter().find(|(known, _)| known == text) {
            return Some(*kind);
        }
        let kind = self.types.len() + 1;
        let kind = u16::try_from(kind).ok().filter(|_| kind <= LAST_TEXT_TYPE)?;
        self.types.push((text.to_owned(), kind));
        Some(kind)
    }
}

/// Returns the row that shows the electrodes at the time `onset_s`: the row is later than this time
/// by the delay of the filters. `None` if the decoded signal has no such row.
fn row_of(onset_s: f64, survey: &Survey, description: &Description) -> Option<u64> {
    let delay_s = f64::from(survey.announcement.group_delay_us) / 1e6;
    let row = ((onset_s + delay_s) * f64::from(description.window.rate_hz)).round();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "onsets are not negative; beyond 2^64 rows it saturates"
    )]
    let row = row as u64;
    (row < survey.rows(description)).then_some(row)
}
