//! The sequence of contexts that the magnitudes of a block run through.

use crate::context::{Activity, Context};
use crate::quantiser::{Magnitude, State};

/// Which table a magnitude is coded with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Symbol {
    /// Quantiser, 0 or 1.
    pub quantiser: usize,
    /// Level of the expected magnitude, 0..64.
    pub level: usize,
    /// The magnitude.
    pub magnitude: Magnitude,
}

/// Iterates over a block's magnitudes with the tables that each is coded with, for the training of the tables.
pub fn symbols<'b>(
    magnitudes: &'b [Magnitude],
    contexts: &'b [Context],
) -> impl Iterator<Item = Symbol> + 'b {
    let mut place = Place::START;
    magnitudes
        .iter()
        .zip(contexts)
        .map(move |(&magnitude, context)| {
            let symbol = Symbol {
                quantiser: place.quantiser(),
                level: place.level(*context),
                magnitude,
            };
            place.advance(magnitude);
            symbol
        })
}

/// What the coder of a block knows from the magnitudes so far.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    state: State,
    activity: Activity,
}

impl Place {
    /// Before the first coefficient.
    pub(crate) const START: Self = Self {
        state: State::START,
        activity: Activity::START,
    };

    /// Returns the quantiser of the next coefficient, 0 or 1.
    #[inline(always)]
    pub(crate) fn quantiser(self) -> usize {
        self.state.quantiser() % 2
    }

    /// Returns the level of the next coefficient's table.
    #[inline(always)]
    pub(crate) fn level(self, context: Context) -> usize {
        context.table_level(self.activity)
    }

    /// Passes a coefficient.
    #[inline(always)]
    pub(crate) fn advance(&mut self, magnitude: Magnitude) {
        self.activity = self.activity.after(magnitude.value.into());
        self.state = self.state.after(magnitude.value);
    }
}
