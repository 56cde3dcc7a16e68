//! Axis of a chart; its range and ticks are computed from the values.

use std::ops::RangeInclusive;

/// How values are spaced along an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scale {
    /// Equal differences between values have equal lengths on the axis.
    Linear,
    /// As [`Scale::Linear`], with ticks at whole numbers only.
    Whole,
    /// Equal ratios between values have equal lengths on the axis. Values of 0 or less are not
    /// drawn.
    Logarithmic,
}

/// One axis of a chart: the quantity it shows and how its values are spaced.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// Quantity and unit, such as "error (uV)".
    pub label: String,
    /// Linear, linear with whole ticks, or logarithmic spacing.
    pub scale: Scale,
    /// Values that get a tick, with the tick's text; if empty, ticks are at round values.
    pub ticks: Vec<(f64, String)>,
}

/// Largest number of intervals between the ticks that [`Axis::round_values`] chooses.
const MOST_TICKS: f64 = 10.0;

impl Axis {
    /// Creates an axis with ticks at round values.
    pub fn new(label: impl Into<String>, scale: Scale) -> Self {
        Self { label: label.into(), scale, ticks: Vec::new() }
    }

    /// Returns whether the axis can show a value: any finite value, but on a logarithmic axis only
    /// values above 0.
    pub(crate) fn has(&self, value: f64) -> bool {
        value.is_finite() && (self.scale != Scale::Logarithmic || value > 0.0)
    }

    /// Returns the coordinate of a value: the value itself, or its logarithm on a logarithmic axis.
    pub(crate) fn coordinate(&self, value: f64) -> f64 {
        match self.scale {
            Scale::Linear | Scale::Whole => value,
            Scale::Logarithmic => value.log10(),
        }
    }

    /// Returns the first and the last coordinate of an axis that shows all of these values, with a
    /// margin of 4 % at both ends.
    pub(crate) fn coordinates(&self, values: impl Iterator<Item = f64>) -> [f64; 2] {
        let coordinates =
            values.filter(|value| self.has(*value)).map(|value| self.coordinate(value));
        let (low, high) = coordinates
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| {
                (low.min(at), high.max(at))
            });
        if low > high {
            return [0.0, 1.0];
        }
        // A single value spans no range, so the axis gets a width in proportion to the value.
        let width = if high > low { high - low } else { high.abs().max(0.1) };
        [low - 0.04 * width, high + 0.04 * width]
    }

    /// Returns the coordinate and the text of each tick from coordinate `low` to `high`.
    pub(crate) fn ticks_between(&self, [low, high]: [f64; 2]) -> Vec<(f64, String)> {
        let is_shown = |coordinate: &f64| (low..=high).contains(coordinate);
        let ticks: Vec<(f64, String)> = if !self.ticks.is_empty() {
            let ticks = self.ticks.iter().filter(|(value, _)| self.has(*value));
            ticks.map(|(value, text)| (self.coordinate(*value), text.clone())).collect()
        } else if self.scale == Scale::Logarithmic && high - low > 1.0 {
            let decades = whole(low.floor())..=whole(high.ceil());
            let round = decades.flat_map(|decade| [1, 2, 5].map(|digit| (digit, decade)));
            round
                .map(|(digit, decade)| {
                    let value = f64::from(digit) * 10_f64.powi(decade);
                    (value.log10(), text(value, decade))
                })
                .collect()
        } else if self.scale == Scale::Logarithmic {
            let values = self.round_values(10_f64.powf(low), 10_f64.powf(high));
            values.map(|(value, text)| (value.log10(), text)).collect()
        } else {
            self.round_values(low, high).collect()
        };
        ticks.into_iter().filter(|(coordinate, _)| is_shown(coordinate)).collect()
    }

    /// Returns round values from `low` to `high`, with their texts: all multiples of a step that is
    /// 1, 2 or 5 times a power of ten.
    fn round_values(&self, low: f64, high: f64) -> impl Iterator<Item = (f64, String)> + use<> {
        let least = (high - low).max(f64::MIN_POSITIVE) / MOST_TICKS;
        let mut decade = whole(least.log10().floor());
        let mut digit = [1, 2, 5]
            .into_iter()
            .find(|digit| f64::from(*digit) * 10_f64.powi(decade) >= least)
            .unwrap_or(10);
        if self.scale == Scale::Whole && decade < 0 && (digit < 10 || decade < -1) {
            (digit, decade) = (1, 0);
        }
        let step = f64::from(digit) * 10_f64.powi(decade);
        let decade = if digit == 10 { decade + 1 } else { decade };
        let places: RangeInclusive<i32> = whole((low / step).ceil())..=whole((high / step).floor());
        places.map(move |place| {
            let value = f64::from(place) * step;
            (value, text(value, decade))
        })
    }
}

/// Formats a multiple of 10^`decade` with the decimal places that it needs.
fn text(value: f64, decade: i32) -> String {
    let places = usize::try_from(-decade).unwrap_or(0);
    format!("{value:.places$}").replace('-', "−")
}

#[expect(clippy::cast_possible_truncation, reason = "saturates, far outside the range of any axis")]
fn whole(value: f64) -> i32 {
    value as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(scale: Scale, low: f64, high: f64) -> Vec<String> {
        let axis = Axis::new("", scale);
        let ends = [axis.coordinate(low), axis.coordinate(high)];
        let ticks = axis.ticks_between(ends);
        for (coordinate, _) in &ticks {
            assert!((ends[0]..=ends[1]).contains(coordinate));
        }
        ticks.into_iter().map(|(_, text)| text).collect()
    }

    #[test]
    fn ticks_are_round_and_have_the_digits_that_tell_them_apart() {
        for (scale, low, high, expected) in [
            (Scale::Linear, 0.0, 1.0, "0.0 0.1 0.2 0.3 0.4 0.5 0.6 0.7 0.8 0.9 1.0"),
            (
                Scale::Linear,
                0.0029,
                0.00305,
                "0.00290 0.00292 0.00294 0.00296 0.00298 0.00300 0.00302 0.00304",
            ),
            (Scale::Linear, -30.0, 10.0, "−30 −25 −20 −15 −10 −5 0 5 10"),
            (Scale::Whole, 0.0, 2.0, "0 1 2"),
            (Scale::Whole, 0.0, 7.5, "0 1 2 3 4 5 6 7"),
            (Scale::Whole, 0.0, 60.0, "0 10 20 30 40 50 60"),
            (Scale::Logarithmic, 0.002, 1.0, "0.002 0.005 0.01 0.02 0.05 0.1 0.2 0.5 1"),
            (Scale::Logarithmic, 100.0, 610.0, "100 200 300 400 500 600"),
        ] {
            let expected: Vec<&str> = expected.split(' ').collect();
            assert_eq!(texts(scale, low, high), expected, "{scale:?} {low} {high}");
        }
    }

    #[test]
    fn an_axis_shows_all_values_that_have_a_place_on_it() {
        let axis = Axis::new("", Scale::Logarithmic);
        let [low, high] = axis.coordinates([0.01, 1.0, 0.0, f64::NAN].into_iter());
        assert!((low + 2.08).abs() < 1e-12 && (high - 0.08).abs() < 1e-12);
        let [low, high] = Axis::new("", Scale::Linear).coordinates([3.0].into_iter());
        assert!(low < 3.0 && high > 3.0);
        let [low, high] = axis.coordinates(std::iter::empty());
        assert!(low < high, "no values");
    }
}
