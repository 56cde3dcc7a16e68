//! The streaming encoder: one step in, a code whenever a window is complete.

use int8_nn::{InputConv, Pair, PlaneRing, Winograd, requantise, saturate_u8, unscaled};
use model::{
    CELL_PLANE, CELLS, ELECTRODE_PAIRS, GRID_CELL, HIDDEN, HIDDEN_PAIRS, NETWORK, Network, POOLED,
    POOLED_PAIRS, POOLED_STEPS, STEPS,
};

use crate::{
    Code, Plane, Step,
    window::{OPEN, OpenWindow},
};

/// Pairs in a plane of the first convolution.
const HIDDEN_PLANE: usize = HIDDEN.rows * HIDDEN.columns * HIDDEN_PAIRS;
/// Scratch of the first convolution.
const PATCHES: usize = NETWORK.conv1.patches_len();
const SUMS: usize = NETWORK.conv1.sums_len();
/// Pairs in a transformed plane.
const TRANSFORMED: usize = NETWORK.conv2.transformed_len();

/// The half of the pipeline that runs at the steps' rate.
///
/// Each layer's planes are computed once, as soon as their inputs exist, and added to the (at most
/// two) windows that they belong to: a 50 % overlap costs nothing, and the codes equal those of a
/// batch encoder over each window bit for bit, because time is not padded and the hop is even. The
/// work is the same in every step but for the fully connected layer: of a pooled plane that belongs to
/// two windows, the newer one's share waits for the next step.
#[derive(Clone, Debug)]
pub struct Encoder<'w> {
    network: &'w Network<'w>,
    /// The last input planes, every cell with its right neighbour.
    input: PlaneRing<Pair, CELLS, 3>,
    patches: [Pair; PATCHES],
    sums: [i32; SUMS],
    hidden: [Pair; HIDDEN_PLANE],
    /// The last planes behind the first convolution, transformed.
    transformed: PlaneRing<Pair, TRANSFORMED, 3>,
    /// Largest sums of the pool so far.
    largest: [i32; POOLED.len()],
    pooled: [Pair; POOLED_PAIRS],
    /// Window and place in it to which the pooled plane has yet to be added.
    deferred: Option<(usize, usize)>,
    windows: [OpenWindow; OPEN],
    /// Steps taken so far; 2^64 of them last four billion years.
    step: u64,
}

impl Encoder<'static> {
    /// An encoder with the built-in network that has seen nothing.
    pub const fn new() -> Self {
        Self::with(&NETWORK)
    }
}

impl Default for Encoder<'static> {
    fn default() -> Self {
        Self::new()
    }
}

impl<'w> Encoder<'w> {
    /// An encoder with another network of the same shape; see [`Network::is_consistent`].
    pub const fn with(network: &'w Network<'w>) -> Self {
        Self {
            network,
            input: PlaneRing::filled(Pair::ZERO),
            patches: [Pair::ZERO; PATCHES],
            sums: [0; SUMS],
            hidden: [Pair::ZERO; HIDDEN_PLANE],
            transformed: PlaneRing::filled(Pair::ZERO),
            largest: [i32::MIN; POOLED.len()],
            pooled: [Pair::ZERO; POOLED_PAIRS],
            deferred: None,
            windows: [OpenWindow::EMPTY; OPEN],
            step: 0,
        }
    }

    /// Takes the next step; gives a code when it completes a window.
    pub fn push(&mut self, step: &Step) -> Option<Code> {
        let index = self.step;
        self.step += 1;
        self.network
            .conv1
            .pair_up(&step.plane, self.input.advance());
        self.add_to_windows(index, step);
        if let Some((slot, offset)) = self.deferred.take() {
            self.windows[slot].add_pooled(&self.network.fc[offset], &self.pooled);
        }
        if index >= 2 {
            self.hidden_plane();
        }
        if index >= 4 {
            self.convolve(index - 4);
        }
        self.complete(index)
    }

    fn add_to_windows(&mut self, index: u64, step: &Step) {
        let electrodes = gather(&step.plane);
        for (slot, offset) in places(index, self.network.hop, STEPS) {
            let window = &mut self.windows[slot];
            if offset == 0 {
                *window = OpenWindow::starting_with(step, self.network);
            }
            window.add_step(step, &self.network.shortcut[offset], &electrodes);
        }
    }

    /// The first convolution's plane that the newest input plane completes, transformed for the
    /// second one.
    fn hidden_plane(&mut self) {
        self.conv1().plane(
            self.input.oldest_first(),
            &mut self.patches,
            &mut self.sums,
            &mut self.hidden,
        );
        self.conv2()
            .transform(&self.hidden, self.transformed.advance());
    }

