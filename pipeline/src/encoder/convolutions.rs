//! The convolutional half of the encoder, plane by plane.

use int8_nn::{Pair, PlaneRing};
use model::{
    CELL_PLANE, COLUMNS, EDGE_STEPS, INNER_STEPS, MARGIN, Network, PADS_TIME, POOL, STEPS,
};

use super::{
    edges::{Edges, INPUT, Stream, TRANSFORMED},
    hidden_plane::HiddenPlane,
    places,
    pool::Pool,
};
use crate::{
    Plane,
    window::{OPEN, OpenWindow},
};

/// The last planes of each layer.
#[derive(Clone, Debug)]
pub(super) struct Convolutions {
    /// The last input planes, every cell with its right neighbour.
    input: PlaneRing<Pair, INPUT, 3>,
    hidden: HiddenPlane,
    /// The last planes behind the first convolution, transformed.
    transformed: PlaneRing<Pair, TRANSFORMED, 3>,
    pool: Pool,
    /// Window and place in it to which the pooled plane has yet to be added.
    deferred: Option<(usize, usize)>,
    /// One, if time is padded.
    edges: [Edges; PADS_TIME as usize],
}

impl Convolutions {
    /// No plane.
    pub(super) const EMPTY: Self = Self {
        input: PlaneRing::filled(Pair::ZERO),
        hidden: HiddenPlane::EMPTY,
        transformed: PlaneRing::filled(Pair::ZERO),
        pool: Pool::EMPTY,
        deferred: None,
        edges: [Edges::EMPTY; PADS_TIME as usize],
    };

    /// Forgets what has yet to be added.
    pub(super) fn restart(&mut self) {
        self.deferred = None;
    }

    /// Takes the plane of step `index`, and adds what it completes to the windows.
    #[inline]
    pub(super) fn push(
        &mut self,
        index: u64,
        plane: &Plane,
        network: &Network<'_>,
        windows: &mut [OpenWindow; OPEN],
    ) {
        self.take(plane, network);
        if let Some(place) = self.deferred.take() {
            self.add_pooled(place, network, windows);
        }
        if index >= 2 {
            let transformed = self.transformed.advance();
            self.hidden
                .of(network, self.input.oldest_first(), transformed);
        }
        if index == 0 {
            self.pool.begin();
        }
        if index >= 4 {
            self.convolve(index - 4, network, windows);
        }
        for edges in &mut self.edges {
            let stream = Stream {
                input: &self.input,
                transformed: &self.transformed,
            };
            for (slot, offset) in places(index, network.hop, STEPS) {
                let window = &mut windows[slot];
                edges.step(offset, network, &stream, &mut self.hidden, window);
            }
        }
    }

    #[inline]
    fn take(&mut self, plane: &Plane, network: &Network<'_>) {
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

    /// The second convolution's `plane`-th plane of those that padding does not reach; the last one
    /// of a pool completes a pooled plane.
    #[inline]
    fn convolve(&mut self, plane: u64, network: &Network<'_>, windows: &mut [OpenWindow; OPEN]) {
        const STEPS_OF_POOL: u64 = POOL[0] as u64;
        self.pool.take(network, self.transformed.oldest_first());
        if !(plane + 1).is_multiple_of(STEPS_OF_POOL) {
            return;
        }
        self.pool.finish(network);
        let hop = network.hop / POOL[0];
        let mut places = places(plane / STEPS_OF_POOL, hop, INNER_STEPS)
            .map(|(slot, offset)| (slot, EDGE_STEPS + offset));
        // Of two windows only the older can end with this step.
        let (newer, older) = (places.next(), places.next());
        let now = if older.is_some() {
            self.deferred = newer;
            older
        } else {
            newer
        };
        if let Some(place) = now {
            self.add_pooled(place, network, windows);
        }
    }

    /// Adds the pooled plane to a window; every place exists.
    #[inline]
    fn add_pooled(
        &self,
        (slot, offset): (usize, usize),
        network: &Network<'_>,
        windows: &mut [OpenWindow; OPEN],
    ) {
        if let (Some(window), Some(&fc)) = (windows.get_mut(slot), network.fc.get(offset)) {
            window.add_pooled(fc, self.pool.pooled());
        }
    }
}
