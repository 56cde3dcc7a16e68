//! Interface of the code whose instructions are counted.

use crate::block::Block;

/// Code under test that processes four samples of all electrodes at a time.
pub trait Contender {
    /// Stores the next input block. The instructions of this function are not counted.
    fn load(&mut self, block: &Block);

    /// Processes the stored block. The instructions of this function are counted.
    fn run(&mut self);

    /// Returns the result of [`run`](Self::run). If it has fewer numbers than a block, the rest is
    /// zeros.
    fn output(&self) -> Block;
}
