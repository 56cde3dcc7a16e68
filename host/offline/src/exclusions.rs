//! Electrodes that the device excluded from its codes, for each row of the decoded signal.

use std::ops::Range;

/// Set of excluded electrodes, valid from `first_row` to the next change.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Change {
    first_row: u64,
    /// Bit n is electrode n.
    excluded: u64,
}

/// Which electrodes the device excluded, and filled from the others, at each row.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Exclusions(Vec<Change>);

/// An electrode, and consecutive rows at which it was excluded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Stretch {
    pub(crate) electrode: usize,
    pub(crate) rows: Range<u64>,
}

impl Exclusions {
    /// Adds a report of the device: from `first_row` on, the electrodes in the bit set `excluded`
    /// are excluded. The device repeats its reports, so that the next report makes up for a lost
    /// one; a repeated report changes nothing.
    pub(crate) fn add(&mut self, first_row: u64, excluded: u64) {
        let last = self.0.last();
        if last.map_or(0, |last| last.excluded) != excluded {
            self.0.push(Change {
                first_row: last.map_or(first_row, |last| first_row.max(last.first_row)),
                excluded,
            });
        }
    }

    /// Returns the electrodes that are excluded at a row; bit n is electrode n.
    pub(crate) fn at(&self, row: u64) -> u64 {
        let begun = self.0.partition_point(|change| change.first_row <= row);
        begun.checked_sub(1).map_or(0, |newest| self.0[newest].excluded)
    }

    /// Returns the stretches of rows at which each electrode was excluded, ordered by electrode.
    /// The signal has `rows` rows.
    pub(crate) fn stretches(&self, electrodes: usize, rows: u64) -> Vec<Stretch> {
        let mut stretches = Vec::new();
        for electrode in 0..electrodes.min(64) {
            let mut start = None;
            let end = Change { first_row: rows, excluded: 0 };
            for change in self.0.iter().chain([&end]) {
                let first_row = change.first_row.min(rows);
                if change.excluded >> electrode & 1 == 1 {
                    start.get_or_insert(first_row);
                } else if let Some(start) = start.take().filter(|start| *start < first_row) {
                    let rows = start..first_row;
                    stretches.push(Stretch { electrode, rows });
                }
            }
        }
        stretches
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stretch_lasts_over_changes_of_other_electrodes_and_to_the_end() {
        let mut exclusions = Exclusions::default();
        for (row, mask) in [(0, 0), (64, 0b01), (64, 0b01), (128, 0b11), (192, 0b10)] {
            exclusions.add(row, mask);
        }
        let masks = [0, 63, 64, 127, 128, 192, 9_999].map(|row| exclusions.at(row));
        assert_eq!(masks, [0, 0, 1, 1, 3, 2, 2]);
        let stretch = |electrode, rows| Stretch { electrode, rows };
        assert_eq!(exclusions.stretches(61, 300), [stretch(0, 64..192), stretch(1, 128..300)]);
        // The signal ends before the second electrode is excluded.
        assert_eq!(exclusions.stretches(61, 100), [stretch(0, 64..100)]);
    }
}
