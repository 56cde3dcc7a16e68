//! The level of the trigger input.

use std::collections::VecDeque;

/// Edges that are remembered: samples are published within a frame of their edges, and no
/// experiment has this many edges in one.
const MAX_EDGES: usize = 256;

/// The level of the trigger input from sample to sample, as far as edges have come.
#[derive(Clone, Debug, Default)]
pub(crate) struct Trigger {
    /// Level before the oldest edge that is remembered.
    level_before: u16,
    edges: VecDeque<Edge>,
}

#[derive(Clone, Copy, Debug)]
struct Edge {
    sample: u64,
    level: u16,
}

impl Trigger {
    /// From `sample` on the level is `level`.
    pub(crate) fn record_edge(&mut self, sample: u64, level: u16) {
        if self.edges.len() == MAX_EDGES
            && let Some(oldest) = self.edges.pop_front()
        {
            self.level_before = oldest.level;
        }
        self.edges.push_back(Edge { sample, level });
    }

    /// Samples count from 0 again; the level stays.
    pub(crate) fn restart(&mut self) {
        if let Some(newest) = self.edges.back() {
            self.level_before = newest.level;
        }
        self.edges.clear();
    }

    /// 0 or 1: the level when an ADC sample was taken, by its index since Start; 0 before the first
    /// edge ever.
    pub(crate) fn level_at(&self, sample: u64) -> u16 {
        let newest = self.edges.iter().rev().find(|edge| edge.sample <= sample);
        newest.map_or(self.level_before, |edge| edge.level)
    }
}

#[cfg(test)]
mod tests {
    use super::{MAX_EDGES, Trigger};

    #[test]
    fn the_level_changes_at_the_sample_of_its_edge() {
        let mut trigger = Trigger::default();
        trigger.record_edge(10, 1);
        trigger.record_edge(20, 0);
        assert_eq!(
            [9, 10, 19, 20].map(|sample| trigger.level_at(sample)),
            [0, 1, 1, 0]
        );
    }

    #[test]
    fn the_level_outlives_a_restart_and_edges_that_are_forgotten() {
        let mut trigger = Trigger::default();
        trigger.record_edge(10, 1);
        trigger.restart();
        assert_eq!(trigger.level_at(0), 1);
        for edge in 0..=MAX_EDGES as u64 {
            trigger.record_edge(100 + edge, 0);
        }
        assert_eq!((trigger.level_at(100), trigger.edges.len()), (0, MAX_EDGES));
    }
}
