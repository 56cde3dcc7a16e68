//! The ends of a window whose steps are padded.
//!
//! Padding before and behind a window reaches two planes of the second convolution at either end: they
//! belong to this window alone, all others to every window that covers them. A window's ends never
//! meet another's: they lie at its steps 1 to 3 and at its last.

use int8_nn::{Pair, PlaneRing};
use model::{CELL_PLANE, EDGE_STEPS, NETWORK, Network, POOL, POOLED_STEPS, STEPS};

use super::{hidden_plane::HiddenPlane, pool::Pool};
use crate::window::OpenWindow;

/// Pairs in an input plane and in a transformed one.
pub(super) const INPUT: usize = CELL_PLANE.len();
pub(super) const TRANSFORMED: usize = NETWORK.conv2().transformed_len();

/// An input plane before or behind the window.
static BEYOND: [Pair; INPUT] = [Pair::ZERO; INPUT];

/// Places of the pooled planes that end the opening, begin and end the closing.
const OPENING_ENDS: usize = EDGE_STEPS.saturating_sub(1);
const CLOSING: usize = POOLED_STEPS.saturating_sub(EDGE_STEPS);
const CLOSING_ENDS: usize = POOLED_STEPS.saturating_sub(1);

/// What the ends of windows need beside the stream's own planes.
#[derive(Clone, Debug)]
pub(super) struct Edges {
    /// The outermost plane of the window, transformed.
    outermost: [Pair; TRANSFORMED],
    /// The one beyond it, transformed.
    beyond: [Pair; TRANSFORMED],
    pool: Pool,
}

/// The last planes of the stream: three of the input, and three behind the first convolution.
pub(super) struct Stream<'s> {
    pub(super) input: &'s PlaneRing<Pair, INPUT, 3>,
    pub(super) transformed: &'s PlaneRing<Pair, TRANSFORMED, 3>,
}

impl Edges {
    /// No window.
    pub(super) const EMPTY: Self = Self {
        outermost: [Pair::ZERO; TRANSFORMED],
        beyond: [Pair::ZERO; TRANSFORMED],
        pool: Pool::EMPTY,
    };

    /// Does what is due at a window's step `offset`, once the stream has its planes.
    pub(super) fn step(
        &mut self,
        offset: usize,
        network: &Network<'_>,
        stream: &Stream<'_>,
        hidden: &mut HiddenPlane,
        window: &mut OpenWindow,
    ) {
        const LAST: usize = STEPS - 1;
        let [_, older, newer] = stream.input.oldest_first();
        let [_, before, newest] = stream.transformed.oldest_first();
        match offset {
            1 => {
                self.pool.begin();
                hidden.padding(network, &mut self.beyond);
                hidden.of(network, [&BEYOND, older, newer], &mut self.outermost);
            }
            2 => {
                let planes = [&self.beyond[..], &self.outermost, newest];
                self.pool.take(network, planes);
                if POOL[0] == 1 {
                    self.add(network, window, 0);
                }
            }
            3 => {
                self.pool.take(network, [&self.outermost, before, newest]);
                self.add(network, window, OPENING_ENDS);
            }
            LAST => {
                hidden.of(network, [older, newer, &BEYOND], &mut self.outermost);
                self.pool.take(network, [before, newest, &self.outermost]);
                if POOL[0] == 1 {
                    self.add(network, window, CLOSING);
                }
                let planes = [newest, &self.outermost[..], &self.beyond];
                self.pool.take(network, planes);
                self.add(network, window, CLOSING_ENDS);
            }
            _ => {}
        }
    }

    fn add(&mut self, network: &Network<'_>, window: &mut OpenWindow, place: usize) {
        self.pool.finish(network);
        if let Some(&fc) = network.fc.get(place) {
            window.add_pooled(fc, self.pool.pooled());
        }
    }
}
