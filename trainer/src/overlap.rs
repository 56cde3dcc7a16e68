//! Continuous signals from overlapping windows: each step is the mean of the windows that cover it.

use crate::dataset::Dataset;
use artifact::reconstruction::{HopLayout, Overlap, Window};

/// Joins decoded windows, as they arrive, into a continuous signal for each segment of a dataset.
pub(crate) struct OverlapMean {
    overlap: Overlap,
    /// Number of values of a window.
    window: usize,
    /// Number of values of a hop.
    hop: usize,
    /// Number of windows of each segment.
    windows: Vec<usize>,
    /// Signal of each started segment, in the order step, electrode.
    signals: Vec<Vec<f32>>,
}

impl OverlapMean {
    pub(crate) fn new(dataset: &Dataset, hop: usize) -> Self {
        let dimensions = dataset.dimensions();
        let electrodes = dimensions.electrodes;
        let windows = |segment: &[f32]| (segment.len() / electrodes - dimensions.steps) / hop + 1;
        Self {
            overlap: Overlap::new(HopLayout {
                steps: hop,
                electrodes,
                low_latency: false,
                full_scale_uv: f32::INFINITY,
            }),
            window: dimensions.window_electrodes(),
            hop: hop * electrodes,
            windows: dataset.segments().map(windows).collect(),
            signals: vec![Vec::new()],
        }
    }

    /// Adds decoded windows. Over all calls, the windows must be in the order of
    /// [`Dataset::aligned`].
    pub(crate) fn add(&mut self, decoded: &[f32]) {
        for window in decoded.chunks_exact(self.window) {
            let segment = self.signals.len() - 1;
            self.add_hop(segment, Some(window.to_vec()));
            if self.signals[segment].len() == self.windows[segment] * self.hop {
                // Complete the last hops of the segment, which only earlier windows cover.
                for _ in 1..self.window / self.hop {
                    self.add_hop(segment, None);
                }
                self.overlap.forget();
                self.signals.push(Vec::new());
            }
        }
    }

    /// Returns the signal of each segment, at all steps that windows cover.
    pub(crate) fn signals(&self) -> &[Vec<f32>] {
        &self.signals[..self.windows.len()]
    }

    fn add_hop(&mut self, segment: usize, values: Option<Vec<f32>>) {
        let signal = &mut self.signals[segment];
        let index = u32::try_from(signal.len() / self.hop).unwrap_or(u32::MAX);
        let mut hop = vec![0.0; self.hop];
        let window = Window { index, flags: 0, values };
        self.overlap.next_hop(window, &mut hop);
        signal.extend(hop);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use artifact::Dimensions;

    #[test]
    fn the_mean_of_exact_windows_is_the_signal() {
        let dimensions = Dimensions { steps: 16, rows: 1, columns: 4, electrodes: 4, numbers: 8 };
        // In the first segment, no window covers the last step.
        let segment =
            |steps: u16, first: u16| (0..4 * steps).map(|v| f32::from(v + first)).collect();
        let dataset = Dataset::from_segments(vec![segment(45, 3), segment(16, 900)], dimensions);
        let mut mean = OverlapMean::new(&dataset, 4);
        let windows = dataset.aligned(4);
        assert_eq!(windows.len(), 8 + 1);
        // Add the windows in two parts whose boundary is within a segment.
        for part in [&windows[..3], &windows[3..]] {
            mean.add(&part.concat());
        }
        let lengths: Vec<usize> = mean.signals().iter().map(Vec::len).collect();
        assert_eq!(lengths, [4 * 44, 4 * 16]);
        for (signal, segment) in mean.signals().iter().zip(dataset.segments()) {
            for (mean, original) in signal.iter().zip(segment) {
                assert!((mean - original).abs() < 1e-3, "{mean} {original}");
            }
        }
    }
}
