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
}
