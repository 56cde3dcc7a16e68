//! The convolutional layers of the encoder, computed plane by plane.

use int8_nn::{Pair, PlaneRing, requantise, saturate_u8};
use model::{
    CELL_PLANE, COLUMNS, Conv2, EDGE_STEPS, HIDDEN, HIDDEN_INTERIOR, HIDDEN_PAIRS, INNER_STEPS,
    MARGIN, NETWORK, Network, OPEN_WINDOWS, PADS_TIME, POOL, POOLED, POOLED_PAIRS, STEPS,
};

use super::edges::{Edges, INPUT, RecentPlanes, TRANSFORMED};
use super::window::{OpenWindow, containing_windows};
use crate::sample::Plane;

/// Slot of a window among the open windows, and index of a pooled plane in the window.
type Place = (usize, usize);

/// Largest number of windows that contain the same pooled plane, not counting the newest and the
/// oldest of these windows.
const BETWEEN: usize = OPEN_WINDOWS.saturating_sub(2);

/// State of the convolutional layers: the most recent planes of each layer.
#[derive(Clone, Debug)]
pub(super) struct Convolutions {
    /// The last three input planes, every cell paired with its right neighbour.
    input: PlaneRing<Pair, INPUT, 3>,
    hidden: HiddenPlane,
    /// The last three output planes of the first convolution, Winograd-transformed for the second.
    transformed: PlaneRing<Pair, TRANSFORMED, 3>,
    pool: Pool,
    /// For the newest window: the window's slot, and the index that the pooled plane has in the
    /// window. The next step adds the plane there; `None` if no addition is deferred.
    newest: Option<Place>,
    /// For each window between the newest and the oldest: the window's slot, and the index that the
    /// pooled plane has in the window. The next step adds the plane there; `None` if no addition is
    /// deferred.
    between: [Option<Place>; BETWEEN],
    /// State for the planes at the ends of windows, if the network pads steps.
    edges: [Edges; PADS_TIME as usize],
}

impl Convolutions {
    pub(super) const EMPTY: Self = Self {
        input: PlaneRing::filled(Pair::ZERO),
        hidden: HiddenPlane::EMPTY,
        transformed: PlaneRing::filled(Pair::ZERO),
        pool: Pool::EMPTY,
        newest: None,
        between: [None; BETWEEN],
        edges: [Edges::EMPTY; PADS_TIME as usize],
    };

    /// Discards the deferred additions. All other state is overwritten before it is read.
    pub(super) fn restart(&mut self) {
        self.newest = None;
        self.between = [None; BETWEEN];
    }

    /// Processes the input plane of step `index`. If the step completes a pooled plane, adds that
    /// plane's product to the accumulators of the oldest window that contains the plane; the next
    /// step adds it to the other windows.
    #[inline]
    pub(super) fn add_plane(
        &mut self,
        index: u64,
        plane: &Plane,
        network: &Network<'_>,
        windows: &mut [OpenWindow; OPEN_WINDOWS],
    ) {
        self.store_input(plane, network);
        if let Some(place) = self.newest.take() {
            self.add_pooled(place, network, windows);
        }
        let between = core::mem::replace(&mut self.between, [None; BETWEEN]);
        for place in between.into_iter().flatten() {
            self.add_pooled(place, network, windows);
        }
        if index >= 2 {
            let transformed = self.transformed.advance();
            self.hidden.compute(network, self.input.oldest_first(), transformed);
        }
        if index == 0 {
            self.pool.start();
        }
        if index >= 4 {
            self.convolve(index - 4, network, windows);
        }
        for edges in &mut self.edges {
            let recent = RecentPlanes { input: &self.input, transformed: &self.transformed };
            for (slot, offset) in containing_windows(index, network.hop, STEPS) {
                let window = &mut windows[slot];
                edges.apply(offset, network, &recent, &mut self.hidden, window);
            }
        }
    }

