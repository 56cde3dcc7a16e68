//! The streaming encoder: one step in, a code whenever a window is complete.

mod convolutions;
mod edges;
mod hidden_plane;
mod pool;

use core::borrow::BorrowMut;

use int8_nn::Pair;
use model::{ELECTRODE_PAIRS, GRID_CELL, HAS_CONVOLUTIONS, HAS_SHORTCUT, NETWORK, Network, STEPS};

use crate::{
    Code, Plane, Step,
    window::{OPEN, OpenWindow},
};
use convolutions::Convolutions;

/// The half of the pipeline that runs at the steps' rate.
///
/// Each layer's planes are computed once, as soon as their inputs exist, and added to the (at most
/// two) windows that they belong to: a 50 % overlap costs nothing, and the codes equal those of a
/// batch encoder over each window bit for bit, because the hop is a multiple of the pool's steps. Only
/// where time is padded, a window has planes of its own, at its ends. The work is the same in every
/// step but for them and the fully connected layer: of a pooled plane that belongs to two windows, the
/// newer one's share waits for the next step.
///
/// `M` is its memory, or a reference to it.
#[derive(Clone, Debug)]
pub struct Encoder<'w, M = EncoderMemory> {
    network: &'w Network<'w>,
    memory: M,
}

/// What an encoder remembers: some 16 KB, which a static holds better than a stack. Nothing in it is
/// other than zero at first, so that it takes no flash there.
#[derive(Clone, Debug)]
pub struct EncoderMemory {
    /// One, if the network has them.
    convolutions: [Convolutions; HAS_CONVOLUTIONS as usize],
    windows: [OpenWindow; OPEN],
    /// Steps taken so far; 2^64 of them last four billion years.
    step: u64,
}

impl EncoderMemory {
    /// Nothing seen.
    pub const EMPTY: Self = Self {
        convolutions: [Convolutions::EMPTY; HAS_CONVOLUTIONS as usize],
        windows: [OpenWindow::EMPTY; OPEN],
        step: 0,
    };
}

impl<M: BorrowMut<EncoderMemory>> Encoder<'static, M> {
    /// An encoder with the built-in network and this memory, which has seen nothing.
    pub const fn remembering_in(memory: M) -> Self {
        Self {
            network: &NETWORK,
            memory,
        }
    }
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
            memory: EncoderMemory::EMPTY,
        }
    }
}

impl<M: BorrowMut<EncoderMemory>> Encoder<'_, M> {
    /// Forgets what it has seen, in place: the next step is the first.
    pub fn restart(&mut self) {
        self.memory.borrow_mut().restart();
    }

    /// Takes the next step; gives a code when it completes a window.
    pub fn push(&mut self, step: &Step) -> Option<Code> {
        self.memory.borrow_mut().push(step, self.network)
    }
}

impl EncoderMemory {
    fn restart(&mut self) {
        // Planes of the past are overwritten before anything reads them.
        for convolutions in &mut self.convolutions {
            convolutions.restart();
        }
        self.windows = [OpenWindow::EMPTY; OPEN];
        self.step = 0;
    }

    fn push(&mut self, step: &Step, network: &Network<'_>) -> Option<Code> {
        let index = self.step;
        self.step += 1;
        self.add_to_windows(index, step, network);
        for convolutions in &mut self.convolutions {
            convolutions.push(index, &step.plane, network, &mut self.windows);
        }
        self.complete(index, network)
    }

    fn add_to_windows(&mut self, index: u64, step: &Step, network: &Network<'_>) {
        let electrodes = gather(&step.plane);
        for (slot, offset) in places(index, network.hop, STEPS) {
            let window = &mut self.windows[slot];
            if offset == 0 {
                *window = OpenWindow::starting_with(step, network);
            }
            window.count(step);
            if HAS_SHORTCUT {
                window.add_electrodes(network.shortcut[offset], &electrodes);
            }
        }
    }

    /// The code of the window that ends with step `index`, if one does.
    fn complete(&self, index: u64, network: &Network<'_>) -> Option<Code> {
        let first = (index + 1).checked_sub(STEPS as u64)?;
        let hop = network.hop as u64;
        if first & (hop - 1) != 0 {
            return None;
        }
        let window = first >> hop.trailing_zeros();
        #[expect(
            clippy::cast_possible_truncation,
            reason = "the window index wraps at 2^32"
        )]
        let number = window as u32;
        Some(self.windows[slot_of(window)].code(number, network))
    }
}

/// The electrodes of a plane, in the montage's order, filled up with zeros.
#[inline]
fn gather(plane: &Plane) -> [Pair; ELECTRODE_PAIRS] {
    // All cells are on the grid; the compiler need not be told where.
    let number = |cell: u8| plane.get(usize::from(cell)).copied().unwrap_or(0).into();
    let mut electrodes = [Pair::ZERO; ELECTRODE_PAIRS];
    let (both, last) = GRID_CELL.as_chunks::<2>();
    let (pairs, rest) = electrodes.split_at_mut(both.len());
    for (pair, cells) in pairs.iter_mut().zip(both) {
        *pair = Pair::new(cells.map(number));
    }
    if let (Some(pair), Some(&cell)) = (rest.first_mut(), last.first()) {
        *pair = Pair::new([number(cell), 0]);
    }
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
    fn an_encoder_that_restarts_is_as_good_as_new() {
        let step = |index: usize| Step {
            plane: core::array::from_fn(|cell| {
                let [value, ..] = (index * 31 + cell * 7).to_le_bytes();
                value.cast_signed()
            }),
            ..Step::default()
        };
        let codes = |encoder: &mut Encoder<'_>| -> Vec<Code> {
            (0..48)
                .filter_map(|index| encoder.push(&step(index)))
                .collect()
        };
        let expected = codes(&mut Encoder::new());
        let mut encoder = Encoder::new();
        for steps in [1, 5, 37] {
            for index in 100..100 + steps {
                encoder.push(&step(index));
            }
            encoder.restart();
            assert_eq!(codes(&mut encoder), expected);
            encoder.restart();
        }
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
