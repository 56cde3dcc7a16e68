use crate::description::{Description, NetworkShape, Padding};
use crate::shapes::{CHANNELS2, COLUMNS, KERNEL, ROWS, STEPS};

/// Sizes of the volumes between the layers, each in steps, rows, columns.
///
/// | Padding | behind conv1 | behind conv2 |
/// | --- | --- | --- |
/// | `none` | 14 x 8 x 7 | 12 x 6 x 5 |
/// | `space` | 14 x 10 x 9 | 12 x 10 x 9 |
/// | `all` | 16 x 10 x 9 | 16 x 10 x 9 |
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Geometry {
    /// What both convolutions read beyond their input's edges.
    pub padding: Padding,
    /// Of how many values the max-pool keeps the largest.
    pub pool: [usize; 3],
    /// Behind the first convolution, 16 channels.
    pub hidden: [usize; 3],
    /// Behind the second convolution, 32 channels.
    pub feature_map: [usize; 3],
    /// Behind the max-pool, which drops what does not fill a pool.
    pub pooled: [usize; 3],
}

impl Geometry {
    /// The sizes that a description holds.
    ///
    /// # Panics
    /// When a pool has no steps, rows or columns. No [`crate::Artifact`] holds such a description.
    pub fn of(description: &Description) -> Self {
        Self::new(&description.network)
    }

    /// As [`Geometry::of`], from the part of a description that says them.
    ///
    /// # Panics
    /// As [`Geometry::of`].
    pub const fn new(network: &NetworkShape) -> Self {
        let NetworkShape { padding, pool } = *network;
        let hidden = convolved([STEPS, ROWS, COLUMNS], padding);
        let feature_map = convolved(hidden, padding);
        Self {
            padding,
            pool,
            hidden,
            feature_map,
            pooled: [
                feature_map[0] / pool[0],
                feature_map[1] / pool[1],
                feature_map[2] / pool[2],
            ],
        }
    }

    /// Inputs of the fully connected layer: channel, step, row, column, the last fastest.
    pub const fn flat(&self) -> usize {
        CHANNELS2 * self.pooled[0] * self.pooled[1] * self.pooled[2]
    }
}

/// The size behind a convolution.
const fn convolved(size: [usize; 3], padding: Padding) -> [usize; 3] {
    let pads = padding.pads();
    [
        size[0] + 2 * pads[0] - (KERNEL - 1),
        size[1] + 2 * pads[1] - (KERNEL - 1),
        size[2] + 2 * pads[2] - (KERNEL - 1),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn padding_and_pool_give_the_sizes_worked_out_by_hand() {
        let cases = [
            (Padding::None, [2, 2, 2], [12, 6, 5], [6, 3, 2], 1_152),
            (Padding::None, [4, 6, 5], [12, 6, 5], [3, 1, 1], 96),
            (Padding::Space, [2, 2, 2], [12, 10, 9], [6, 5, 4], 3_840),
            (Padding::Space, [1, 3, 3], [12, 10, 9], [12, 3, 3], 3_456),
            (Padding::All, [2, 2, 2], [16, 10, 9], [8, 5, 4], 5_120),
        ];
        for (padding, pool, feature_map, pooled, flat) in cases {
            let geometry = Geometry::new(&NetworkShape { padding, pool });
            assert_eq!(
                (geometry.feature_map, geometry.pooled, geometry.flat()),
                (feature_map, pooled, flat),
                "{padding:?} {pool:?}"
            );
        }
    }
}
