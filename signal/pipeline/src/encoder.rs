//! The streaming encoder: reads one step at a time and returns a code for each complete window.

mod convolutions;
mod edges;
mod window;

use convolutions::Convolutions;
use int8_nn::Pair;
use model::{
    ELECTRODE_PAIRS, GRID_CELL, HAS_CONVOLUTIONS, HAS_SHORTCUT, NETWORK, Network, OPEN_WINDOWS,
    STEPS,
};
use window::{OpenWindow, containing_windows, slot_of};

use crate::code::Code;
use crate::sample::{Plane, Step};

/// The half of the pipeline that runs at the step rate.
///
/// Each plane of the convolutions is computed once, as soon as its inputs exist, and is used for
/// all windows that contain it. Bit for bit, the codes equal those of a batch encoder that computes
/// each window alone, because the hop is a multiple of the pool's steps.
///
/// The fully connected layer multiplies a pooled plane once for each window that contains the
/// plane: at once for the oldest window, with the next step for the others. With at most two
/// windows and without padded steps, all steps therefore take about the same work. With padded
/// steps, each window also has planes of its own at its ends.
#[derive(Clone, Debug)]
pub struct Encoder<'w> {
    network: &'w Network<'w>,
    memory: EncoderMemory,
}

impl Encoder<'static> {
    /// Creates an encoder with the built-in network.
    pub const fn new() -> Self {
        Self::with_network(&NETWORK)
    }
}

impl Default for Encoder<'static> {
    fn default() -> Self {
        Self::new()
    }
}

impl<'w> Encoder<'w> {
    /// Creates an encoder with `network`, which must have the shape of the built-in network; see
    /// [`Network::is_consistent`].
    pub const fn with_network(network: &'w Network<'w>) -> Self {
        Self { network, memory: EncoderMemory::EMPTY }
    }

    /// Resets the encoder in place: the next step is the first of a stream.
    pub fn restart(&mut self) {
        self.memory.restart();
    }

    /// Encodes the next step; returns a code if the step completes a window.
    pub fn encode_step(&mut self, step: &Step) -> Option<Code> {
        self.memory.encode_step_with(step, self.network)
    }
}

/// State and scratch memory of an [`Encoder`], about 16 KB: place it in a static, not on a stack.
/// All of it is initially zero, so that it takes no flash. [`Self::encode_step`] uses the built-in
/// network.
#[derive(Clone, Debug)]
pub struct EncoderMemory {
    /// The convolutional layers, if the network has them.
    convolutions: [Convolutions; HAS_CONVOLUTIONS as usize],
    windows: [OpenWindow; OPEN_WINDOWS],
    /// Number of steps encoded so far; at 128 Hz it wraps after four billion years.
    steps: u64,
}

impl EncoderMemory {
    /// Memory of an encoder before its first step, all zeros.
    pub const EMPTY: Self = Self {
        convolutions: [Convolutions::EMPTY; HAS_CONVOLUTIONS as usize],
        windows: [OpenWindow::EMPTY; OPEN_WINDOWS],
        steps: 0,
    };

    /// Resets the memory in place: the next step is the first of a stream.
    pub fn restart(&mut self) {
        // The rings need no clearing: old planes are overwritten before they are read.
        for convolutions in &mut self.convolutions {
            convolutions.restart();
        }
        self.windows = [OpenWindow::EMPTY; OPEN_WINDOWS];
        self.steps = 0;
    }

    /// Encodes the next step with the built-in network; returns a code if it completes a window.
    pub fn encode_step(&mut self, step: &Step) -> Option<Code> {
        self.encode_step_with(step, &NETWORK)
    }

    /// Encodes the next step with `network`, which must have the shape of the built-in network;
    /// returns a code if the step completes a window. All steps of a stream need the same network.
    pub fn encode_step_with(&mut self, step: &Step, network: &Network<'_>) -> Option<Code> {
        let index = self.steps;
        self.steps += 1;
        self.add_to_windows(index, step, network);
        for convolutions in &mut self.convolutions {
            convolutions.add_plane(index, &step.plane, network, &mut self.windows);
        }
        self.completed_code(index, network)
    }

    /// Adds a step to the windows that contain it: its status (clipped values, channels at the
    /// rail), and its product with the weights of the linear shortcut.
    fn add_to_windows(&mut self, index: u64, step: &Step, network: &Network<'_>) {
        let electrodes = gather(&step.plane);
        for (slot, offset) in containing_windows(index, network.hop, STEPS) {
            let window = &mut self.windows[slot];
            if offset == 0 {
                *window = OpenWindow::start_with(step, network);
            }
            window.add_events(step);
            if HAS_SHORTCUT {
                window.add_electrodes(network.shortcut[offset], &electrodes);
            }
        }
    }

    /// Returns the code of the window that ends with step `index`, if there is one.
    fn completed_code(&self, index: u64, network: &Network<'_>) -> Option<Code> {
        let first = (index + 1).checked_sub(STEPS as u64)?;
        let hop = network.hop as u64;
        if first & (hop - 1) != 0 {
            return None;
        }
        let window = first >> hop.trailing_zeros();
        #[expect(clippy::cast_possible_truncation, reason = "the window index wraps at 2^32")]
        let number = window as u32;
        Some(self.windows[slot_of(window)].code(number, network))
    }
}

/// Returns the electrodes of a plane in pairs, in the order of the montage, padded with zeros.
#[inline]
fn gather(plane: &Plane) -> [Pair; ELECTRODE_PAIRS] {
    // Every index is on the grid; `get` avoids a panic path that the compiler cannot exclude.
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

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;

    #[test]
    fn a_code_carries_the_events_and_the_first_sample_of_its_window() {
        let mut encoder = Encoder::new();
        let hop = NETWORK.hop as u64;
        let codes: Vec<Code> = (0..64)
            .filter_map(|index| {
                encoder.encode_step(&Step {
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