    /// The network's first convolution. It has this shape; here the compiler knows it, and checks and
    /// strides vanish.
    #[inline]
    fn conv1(&self) -> InputConv<'w, { CELL_PLANE.columns }> {
        InputConv {
            rows: CELL_PLANE.rows,
            output: HIDDEN,
            ..self.network.conv1
        }
    }

    /// The second one, likewise.
    #[inline]
    fn conv2(&self) -> Winograd<'w, HIDDEN_PAIRS, { HIDDEN.columns }> {
        Winograd {
            tile_rows: POOLED.rows,
            outputs: POOLED.channels,
            ..self.network.conv2
        }
    }

    /// The second convolution's `plane`-th plane; every second one completes a pooled plane.
    fn convolve(&mut self, plane: u64) {
        self.conv2()
            .pool(self.transformed.oldest_first(), &mut self.largest);
        if plane.is_multiple_of(2) {
            return;
        }
        self.finish_pool();
        let mut places = places(plane / 2, self.network.hop / 2, POOLED_STEPS);
        // Of two windows only the older can end with this step.
        let (newer, older) = (places.next(), places.next());
        let now = if older.is_some() {
            self.deferred = newer;
            older
        } else {
            newer
        };
        if let Some((slot, offset)) = now {
            self.windows[slot].add_pooled(&self.network.fc[offset], &self.pooled);
        }
    }

    /// Brings the pool's sums to 8 bits, and begins with the next pool.
    fn finish_pool(&mut self) {
        let bias = self.network.conv2_bias.as_chunks::<2>().0;
        let multipliers = self.network.conv2_multipliers.as_chunks::<2>().0;
        let places = self.largest.chunks_exact_mut(POOLED.channels);
        for (sums, pooled) in places.zip(self.pooled.chunks_exact_mut(POOLED.channels / 2)) {
            let channels = bias.iter().zip(multipliers);
            let sums = sums.as_chunks_mut::<2>().0.iter_mut().zip(channels);
            for (pair, (sums, (bias, multipliers))) in pooled.iter_mut().zip(sums) {
                let activation = |index: usize| {
                    let sum = unscaled(sums[index]).wrapping_add(bias[index]);
                    i16::from(saturate_u8(requantise(sum, multipliers[index])))
                };
                *pair = Pair::new([activation(0), activation(1)]);
                *sums = [i32::MIN; 2];
            }
        }
    }

    /// The code of the window that ends with step `index`, if one does.
    fn complete(&self, index: u64) -> Option<Code> {
        let first = (index + 1).checked_sub(STEPS as u64)?;
        let hop = self.network.hop as u64;
        if first & (hop - 1) != 0 {
            return None;
        }
        let window = first >> hop.trailing_zeros();
        #[expect(
            clippy::cast_possible_truncation,
            reason = "the window index wraps at 2^32"
        )]
        let number = window as u32;
        Some(self.windows[slot_of(window)].code(number, self.network))
    }
}

/// The electrodes of a plane, in the montage's order, filled up with zeros.
fn gather(plane: &Plane) -> [Pair; ELECTRODE_PAIRS] {
    let mut electrodes = [Pair::ZERO; ELECTRODE_PAIRS];
    let cells = GRID_CELL.iter().map(|&cell| plane[usize::from(cell)]);
    Pair::fill(&mut electrodes, cells.map(i16::from));
    electrodes
}

/// The open windows that a plane belongs to, as (slot, index of the plane within the window):
/// window `w` covers the planes `w * hop .. w * hop + length`. The hop is a power of two, so nothing
/// is divided: 64 bits take a Cortex-M a hundred instructions.
fn places(plane: u64, hop: usize, length: usize) -> impl Iterator<Item = (usize, usize)> {
    debug_assert!(hop.is_power_of_two());
    let newest = plane >> hop.trailing_zeros();
    #[expect(clippy::cast_possible_truncation, reason = "a remainder below the hop")]
    let phase = plane as usize & (hop - 1);
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
        // Without overlap, two of eight pooled planes lie between the windows.
        let apart = |plane| places(plane, 8, 6).collect::<Vec<_>>();
        assert_eq!(apart(5), [(0, 5)]);
        assert_eq!(apart(6), []);
        assert_eq!(apart(8), [(1, 0)]);
    }

    #[test]
    fn a_code_carries_what_its_sixteen_steps_lost_and_where_they_began() {
        let mut encoder = Encoder::new();
        let hop = NETWORK.hop as u64;
        let codes: Vec<Code> = (0..64)
            .filter_map(|index| {
                encoder.push(&Step {
                    sample: 1_000 + 4 * index,
                    offset_us: u16::try_from(index).expect("64 steps"),
                    clipped: u16::from(index == 3 * hop),
                    saturated: u64::from(index == 3 * hop - 1) << 40,
                    settling: index == 2 * hop,
                    ..Step::default()
                })
            })
            .collect();
        for (number, code) in (0_u32..).zip(&codes) {
            let first = u64::from(number) * hop;
            let covers = |index| (first..first + STEPS as u64).contains(&index);
            assert_eq!(code.window, number);
            assert_eq!(code.first_sample, 1_000 + 4 * first);
            assert_eq!(u64::from(code.offset_us), first + STEPS as u64 - 1);
            assert_eq!(code.clipped, u16::from(covers(3 * hop)));
            assert_eq!(code.saturated, u64::from(covers(3 * hop - 1)) << 40);
            assert_eq!(code.settling, first == 2 * hop);
        }
        assert_eq!(codes.len() as u64, (64 - STEPS as u64) / hop + 1);
    }
}
