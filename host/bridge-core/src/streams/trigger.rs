//! Level of the trigger input over time.

use std::collections::VecDeque;

/// Number of edges that are kept. A sample is published at most one frame after the edges before
/// it, and a frame of 62.5 ms is not expected to contain 256 edges.
const MAX_EDGES: usize = 256;

/// Level of the trigger input at each sample, reconstructed from the edges that arrived.
#[derive(Clone, Debug, Default)]
pub(crate) struct Trigger {
    /// Level before the oldest edge in `edges`.
    level_before: u16,
    edges: VecDeque<Edge>,
}

#[derive(Clone, Copy, Debug)]
struct Edge {
    sample: u64,
    level: u16,
}

impl Trigger {
    /// Records an edge: the trigger has the level `level` from ADC sample `sample` on.
    pub(crate) fn record_edge(&mut self, sample: u64, level: u16) {
        if self.edges.len() == MAX_EDGES
            && let Some(oldest) = self.edges.pop_front()
        {
            self.level_before = oldest.level;
        }
        self.edges.push_back(Edge { sample, level });
    }

    /// Discards all edges, because sample indices start at 0 again; the current level stays.
    pub(crate) fn restart(&mut self) {
        if let Some(newest) = self.edges.back() {
            self.level_before = newest.level;
        }
        self.edges.clear();
    }

    /// Returns the trigger level, 0 or 1, at the ADC sample with index `sample` since `Start`. Before
    /// the first edge of the run, returns the level at the end of the previous run, at first 0.
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
    fn the_level_survives_a_restart_and_discarded_edges() {
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
