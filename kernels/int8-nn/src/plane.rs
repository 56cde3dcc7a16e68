//! The shape of a plane: one time step of an activation.

/// Rows, columns and channels of a plane; each kernel documents the memory order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlaneShape {
    /// Number of positions along the slower spatial axis.
    pub rows: usize,
    /// Number of positions along the faster spatial axis.
    pub columns: usize,
    /// Number of values at each position.
    pub channels: usize,
}

impl PlaneShape {
    /// Returns the number of elements: rows * columns * channels.
    pub const fn len(self) -> usize {
        self.rows * self.columns * self.channels
    }

    /// Returns true for a shape without elements.
    pub const fn is_empty(self) -> bool {
        self.len() == 0
    }

    /// Returns whether two shapes are equal; unlike `==` it works in a `const` context.
    pub const fn equals(self, other: Self) -> bool {
        self.rows == other.rows && self.columns == other.columns && self.channels == other.channels
    }
}
