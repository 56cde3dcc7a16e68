//! Map of the head, seen from above, that shows one value for each electrode.

use std::path::Path;

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use crate::canvas::{self, Area, Drawn, FAINT, INK, PictureError};

/// An electrode on the map, with its value.
#[derive(Debug, Clone, PartialEq)]
pub struct Place {
    /// Name of the electrode, such as "Cz".
    pub label: String,
    /// Position on the map: distance from the vertex towards the right ear and towards the nose, in
    /// radii of the head's circle. [`on_map`] computes it from a position in space.
    pub at: [f64; 2],
    /// Value at the electrode, not negative, in the unit of the map.
    pub value: f64,
    /// True if the electrode was recorded, false if it was interpolated and is drawn hollow.
    pub is_measured: bool,
}

/// Map of one non-negative value for each electrode, interpolated between electrodes.
#[derive(Debug, Clone, PartialEq)]
pub struct ScalpMap {
    /// Electrodes, each with a finite value; at least one.
    pub places: Vec<Place>,
    /// Title of the picture, in one line.
    pub title: String,
    /// Line below the title, such as the mean of all electrodes.
    pub subtitle: String,
    /// Unit of the values, such as "%".
    pub unit: String,
}

const SIZE: (u32, u32) = (900, 860);
/// Distance from the nearest electrode up to which the map is coloured, in head radii.
const REACH: f64 = 0.26;
/// Number of colour levels.
const LEVELS: u8 = 24;
/// Colours of 0, of half the largest value, and of the largest value.
const COLORS: [RGBColor; 3] =
    [RGBColor(0xf4, 0xf8, 0xfb), RGBColor(0xf2, 0xb1, 0x6d), RGBColor(0xb0, 0x2a, 0x1d)];

impl ScalpMap {
    /// Writes the map as an SVG file.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn draw(&self, path: &Path) -> Result<(), PictureError> {
        canvas::page(path, SIZE, [&self.title, &self.subtitle], |area| self.draw_on(area))
    }

    fn draw_on(&self, area: &Area) -> Drawn {
        let head = Head { centre: (400, 380), radius: 330, square: 6 };
        let largest = self.places.iter().map(|place| place.value);
        let largest = largest.fold(0.0, f64::max).max(f64::MIN_POSITIVE);
        head.draw(area, |at| Some(color_of(level(self.value_at(at)? / largest))))?;
        for place in &self.places {
            let at = head.pixel(place.at);
            let dot = if place.is_measured { INK.filled() } else { INK.into() };
            area.draw(&Circle::new(at, 4, WHITE.filled()))?;
            area.draw(&Circle::new(at, 3, dot))?;
            // Labels are white where the map is dark.
            let color = if level(place.value / largest) > 2 * LEVELS / 3 { WHITE } else { INK };
            let style = canvas::text(12, color).pos(Pos::new(HPos::Center, VPos::Top));
            area.draw(&Text::new(place.label.clone(), (at.0, at.1 + 5), style))?;
        }
        self.draw_scale(area, largest)
    }

    fn value_at(&self, at: [f64; 2]) -> Option<f64> {
        interpolated(self.places.iter().map(|place| (place.at, place.value)), at)
    }

    fn draw_scale(&self, area: &Area, largest: f64) -> Drawn {
        let (top, bottom, left, right) = (120, 640, 790, 812);
        let count = i32::from(LEVELS);
        for place in 0..LEVELS {
            let row = |place: i32| top + (bottom - top) * place / count;
            let corners = [(left, row(place.into())), (right, row(i32::from(place) + 1))];
            let color = color_of(LEVELS - 1 - place);
            area.draw(&Rectangle::new(corners, color.filled()))?;
        }
        area.draw(&Rectangle::new([(left, top), (right, bottom)], FAINT))?;
        for (value, y) in
            [(largest, top), (largest / 2.0, i32::midpoint(top, bottom)), (0.0, bottom)]
        {
            let style = canvas::anchored(15, INK, HPos::Left);
            let text = format!("{} {}", with_digits(value, largest), self.unit);
            area.draw(&Text::new(text, (right + 8, y), style))?;
        }
        let hollow = self.places.iter().any(|place| !place.is_measured);
        if hollow {
            let style = canvas::anchored(14, FAINT, HPos::Left);
            let text = "hollow: electrodes that the recording lacks, interpolated from the others";
            area.draw(&Text::new(text, (28, 745), style))?;
        }
        Ok(())
    }
}

/// A head on a picture, seen from above.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Head {
    /// Pixel position of the vertex.
    pub(crate) centre: (i32, i32),
    /// Radius of the head's circle, pixels.
    pub(crate) radius: i32,
    /// Side length of the squares that make up the map, pixels; positive.
    pub(crate) square: i32,
}

impl Head {
    /// Draws the map and, around it, the outline of the head. `color` returns the colour at a
    /// position on the map; where it returns `None`, nothing is drawn.
    pub(crate) fn draw(&self, area: &Area, color: impl Fn([f64; 2]) -> Option<RGBColor>) -> Drawn {
        let Self { centre, radius, square } = *self;
        let places = || (-radius..radius).step_by(square.unsigned_abs() as usize);
        for row in places() {
            let middle = row + square / 2;
            let squares = places().filter_map(|column| {
                let x = column + square / 2;
                let is_inside = x * x + middle * middle <= radius * radius;
                let at = [x, -middle].map(|at| f64::from(at) / f64::from(radius));
                Some((column, color(at).filter(|_| is_inside)?))
            });
            let squares: Vec<(i32, RGBColor)> = squares.collect();
            // Neighbours of the same colour form one rectangle.
            for run in squares.chunk_by(|a, b| a.1 == b.1 && b.0 - a.0 == square) {
                let (first, last) = (run[0], run[run.len() - 1]);
                let corners = [
                    (centre.0 + first.0, centre.1 + row),
                    (centre.0 + last.0 + square, centre.1 + row + square),
                ];
                area.draw(&Rectangle::new(corners, first.1.filled()))?;
            }
        }
        let outline = INK.stroke_width(if radius > 200 { 3 } else { 2 });
        let side = radius / 10;
        let nose = [(-side, 4 - radius), (0, -radius - side), (side, 4 - radius)];
        let nose = nose.map(|(x, y)| (centre.0 + x, centre.1 + y));
        area.draw(&PathElement::new(nose, outline))?;
        area.draw(&Circle::new(centre, radius, outline))
    }

