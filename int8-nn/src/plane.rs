//! The shape of one time step of an activation.

/// Rows, columns and channels of a plane; each kernel says how it is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlaneShape {
    /// Rows.
    pub rows: usize,
    /// Columns.
    pub columns: usize,
    /// Channels (features) of each position.
    pub channels: usize,
}

impl PlaneShape {
    /// Elements in one plane.
    pub const fn len(self) -> usize {
        self.rows * self.columns * self.channels
    }

    /// True for a shape without elements.
    pub const fn is_empty(self) -> bool {
        self.len() == 0
    }

    /// Equality in `const`.
    pub const fn equals(self, other: Self) -> bool {
        self.rows == other.rows && self.columns == other.columns && self.channels == other.channels
    }

    /// The shape that an unpadded 3x3 kernel with `channels` outputs leaves.
    ///
    /// # Panics
    /// When the plane is smaller than the kernel; at compile time in a `const` context.
    #[must_use]
    pub const fn convolved(self, channels: usize) -> Self {
        assert!(
            self.rows >= 3 && self.columns >= 3,
            "the plane is smaller than a 3x3 kernel"
        );
        Self {
            rows: self.rows - 2,
            columns: self.columns - 2,
            channels,
        }
    }

    /// The shape that a 2x2 pool leaves; an odd last row or column is not read.
    #[must_use]
    pub const fn pooled(self) -> Self {
        Self {
            rows: self.rows / 2,
            columns: self.columns / 2,
            channels: self.channels,
        }
    }
}
