//! The shape of a plane, which is one time step of a layer's input or output.

/// Numbers of rows, columns and channels of a plane. Each kernel documents the order in which it
/// stores a plane's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlaneShape {
    /// Number of rows of positions.
    pub rows: usize,
    /// Number of positions in a row.
    pub columns: usize,
    /// Number of values at each position.
    pub channels: usize,
}

impl PlaneShape {
    /// Returns the number of values in the plane: rows * columns * channels.
    pub const fn len(self) -> usize {
        self.rows * self.columns * self.channels
    }

    /// Returns true if a plane of this shape has no values.
    pub const fn is_empty(self) -> bool {
        self.len() == 0
    }

    /// Returns whether two shapes are equal; unlike `==` it works in a `const` context.
    pub const fn equals(self, other: Self) -> bool {
        self.rows == other.rows && self.columns == other.columns && self.channels == other.channels
    }
}
