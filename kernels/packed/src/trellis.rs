//! Chooses the magnitudes of a block: the cheapest path through the states of the quantiser.

use crate::context::{Activity, Context};
use crate::quantiser::Magnitude;
use crate::rate::Rate;
use crate::tables::{BIT_COST, ESCAPE, MAGNITUDES, Tables};

/// Number of states of the quantiser.
const STATES: usize = 4;

/// Cost of a state that no path has reached; it is above the cost of every path.
const UNREACHED: i32 = 1 << 29;

/// Largest number of coefficients in a block. It keeps the cost of a path below 2^29.
pub const MAX_COEFFICIENTS: usize = 256;

/// Which path survived in each of the four states after a coefficient. Two bits per state: bit 0 is
/// set if the path came from the second of the two states that lead there, bit 1 if it chose
/// magnitude 0 over a larger even magnitude.
pub type Survivors = u8;

/// Chooses the magnitudes of a block by the Viterbi algorithm. They minimise the sum of squared
/// errors plus the cost of their codes, 0.3 squared steps for each bit.
///
/// For each coefficient, the candidates of a quantiser are its points on both sides of the value,
/// and 0 if the lower point has magnitude 1. The Elias gamma code of magnitudes from 15 on is left
/// out, because it is nearly the same for all candidates. `residual` is coefficient minus
/// prediction, below 2^17 in magnitude; `survivors` is scratch memory. All slices must have the
/// same length, at most [`MAX_COEFFICIENTS`].
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
        let value = if is_zeroed { 0 } else { value.cast_unsigned() as u16 };
        *magnitude = Magnitude { value, is_negative: residual < 0 };
    }
}

/// Returns the magnitude of the largest point of a quantiser that does not exceed `value`, in 1/256
/// of a step.
#[inline(always)]
fn lower_magnitude(value: i32, quantiser: i32) -> i32 {
    ((value >> 8) + quantiser) >> 1
}

/// The magnitudes of one quantiser that are tried for a coefficient: an even magnitude, an odd
/// magnitude, and 0 if it can replace the even magnitude.
#[derive(Clone, Copy, Debug)]
struct Candidates {
    even: Candidate,
    odd: Candidate,
    /// Squared error of magnitude 0 if magnitude 0 can replace `even`, otherwise a value above the
    /// cost of every path.
    zero_error: i32,
}

/// A magnitude with the part of its cost that is the same on every path.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    /// The magnitude, limited to 15, as an index of the tables.
    symbol: u32,
    /// Squared error of the point, in 1/65536 of a squared step.
    error: i32,
}

impl Candidates {
    /// Returns the candidates for a coefficient, whose magnitude `value` is in 1/256 of a step.
    #[inline(always)]
    fn new(value: i32, quantiser: i32) -> Self {
        let lower = lower_magnitude(value, quantiser);
        let candidate = |magnitude: i32| {
            // Wrong for magnitude 0 of quantiser 1; `zero_error` holds the right error.
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

    /// Returns the two continuations of a path that has this cost and activity. `bits` are the
    /// lengths of the codes of this coefficient's magnitudes in 1/16 bit.
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

/// For each state, the cheapest path that leads to it.
#[derive(Clone, Copy, Debug)]
struct Paths {
    /// Cost of each path, in 1/65536 of a squared step, below 2^30.
    costs: [i32; STATES],
    /// Activity at the end of each path.
    activities: [Activity; STATES],
}

/// The two continuations of a path: with the cheaper even magnitude, and with the odd magnitude.
#[derive(Clone, Copy, Debug)]
struct Ways {
    even: Way,
    odd: Way,
}

/// Continuation of a path by one coefficient.
#[derive(Clone, Copy, Debug)]
struct Way {
    cost: i32,
    /// The magnitude, limited to 15.
    symbol: u32,
    /// Bits of [`Survivors`]: 2 if magnitude 0 replaced the larger even magnitude, 1 if the path
    /// comes from the second of two states.
    survivor: u8,
    /// Activity of the path before this coefficient.
    activity: Activity,
}

impl Way {
    /// Returns the cheaper continuation; the first one if both cost the same.
    #[inline(always)]
    fn better(first: Self, second: Self) -> Self {
        if second.cost < first.cost {
            Self { survivor: second.survivor | 1, ..second }
        } else {
            first
        }
    }
}

impl Paths {
    /// The paths before the first coefficient: only state 0 is reached.
    const START: Self =
        Self { costs: [0, UNREACHED, UNREACHED, UNREACHED], activities: [Activity::START; STATES] };

    /// Extends the paths by a coefficient, whose magnitude `value` is in 1/256 of a step, and
    /// returns which path survived in each state.
    #[inline(always)]
    fn extend(&mut self, value: i32, context: Context, tables: &Tables<'_>) -> Survivors {
        // Quantiser 0 leads from states 0 and 1 to states 0 and 2, quantiser 1 from states 2 and 3
        // to states 1 and 3.
        let [zero, two] = self.extend_quantiser::<0>(value, context, tables);
        let [one, three] = self.extend_quantiser::<1>(value, context, tables);
        let ways = [zero, one, two, three];
        self.costs = ways.map(|way| way.cost);
        self.activities = ways.map(|way| way.activity.after(way.symbol));
        let [zero, one, two, three] = ways.map(|way| way.survivor);
        zero | one << 2 | two << 4 | three << 6
    }

    /// Returns the cheapest continuations from the two states of a quantiser: first the one with an
    /// even sum of magnitude and state, then the one with an odd sum.
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
        [Way::better(first.even, second.odd), Way::better(first.odd, second.even)]
    }

    /// Returns the state at the end of the cheapest path; the lowest of several with equal cost.
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