    /// Stores an input plane, surrounded by its margin.
    #[inline]
    fn store_input(&mut self, plane: &Plane, network: &Network<'_>) {
        let conv1 = network.conv1();
        if MARGIN == 0 {
            conv1.pair_up(plane, self.input.advance());
            return;
        }
        let mut framed = [0; CELL_PLANE.len()];
        let rows = framed.chunks_exact_mut(CELL_PLANE.columns).skip(MARGIN);
        for (row, cells) in rows.zip(plane.chunks_exact(COLUMNS)) {
            row[MARGIN..][..COLUMNS].copy_from_slice(cells);
        }
        conv1.pair_up(&framed, self.input.advance());
    }

    /// Computes plane `plane` of the second convolution, from steps `plane` to `plane + 4`. The
    /// last plane of a pool completes a pooled plane, whose product with the fully connected layer
    /// is added to each window that contains the pooled plane.
    #[inline]
    fn convolve(
        &mut self,
        plane: u64,
        network: &Network<'_>,
        windows: &mut [OpenWindow; OPEN_WINDOWS],
    ) {
        const STEPS_OF_POOL: u64 = POOL[0] as u64;
        self.pool.convolve(network, self.transformed.oldest_first());
        if !(plane + 1).is_multiple_of(STEPS_OF_POOL) {
            return;
        }
        self.pool.requantise(network);
        let hop = network.hop / POOL[0];
        let mut places = containing_windows(plane / STEPS_OF_POOL, hop, INNER_STEPS)
            .map(|(slot, offset)| (slot, EDGE_STEPS + offset));
        // Only the oldest window can end with this step; the additions to the others are deferred.
        let (newest, older) = (places.next(), places.next());
        let mut oldest = if older.is_some() {
            self.newest = newest;
            older
        } else {
            newest
        };
        for between in &mut self.between {
            if let Some(older) = places.next() {
                *between = oldest.replace(older);
            }
        }
        if let Some(place) = oldest {
            self.add_pooled(place, network, windows);
        }
    }

    /// Adds the pooled plane's product to the accumulators of the window in the given slot. Slot
    /// and offset are always in range; `get` avoids panic paths.
    #[inline]
    fn add_pooled(
        &self,
        (slot, offset): Place,
        network: &Network<'_>,
        windows: &mut [OpenWindow; OPEN_WINDOWS],
    ) {
        if let (Some(window), Some(&fc)) = (windows.get_mut(slot), network.fc.get(offset)) {
            window.add_pooled(fc, self.pool.pooled());
        }
    }
}

/// Length, in pairs, of the scratch memory for the first convolution's gathered inputs.
const PATCHES: usize = NETWORK.conv1().patches_len();
/// Length, in words, of the scratch memory for the first convolution's sums.
const SUMS: usize = NETWORK.conv1().sums_len();
/// Number of pairs in a hidden plane without its margin.
const INTERIOR: usize = HIDDEN_INTERIOR.len() / 2;
/// Number of pairs in a hidden plane with its margin; 0 if the convolutions are not padded.
const FRAMED: usize = if MARGIN == 0 { 0 } else { HIDDEN.len() / 2 };

/// Scratch memory for a hidden plane, the output of the first and the input of the second
/// convolution.
#[derive(Clone, Debug)]
pub(super) struct HiddenPlane {
    patches: [Pair; PATCHES],
    sums: [i32; SUMS],
    interior: [Pair; INTERIOR],
    framed: [Pair; FRAMED],
}

impl HiddenPlane {
    pub(super) const EMPTY: Self = Self {
        patches: [Pair::ZERO; PATCHES],
        sums: [0; SUMS],
        interior: [Pair::ZERO; INTERIOR],
        framed: [Pair::ZERO; FRAMED],
    };