    /// Returns the pixel of a position on the map.
    pub(crate) fn pixel(&self, at: [f64; 2]) -> (i32, i32) {
        #[expect(clippy::cast_possible_truncation, reason = "saturates far outside the picture")]
        let [x, y] = at.map(|at| (at * f64::from(self.radius)).round() as i32);
        (self.centre.0.saturating_add(x), self.centre.1.saturating_sub(y))
    }
}

/// Returns the value at position `at`: the mean of the values of all `electrodes`, which are pairs
/// of position and value, weighted by the inverse fourth power of the distance. `None` if no
/// electrode is within [`REACH`].
pub(crate) fn interpolated(
    electrodes: impl Iterator<Item = ([f64; 2], f64)>,
    at: [f64; 2],
) -> Option<f64> {
    let (mut sum, mut weights, mut nearest) = (0.0, 0.0, f64::INFINITY);
    for (place, value) in electrodes {
        let squared = (place[0] - at[0]).powi(2) + (place[1] - at[1]).powi(2);
        let weight = 1.0 / (squared * squared).max(1e-12);
        sum += weight * value;
        weights += weight;
        nearest = nearest.min(squared);
    }
    (nearest <= REACH * REACH).then_some(sum / weights)
}

/// Returns an electrode's position on the map from its position on the unit sphere: x towards the
/// right ear, y towards the nose, z towards the vertex. Distance on the map is proportional to the
/// angle from the vertex; the outermost circle of the 10-20 system is at 0.9.
pub fn on_map([x, y, z]: [f64; 3]) -> [f64; 2] {
    /// Angle from the vertex to the outermost circle of the 10-20 system, degrees.
    const CIRCUMFERENCE: f64 = 72.0;
    let distance = z.clamp(-1.0, 1.0).acos().to_degrees() / CIRCUMFERENCE;
    let direction = x.hypot(y);
    if direction < 1e-9 {
        return [0.0, 0.0];
    }
    // The factor 0.9 leaves room for labels and for electrodes further down on the head.
    [x, y].map(|part| 0.9 * distance * part / direction)
}

/// Formats a value with as many decimal places as `largest` needs for three digits, at most 6.
fn with_digits(value: f64, largest: f64) -> String {
    let places = (0..6).find(|places| largest * 10_f64.powi(*places) >= 99.95);
    let places = usize::try_from(places.unwrap_or(6)).unwrap_or(0);
    format!("{value:.places$}")
}

/// Returns the colour level, 0 to [`LEVELS`] - 1, of a value that is `part` times the largest one.
fn level(part: f64) -> u8 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the levels"
    )]
    let level = (part.clamp(0.0, 1.0) * f64::from(LEVELS)) as u8;
    level.min(LEVELS - 1)
}

fn color_of(level: u8) -> RGBColor {
    let map = DerivedColorMap::new(&COLORS);
    map.get_color_normalized(f64::from(level), 0.0, f64::from(LEVELS - 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_vertex_is_the_centre_and_the_circumference_a_circle_of_radius_0_9() {
        let (sin, cos) = 72.0_f64.to_radians().sin_cos();
        for (position, expected) in [
            ([0.0, 0.0, 1.0], [0.0, 0.0]),
            ([sin, 0.0, cos], [0.9, 0.0]),
            ([0.0, -sin, cos], [0.0, -0.9]),
        ] {
            let place = on_map(position);
            let distance = (place[0] - expected[0]).hypot(place[1] - expected[1]);
            assert!(distance < 1e-12, "{place:?}");
        }
    }

    #[test]
    fn the_scale_has_three_digits_of_the_largest_value() {
        for (value, largest, text) in [
            (43.26, 43.26, "43.3"),
            (0.0, 43.26, "0.0"),
            (4.321, 4.321, "4.32"),
            (321.4, 4321.0, "321"),
            (0.001_234, 0.001_234, "0.00123"),
        ] {
            assert_eq!(with_digits(value, largest), text);
        }
    }

    #[test]
    fn the_map_has_each_electrode_s_value_at_its_place_and_means_between() {
        let place =
            |x, value| Place { label: "E".to_owned(), at: [x, 0.0], value, is_measured: true };
        let map = ScalpMap {
            places: vec![place(-0.2, 1.0), place(0.2, 3.0)],
            title: String::new(),
            subtitle: String::new(),
            unit: String::new(),
        };
        for (x, value) in [(-0.2, 1.0), (0.2, 3.0), (0.0, 2.0)] {
            let interpolated = map.value_at([x, 0.0]).expect("near an electrode");
            assert!((interpolated - value).abs() < 1e-6, "{x}");
        }
        assert_eq!(map.value_at([0.0, 0.9]), None);
        assert_eq!([level(-1.0), level(0.0), level(1.0)], [0, 0, LEVELS - 1]);
    }
}
