//! The convolutional layers of the encoder, computed plane by plane.

use int8_nn::{Pair, PlaneRing};
use model::{
    CELL_PLANE, COLUMNS, EDGE_STEPS, INNER_STEPS, MARGIN, Network, OPEN_WINDOWS, PADS_TIME, POOL,
    STEPS,
};

use super::{
    edges::{Edges, INPUT, RecentPlanes, TRANSFORMED},
    hidden_plane::HiddenPlane,
    pool::Pool,
    window::{OpenWindow, containing_windows},
};
use crate::plane::Plane;

/// A window's slot, and the index of a pooled plane in the window.
type Place = (usize, usize);

/// Largest number of windows that contain a pooled plane, less the newest and the oldest window.
const BETWEEN: usize = OPEN_WINDOWS.saturating_sub(2);

/// State of the convolutional layers: the most recent planes of each layer.
#[derive(Clone, Debug)]
pub(super) struct Convolutions {
    /// The last three input planes, every cell paired with its right neighbour.
    input: PlaneRing<Pair, INPUT, 3>,
    hidden: HiddenPlane,
    /// The last three output planes of the first convolution, transformed for the second.
    transformed: PlaneRing<Pair, TRANSFORMED, 3>,
    pool: Pool,
    /// Where the next step adds the pooled plane to the newest window, if the addition is deferred.
    newest: Option<Place>,
    /// Where the next step adds the pooled plane to the windows between the newest and the oldest.
    between: [Option<Place>; BETWEEN],
    /// The planes at the ends of windows, if the network pads steps.
    edges: [Edges; PADS_TIME as usize],
}

impl Convolutions {
    /// State before the first plane.
    pub(super) const EMPTY: Self = Self {
        input: PlaneRing::filled(Pair::ZERO),
        hidden: HiddenPlane::EMPTY,
        transformed: PlaneRing::filled(Pair::ZERO),
        pool: Pool::EMPTY,
        newest: None,
        between: [None; BETWEEN],
        edges: [Edges::EMPTY; PADS_TIME as usize],
    };

    /// Discards the deferred additions; all other state is overwritten before it is read.
    pub(super) fn restart(&mut self) {
        self.newest = None;
        self.between = [None; BETWEEN];
    }

    /// Processes the input plane of step `index`. If the step completes a pooled plane, adds that plane
    /// to the oldest window that contains it; the other windows get it in the next step.
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
            self.hidden
                .compute(network, self.input.oldest_first(), transformed);
        }
        if index == 0 {
            self.pool.start();
        }
        if index >= 4 {
            self.convolve(index - 4, network, windows);
        }
        for edges in &mut self.edges {
            let recent = RecentPlanes {
                input: &self.input,
                transformed: &self.transformed,
            };
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

    /// Computes plane `plane` of the second convolution, where plane 0 is that of steps 0 to 4. The
    /// last plane of a pool completes a pooled plane, which is added to the windows that contain it.
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

    /// Adds the pooled plane to a window. Slot and offset are always in range; `get` avoids panic paths.
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