    /// Convolves three input planes, oldest first, and transforms the result for the second
    /// convolution.
    #[inline]
    pub(super) fn compute(
        &mut self,
        network: &Network<'_>,
        input: [&[Pair]; 3],
        transformed: &mut [Pair],
    ) {
        network.conv1().convolve(input, &mut self.patches, &mut self.sums, &mut self.interior);
        let plane = if MARGIN == 0 {
            &self.interior[..]
        } else {
            self.frame(network);
            &self.framed[..]
        };
        network.conv2().transform(plane, transformed);
    }

    /// Transforms a plane of padding for the second convolution.
    pub(super) fn compute_padding(&mut self, network: &Network<'_>, transformed: &mut [Pair]) {
        let planes = self.framed.chunks_exact_mut(HIDDEN.rows * HIDDEN.columns);
        for (plane, &padding) in planes.zip(&network.hidden_padding) {
            plane.fill(padding);
        }
        network.conv2().transform(&self.framed, transformed);
    }

    /// Copies the hidden plane into a plane with a margin, adds the offset of each channel to the
    /// copy, and fills the margin with padding.
    fn frame(&mut self, network: &Network<'_>) {
        let channels = network.hidden_padding.iter().zip(&network.hidden_offset);
        let planes = self.framed.chunks_exact_mut(HIDDEN.rows * HIDDEN.columns);
        let interiors = self.interior.chunks_exact(INTERIOR / HIDDEN_PAIRS);
        for ((framed, interior), (&padding, &offset)) in planes.zip(interiors).zip(channels) {
            framed.fill(padding);
            let rows = framed.chunks_exact_mut(HIDDEN.columns).skip(MARGIN);
            for (row, numbers) in rows.zip(interior.chunks_exact(HIDDEN_INTERIOR.columns)) {
                for (place, &number) in row[MARGIN..].iter_mut().zip(numbers) {
                    *place = number + offset;
                }
            }
        }
    }
}

/// Max-pool: the largest sums so far, and the last complete pooled plane.
#[derive(Clone, Debug)]
pub(super) struct Pool {
    largest: [i32; POOLED.len()],
    pooled: [Pair; POOLED_PAIRS],
}

impl Pool {
    /// All zeros, so that a static takes no flash; call [`Self::start`] before the first plane.
    pub(super) const EMPTY: Self =
        Self { largest: [0; POOLED.len()], pooled: [Pair::ZERO; POOLED_PAIRS] };

    /// Resets the largest sums to `i32::MIN`, before the first plane of a pool.
    pub(super) fn start(&mut self) {
        self.largest.fill(i32::MIN);
    }

    /// Convolves three transformed planes, oldest first, and updates the largest sums of the pool.
    #[inline]
    pub(super) fn convolve(&mut self, network: &Network<'_>, transformed: [&[Pair]; 3]) {
        network.conv2().convolve_max_pool(transformed, &mut self.largest);
    }

    /// Adds the bias to the largest sums, requantises the result to 0..=255, and resets the sums.
    #[inline]
    pub(super) fn requantise(&mut self, network: &Network<'_>) {
        let bias = network.conv2.bias.as_chunks::<2>().0;
        let multipliers = network.conv2.multipliers.as_chunks::<2>().0;
        let places = self.largest.chunks_exact_mut(POOLED.channels);
        for (sums, pooled) in places.zip(self.pooled.chunks_exact_mut(POOLED.channels / 2)) {
            let channels = bias.iter().zip(multipliers);
            let sums = sums.as_chunks_mut::<2>().0.iter_mut().zip(channels);
            for (pair, (sums, (bias, multipliers))) in pooled.iter_mut().zip(sums) {
                let activation = |index: usize| {
                    let sum = Conv2::unscaled(sums[index]).wrapping_add(bias[index]);
                    i16::from(saturate_u8(requantise(sum, multipliers[index])))
                };
                *pair = Pair::new([activation(0), activation(1)]);
                *sums = [i32::MIN; 2];
            }
        }
    }

    /// Returns the last complete pooled plane, values 0..=255, `[position][channel]`.
    #[inline]
    pub(super) const fn pooled(&self) -> &[Pair; POOLED_PAIRS] {
        &self.pooled
    }
}
