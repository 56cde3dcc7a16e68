//! The ends of windows with padded steps.
//!
//! The first two and the last two planes of the second convolution in a window depend on the
//! padding before or after the window, so each belongs to one window only. All other planes are
//! shared by the windows that contain them. The ends are computed at steps 1 to 3 and at the last
//! step of a window, so two windows never compute an end in the same step.

use int8_nn::{Pair, PlaneRing};
use model::{CELL_PLANE, EDGE_STEPS, NETWORK, Network, POOL, POOLED_STEPS, STEPS};

use super::convolutions::{HiddenPlane, Pool};
use super::window::OpenWindow;

/// Number of pairs in an input plane.
pub(super) const INPUT: usize = CELL_PLANE.len();
/// Number of pairs in a hidden plane that is transformed for the second convolution.
pub(super) const TRANSFORMED: usize = NETWORK.conv2().transformed_len();

/// An input plane of padding, before or after the window.
static ZERO_PLANE: [Pair; INPUT] = [Pair::ZERO; INPUT];

/// Index of the last pooled plane that depends on padding before the window.
const START_LAST: usize = EDGE_STEPS.saturating_sub(1);
/// Index of the first pooled plane that depends on padding after the window.
const END_FIRST: usize = POOLED_STEPS.saturating_sub(EDGE_STEPS);
/// Index of the last pooled plane of a window.
const END_LAST: usize = POOLED_STEPS.saturating_sub(1);

/// Planes and pool for the start and the end of a window, where the convolutions use padding in
/// addition to the planes of the stream.
#[derive(Clone, Debug)]
pub(super) struct Edges {
    /// The first or the last hidden plane of the window, transformed; it depends on padding.
    outermost: [Pair; TRANSFORMED],
    /// A hidden plane of padding, transformed.
    padding: [Pair; TRANSFORMED],
    pool: Pool,
}

/// The last three input planes, and the last three transformed output planes of the first
/// convolution.
pub(super) struct RecentPlanes<'s> {
    pub(super) input: &'s PlaneRing<Pair, INPUT, 3>,
    pub(super) transformed: &'s PlaneRing<Pair, TRANSFORMED, 3>,
}

impl Edges {
    pub(super) const EMPTY: Self = Self {
        outermost: [Pair::ZERO; TRANSFORMED],
        padding: [Pair::ZERO; TRANSFORMED],
        pool: Pool::EMPTY,
    };

    /// Computes the part of a window's ends that is due at step `offset` of the window. Call this
    /// after the stream's planes of the same step have been computed.
    pub(super) fn apply(
        &mut self,
        offset: usize,
        network: &Network<'_>,
        recent: &RecentPlanes<'_>,
        hidden: &mut HiddenPlane,
        window: &mut OpenWindow,
    ) {
        const LAST: usize = STEPS - 1;
        let [_, older, newer] = recent.input.oldest_first();
        let [_, before, newest] = recent.transformed.oldest_first();
        match offset {
            1 => {
                self.pool.start();
                hidden.compute_padding(network, &mut self.padding);
                hidden.compute(network, [&ZERO_PLANE, older, newer], &mut self.outermost);
            }
            2 => {
                let planes = [&self.padding[..], &self.outermost, newest];
                self.pool.convolve(network, planes);
                if POOL[0] == 1 {
                    self.add(network, window, 0);
                }
            }
            3 => {
                self.pool.convolve(network, [&self.outermost, before, newest]);
                self.add(network, window, START_LAST);
            }
            LAST => {
                hidden.compute(network, [older, newer, &ZERO_PLANE], &mut self.outermost);
                self.pool.convolve(network, [before, newest, &self.outermost]);
                if POOL[0] == 1 {
                    self.add(network, window, END_FIRST);
                }
                let planes = [newest, &self.outermost[..], &self.padding];
                self.pool.convolve(network, planes);
                self.add(network, window, END_LAST);
            }
            _ => {}
        }
    }

    /// Requantises the pool's sums to pooled plane `index` of the window, and adds the plane's
    /// product to the window's accumulators.
    fn add(&mut self, network: &Network<'_>, window: &mut OpenWindow, index: usize) {
        self.pool.requantise(network);
        if let Some(&fc) = network.fc.get(index) {
            window.add_pooled(fc, self.pool.pooled());
        }
    }
}
