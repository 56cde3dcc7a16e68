//! The choice of the magnitudes: the cheapest path through the quantiser's states.

use crate::context::{Activity, Context};
use crate::quantiser::Magnitude;
use crate::rate::Rate;
use crate::tables::{BIT_COST, ESCAPE, MAGNITUDES, Tables};

/// Number of states.
const STATES: usize = 4;

/// Cost of a state that no path has reached, above every cost of a path.
const UNREACHED: i32 = 1 << 29;

/// Largest number of coefficients of a block: the costs of a path sum to less than [`UNREACHED`].
pub const MAX_COEFFICIENTS: usize = 256;

/// Which path survived in each state after a coefficient, two bits for each state: bit 0 is set if
/// it came from the second of the two states before it, bit 1 if it chose magnitude 0 over a larger
/// even one.
pub type Survivors = u8;

/// Chooses the magnitudes of a block by the Viterbi algorithm: those with the least sum, over the
/// coefficients, of squared error and 0.3 squared steps for each bit.
///
/// For each coefficient, the candidates of a quantiser are its points on both sides of the value,
/// and 0 where the lower one has magnitude 1. The Elias gamma code of magnitudes from 15 on is
/// nearly the same for all candidates, and is left out. `residual` is coefficient minus prediction,
/// |x| < 2^17; `survivors` is scratch memory. All slices have the same length, at most
/// [`MAX_COEFFICIENTS`]; the shortest counts.
///
/// # Timing
/// Every coefficient takes the same work, whatever its value.
pub fn quantise(
    residual: &[i32],
    contexts: &[Context],
    tables: &Tables<'_>,
    rate: Rate,
    survivors: &mut [Survivors],
    magnitudes: &mut [Magnitude],
) {
    debug_assert!(residual.len() <= MAX_COEFFICIENTS, "costs would overflow");
    let mut paths = Paths::START;
    let coefficients = residual.iter().zip(contexts).zip(&mut *survivors);
    for ((&residual, &context), survivors) in coefficients {
        let value = rate.in_steps(residual.unsigned_abs());
        *survivors = paths.extend(value, context, tables);
    }
    let mut state = paths.cheapest_state();
    let coefficients = residual.iter().zip(survivors).zip(magnitudes).rev();
    for ((&residual, &mut survivors), magnitude) in coefficients {
        let survivor = survivors >> (2 * state);
        let is_second = survivor & 1;
        let parity = is_second ^ (state >> 1);
        state = 2 * (state & 1) + is_second;
        let lower = lower_magnitude(rate.in_steps(residual.unsigned_abs()), (state >> 1).into());
        let is_zeroed = survivor & 2 != 0;
        let value = lower + (lower ^ i32::from(parity)) % 2;
        #[expect(clippy::cast_possible_truncation, reason = "below 2^17 / 16 + 1")]
        let value = if is_zeroed {
            0
        } else {
            value.cast_unsigned() as u16
        };
        *magnitude = Magnitude {
            value,
            is_negative: residual < 0,
        };
    }
}

/// Returns the magnitude of a quantiser's largest point that is not above a value, in 1/256 of a
/// step.
#[inline(always)]
fn lower_magnitude(value: i32, quantiser: i32) -> i32 {
    ((value >> 8) + quantiser) >> 1
}

/// The candidates of one quantiser for a coefficient: an even magnitude, 0 in its place, and an odd
/// one.
#[derive(Clone, Copy, Debug)]
struct Candidates {
    even: Candidate,
    odd: Candidate,
    /// Squared error of magnitude 0 if it competes with `even`, otherwise above every cost.
    zero_error: i32,
}

/// A magnitude with the part of its cost that depends on neither state nor activity.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    /// At most 15: an index of the tables.
    symbol: u32,
    /// Squared error, 1/65536 of the squared step.
    error: i32,
}

impl Candidates {
    /// `value` is in 1/256 of a step.
    #[inline(always)]
    fn new(value: i32, quantiser: i32) -> Self {
        let lower = lower_magnitude(value, quantiser);
        let candidate = |magnitude: i32| {
            // Magnitude 0 has the wrong point here; it competes below with the right one.
            let error = value - ((2 * magnitude - quantiser) << 8);
            Candidate {
                symbol: magnitude.clamp(0, ESCAPE.into()).cast_unsigned(),
                error: error * error,
            }
        };
        let near = value.min(1 << 12);
        Self {
            even: candidate((lower + 1) & !1),
            odd: candidate(lower | 1),
            zero_error: if lower <= 1 { near * near } else { UNREACHED },
        }
    }

