//! Converts times in a file to times in the played signal, which has no gaps.

use crate::header::Header;
use crate::ratio::Ratio;

/// Smallest distance from the end of a record to the start of the next that counts as a gap, s: far
/// less than a sample, and above the rounding of the decimals that files state.
const GAP_MIN_S: f64 = 1e-6;

/// Where each record starts, in the file and in the signal.
#[derive(Debug, Default)]
pub(crate) struct Timeline {
    /// Start of each record in the file, and in the played signal, s; ascending. For a file without
    /// gaps, holds at most the first record.
    records: Vec<(f64, f64)>,
    /// Duration, in s, of the stretch without gaps that starts at each entry of `records`: one
    /// record if the format allows gaps, otherwise the whole signal.
    section_s: f64,
    /// Duration of a record, s.
    record_s: f64,
    /// Duration of the whole signal, s.
    end_s: f64,
    pub(crate) gaps: Gaps,
}

/// Gaps between records, as found so far.
#[derive(Debug, Default, Clone, Copy)]
pub(crate) struct Gaps {
    pub(crate) count: u64,
    /// Sum of all gaps, s.
    pub(crate) seconds: f64,
    /// Number of records without a time, or whose time is not after the previous record's time.
    pub(crate) unstated: u64,
}

impl Timeline {
    /// Creates the timeline of `records` records, none of which has a time yet.
    pub(crate) fn new(header: &Header, records: u64) -> Self {
        let record_s = header.record_duration.map_or(0.0, Ratio::value);
        let end_s = header.seconds(records);
        let can_have_gaps = header.format.is_discontinuous();
        Self {
            section_s: if can_have_gaps { record_s } else { end_s },
            record_s,
            end_s,
            ..Self::default()
        }
    }

    /// Adds record `record` with its start in the file, s. A record without a usable start is
    /// assumed to follow the previous record without a gap.
    #[expect(clippy::cast_precision_loss, reason = "records stay below 2^53")]
    pub(crate) fn add_record(&mut self, record: u64, stated_s: Option<f64>) {
        let last_s = self.records.last().map(|(start, _)| *start);
        let follows = last_s.map_or(0.0, |last| last + self.record_s);
        let usable = stated_s.filter(|start| last_s.is_none_or(|last| last < *start));
        let start = usable.unwrap_or(follows);
        self.gaps.unstated += u64::from(usable.is_none());
        let gap = start - follows;
        if last_s.is_some() && gap.abs() > GAP_MIN_S {
            self.gaps.count += 1;
            self.gaps.seconds += gap;
        }
        self.records.push((start, record as f64 * self.record_s));
    }

    /// Converts a time in the file to a time in the signal, s; `None` if it is outside the signal.
    /// A time within a gap becomes the end of the record before the gap.
    pub(crate) fn place(&self, file_s: f64) -> Option<f64> {
        let after = self.records.partition_point(|(start, _)| *start <= file_s);
        let place = match after.checked_sub(1) {
            Some(record) => {
                let (start, place) = self.records[record];
                place + (file_s - start).min(self.section_s)
            }
            // Without record times, which only EDF+ and BDF+ state, times in the signal equal times
            // in the file.
            None if self.records.is_empty() => file_s,
            None => return None,
        };
        (0.0..self.end_s).contains(&place).then_some(place)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_between_records_are_closed() {
        let mut timeline =
            Timeline { section_s: 1.0, record_s: 1.0, end_s: 5.0, ..Timeline::default() };
        // Records of 1 s start at 0.5 s and 1.5 s and, after a gap of 7.5 s, at 10 s. The fourth
        // record has no time, and the fifth an impossible time: both follow without a gap.
        let starts = [Some(0.5), Some(1.5), Some(10.0), None, Some(3.0)];
        for (record, start) in (0..).zip(starts) {
            timeline.add_record(record, start);
        }
        let gaps = timeline.gaps;
        assert_eq!((gaps.count, gaps.unstated), (1, 2));
        assert!((gaps.seconds - 7.5).abs() < 1e-9);
        for (file_s, place) in [
            (0.4, None),
            (0.5, Some(0.0)),
            (1.75, Some(1.25)),
            (5.0, Some(2.0)),
            (10.25, Some(2.25)),
            (11.25, Some(3.25)),
            (12.5, Some(4.5)),
            (13.0, None),
        ] {
            assert_eq!(timeline.place(file_s), place, "{file_s} s");
        }
    }
}
