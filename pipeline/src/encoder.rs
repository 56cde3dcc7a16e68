//! The streaming encoder: one plane in, a code whenever a window is complete.

use int8_nn::{PlaneRing, max_pool, requantise_plane};
use model::{
    CELLS, CODE, CONV1, CONV1_MULTIPLIERS, CONV2, CONV2_MULTIPLIERS, ELECTRODES, GRID_CELL, HOP,
    STEPS,
};

use crate::{
    Plane,
    window::{OPEN, OpenWindow},
};

const HIDDEN: usize = CONV1.output().len();
const SUMS: usize = CONV2.output().len();
const POOLED: usize = CONV2.output().pooled().len();

/// Pooled planes of a window: (16 - 2 - 2) / 2.
const POOLED_STEPS: usize = (STEPS - 4) / 2;
/// Pooled planes from one window to the next.
const POOLED_HOP: usize = HOP / 2;

/// A complete window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EncoderOutput {
    /// Index of the window since the start; wraps.
    pub window: u32,
    /// int8 codes.
    pub values: [i8; CODE],
}

/// State of the encoder over a stream of planes.
///
/// Each layer's planes are computed once, as soon as their inputs exist, and added to the (at most
/// two) windows that they belong to: a 50 % overlap costs nothing, and the codes equal those of a
/// batch encoder over each window bit for bit, because time is not padded and the hop is even.
#[derive(Clone, Debug)]
pub struct Encoder {
    input: PlaneRing<i8, CELLS, 3>,
    hidden: PlaneRing<u8, HIDDEN, 3>,
    /// Accumulators of the second convolution: the earlier and the later plane of a pool.
    sums: [[i32; SUMS]; 2],
    /// Scratch for the first convolution's accumulators.
    hidden_sums: [i32; HIDDEN],
    windows: [OpenWindow; OPEN],
    /// Planes pushed so far; stops counting at the end of its range, centuries from now.
    step: u64,
}

impl Encoder {
    /// An encoder that has seen nothing.
    pub const fn new() -> Self {
        Self {
            input: PlaneRing::filled(0),
            hidden: PlaneRing::filled(0),
            sums: [[0; SUMS]; 2],
            hidden_sums: [0; HIDDEN],
            windows: [OpenWindow::EMPTY; OPEN],
            step: 0,
        }
    }

    /// Takes the plane of the next time step; gives a code when it completes a window.
    pub fn push(&mut self, plane: &Plane) -> Option<EncoderOutput> {
        let step = self.step;
        self.step += 1;
        *self.input.advance() = *plane;
        self.add_to_shortcut(step, plane);
        if step >= 2 {
            self.hidden_plane();
        }
        if step >= 4 {
            self.convolve(step);
        }
        self.complete(step)
    }

    fn add_to_shortcut(&mut self, step: u64, plane: &Plane) {
        let electrodes: [i8; ELECTRODES] =
            core::array::from_fn(|electrode| plane[usize::from(GRID_CELL[electrode])]);
        for (slot, offset) in places(step, HOP, STEPS) {
            let window = &mut self.windows[slot];
            if offset == 0 {
                *window = OpenWindow::EMPTY;
            }
            window.add_step(offset, &electrodes);
        }
    }

    /// The first convolution's plane that the newest input plane completes.
    fn hidden_plane(&mut self) {
        CONV1.plane(self.input.oldest_first(), &mut self.hidden_sums);
        requantise_plane(&self.hidden_sums, &CONV1_MULTIPLIERS, self.hidden.advance());
    }

    /// The second convolution's plane; every second one completes a pooled plane.
    fn convolve(&mut self, step: u64) {
        let plane = step - 4;
        let later = usize::from(!plane.is_multiple_of(2));
        CONV2.plane(self.hidden.oldest_first(), &mut self.sums[later]);
        if later == 0 {
            return;
        }
        let mut pooled = [0; POOLED];
        let [earlier, later] = &self.sums;
        max_pool(
            CONV2.output(),
            [earlier, later],
            &CONV2_MULTIPLIERS,
            &mut pooled,
        );
        for (slot, offset) in places(plane / 2, POOLED_HOP, POOLED_STEPS) {
            self.windows[slot].add_pooled(offset, &pooled);
        }
    }

    /// The code of the window that ends with `step`, if one does.
    fn complete(&self, step: u64) -> Option<EncoderOutput> {
        let first = (step + 1).checked_sub(STEPS as u64)?;
        let hop = HOP as u64;
        if !first.is_multiple_of(hop) {
            return None;
        }
        let window = first / hop;
        #[expect(
            clippy::cast_possible_truncation,
            reason = "the window index wraps at 2^32"
        )]
        let index = window as u32;
        Some(EncoderOutput {
            window: index,
            values: self.windows[slot_of(window)].code(),
        })
    }
}

impl Default for Encoder {
    fn default() -> Self {
        Self::new()
    }
}

/// The open windows that a plane belongs to, as (slot, index of the plane within the window):
/// window `w` covers the planes `w * hop .. w * hop + length`.
fn places(plane: u64, hop: usize, length: usize) -> impl Iterator<Item = (usize, usize)> {
    let newest = plane / hop as u64;
    #[expect(clippy::cast_possible_truncation, reason = "a remainder below the hop")]
    let phase = (plane % hop as u64) as usize;
    (0..OPEN).filter_map(move |age| {
        let window = newest.checked_sub(age as u64)?;
        let offset = phase + age * hop;
        (offset < length).then(|| (slot_of(window), offset))
    })
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "a remainder below the number of slots"
)]
fn slot_of(window: u64) -> usize {
    (window % OPEN as u64) as usize
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;

    #[test]
    fn a_plane_belongs_to_the_windows_that_cover_it() {
        let all = |plane| places(plane, 8, 16).collect::<Vec<_>>();
        assert_eq!(all(0), [(0, 0)]);
        assert_eq!(all(7), [(0, 7)]);
        assert_eq!(all(8), [(1, 0), (0, 8)]);
        assert_eq!(all(16), [(0, 0), (1, 8)]);
        // A window's six pooled planes: the last two overlap with the next window's first.
        let pooled = |plane| places(plane, 4, 6).collect::<Vec<_>>();
        assert_eq!(pooled(3), [(0, 3)]);
        assert_eq!(pooled(5), [(1, 1), (0, 5)]);
        assert_eq!(pooled(6), [(1, 2)]);
    }
}
