//! The argument block of the assembler kernels.

use crate::pair::Pair;

/// Arguments of a kernel, which receives their address and copies them to its stack.
#[repr(C)]
pub(super) struct Arguments<const SEGMENTS: usize> {
    /// Inputs of the next position, in each segment.
    pub(super) inputs: [*const Pair; SEGMENTS],
    pub(super) weights: *const Pair,
    pub(super) sums: *mut i32,
    /// Address after the last sum.
    pub(super) end: *mut i32,
}
