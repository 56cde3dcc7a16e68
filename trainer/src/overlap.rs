//! Continuous signals from overlapping windows: at each step, the mean of those that cover it.

use crate::dataset::Dataset;

/// Sums of the decoded windows at each step of a dataset, from which the continuous signals follow.
pub(crate) struct OverlapMean<'d> {
    dataset: &'d Dataset,
    hop: usize,
    /// For each segment, the sums at all steps that windows cover, in the order step, electrode.
    sums: Vec<Vec<f32>>,
    /// Index of the segment to which the next window belongs, and number of its windows so far.
    segment: usize,
    window: usize,
}

impl<'d> OverlapMean<'d> {
    pub(crate) fn new(dataset: &'d Dataset, hop: usize) -> Self {
        let dimensions = dataset.dimensions();
        let covered = |segment: &[f32]| {
            let windows = windows(segment, dataset, hop);
            (dimensions.steps + (windows - 1) * hop) * dimensions.electrodes
        };
        Self {
            dataset,
            hop,
            sums: dataset.segments().map(|s| vec![0.0; covered(s)]).collect(),
            segment: 0,
            window: 0,
        }
    }

    /// Adds decoded windows. All calls together must pass the windows in the order of
    /// [`Dataset::aligned`].
    pub(crate) fn add(&mut self, decoded: &[f32]) {
        let dimensions = self.dataset.dimensions();
        for window in decoded.chunks_exact(dimensions.window_electrodes()) {
            let sums = &mut self.sums[self.segment];
            let first = self.window * self.hop * dimensions.electrodes;
            for (sum, value) in sums[first..].iter_mut().zip(window) {
                *sum += value;
            }
            self.window += 1;
            let is_last = first + window.len() == sums.len();
            if is_last {
                (self.segment, self.window) = (self.segment + 1, 0);
            }
        }
    }

    /// Returns the mean of the windows that cover each step, for each segment.
    pub(crate) fn mean(&self) -> Vec<Vec<f32>> {
        let dimensions = self.dataset.dimensions();
        let per_hop = self.hop * dimensions.electrodes;
        let open = dimensions.steps / self.hop;
        let mean = |sums: &Vec<f32>| {
            let hops = sums.len() / per_hop;
            let hop = |(index, sums): (usize, &[f32])| -> Vec<f32> {
                // A hop near either end of a segment, or in a short segment, is in fewer windows.
                let windows = hops + 1 - open;
                let covering = open.min(windows).min(index + 1).min(hops - index);
                let factor = 1.0 / covering as f32;
                sums.iter().map(|sum| sum * factor).collect()
            };
            sums.chunks_exact(per_hop)
                .enumerate()
                .flat_map(hop)
                .collect()
        };
        self.sums.iter().map(mean).collect()
    }

    /// Returns the dataset's values at the steps of [`Self::mean`].
    pub(crate) fn original(&self) -> Vec<Vec<f32>> {
        let segments = self.dataset.segments().zip(&self.sums);
        segments
            .map(|(segment, sums)| segment[..sums.len()].to_vec())
            .collect()
    }
}

/// Returns the number of windows that start at every `hop`-th time step of a segment.
fn windows(segment: &[f32], dataset: &Dataset, hop: usize) -> usize {
    let dimensions = dataset.dimensions();
    (segment.len() / dimensions.electrodes - dimensions.steps) / hop + 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use artifact::Dimensions;

    #[test]
    fn the_mean_of_exact_windows_is_the_signal() {
        let dimensions = Dimensions {
            steps: 16,
            rows: 1,
            columns: 4,
            electrodes: 4,
            numbers: 8,
        };
        // In both segments, no window covers the last steps.
        let segment =
            |steps: u16, first: u16| (0..4 * steps).map(|v| f32::from(v + first)).collect();
        let dataset = Dataset::from_segments(vec![segment(45, 3), segment(16, 900)], dimensions);
        let mut mean = OverlapMean::new(&dataset, 4);
        let windows = dataset.aligned(4);
        assert_eq!(windows.len(), 8 + 1);
        // Add the windows in two parts, neither of which ends with a segment.
        for part in [&windows[..3], &windows[3..]] {
            mean.add(&part.concat());
        }
        let lengths: Vec<usize> = mean.mean().iter().map(Vec::len).collect();
        assert_eq!(lengths, [4 * 44, 4 * 16]);
        for (mean, original) in mean.mean().iter().zip(mean.original()) {
            for (mean, original) in mean.iter().zip(original) {
                assert!((mean - original).abs() < 1e-3, "{mean} {original}");
            }
        }
    }
}
