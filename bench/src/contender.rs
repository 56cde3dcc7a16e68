//! Interface of the code whose instructions are counted.

use crate::block::Block;

/// Code under test that processes four samples of all electrodes at a time.
pub trait Contender {
    /// Stores the next input block; not counted.
    fn load(&mut self, block: &Block);

    /// Processes the stored block; its instructions are counted.
    fn run(&mut self);

    /// Returns the result of [`run`](Self::run), filled up with zeros if it has fewer numbers than
    /// a block.
    fn output(&self) -> Block;
}