    /// Returns the continuations of a path with this cost and activity. `bits` are the costs of the
    /// magnitudes in the table of the next coefficient, 1/16 bit.
    #[inline(always)]
    fn ways(&self, cost: i32, activity: Activity, bits: &[u8; MAGNITUDES]) -> Ways {
        let cost_of = |error: i32, symbol: u32| {
            let bits = bits[symbol as usize % MAGNITUDES];
            cost + error + i32::from(bits) * BIT_COST
        };
        let even = cost_of(self.even.error, self.even.symbol);
        let zero = cost_of(self.zero_error, 0);
        let is_zero = zero < even;
        Ways {
            even: Way {
                cost: even.min(zero),
                symbol: if is_zero { 0 } else { self.even.symbol },
                survivor: if is_zero { 2 } else { 0 },
                activity,
            },
            odd: Way {
                cost: cost_of(self.odd.error, self.odd.symbol),
                symbol: self.odd.symbol,
                survivor: 0,
                activity,
            },
        }
    }
}

/// The cheapest path to each state.
#[derive(Clone, Copy, Debug)]
struct Paths {
    /// Cost of each path, 1/65536 of the squared step, below 2^30.
    costs: [i32; STATES],
    /// Activity along each path.
    activities: [Activity; STATES],
}

/// The two continuations of a path from a state: with the cheaper even magnitude, and with an odd
/// one.
#[derive(Clone, Copy, Debug)]
struct Ways {
    even: Way,
    odd: Way,
}

/// One continuation of a path by a coefficient.
#[derive(Clone, Copy, Debug)]
struct Way {
    cost: i32,
    /// At most 15.
    symbol: u32,
    /// Survivor bits: 2 if magnitude 0 won over a larger even one, 1 if the way came from the
    /// second state.
    survivor: u8,
    /// Activity before the coefficient.
    activity: Activity,
}

impl Way {
    /// Returns the cheaper way; the first one wins a tie.
    #[inline(always)]
    fn better(first: Self, second: Self) -> Self {
        if second.cost < first.cost {
            Self {
                survivor: second.survivor | 1,
                ..second
            }
        } else {
            first
        }
    }
}

impl Paths {
    /// The paths before the first coefficient: state 0 only.
    const START: Self = Self {
        costs: [0, UNREACHED, UNREACHED, UNREACHED],
        activities: [Activity::START; STATES],
    };

    /// Extends the paths by a coefficient, whose value is in 1/256 of a step, and returns the
    /// survivors.
    #[inline(always)]
    fn extend(&mut self, value: i32, context: Context, tables: &Tables<'_>) -> Survivors {
        // Quantiser 0 leads from the states 0 and 1 to 0 and 2, quantiser 1 from 2 and 3 to 1 and
        // 3.
        let [zero, two] = self.extend_quantiser::<0>(value, context, tables);
        let [one, three] = self.extend_quantiser::<1>(value, context, tables);
        let ways = [zero, one, two, three];
        self.costs = ways.map(|way| way.cost);
        self.activities = ways.map(|way| way.activity.after(way.symbol));
        let [zero, one, two, three] = ways.map(|way| way.survivor);
        zero | one << 2 | two << 4 | three << 6
    }

    /// Returns the best way with an even sum of magnitude and state, and that with an odd one, from
    /// the two states of a quantiser.
    #[inline(always)]
    fn extend_quantiser<const QUANTISER: usize>(
        &self,
        value: i32,
        context: Context,
        tables: &Tables<'_>,
    ) -> [Way; 2] {
        let candidates = Candidates::new(value, i32::from(QUANTISER == 1));
        let [first, second] = [0, 1].map(|state| {
            let state = 2 * QUANTISER + state;
            let (cost, activity) = (self.costs[state], self.activities[state]);
            let bits = &tables.costs[QUANTISER][context.table_level(activity)];
            candidates.ways(cost, activity, bits)
        });
        [
            Way::better(first.even, second.odd),
            Way::better(first.odd, second.even),
        ]
    }

    /// Returns the state of the cheapest path, the first of several.
    fn cheapest_state(&self) -> u8 {
        let mut cheapest = 0;
        let mut least = self.costs[0];
        for (state, &cost) in (1..).zip(&self.costs[1..]) {
            if cost < least {
                (cheapest, least) = (state, cost);
            }
        }
        cheapest
    }
}
