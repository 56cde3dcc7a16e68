//! Current dipoles in the brain, which stand for patches of cortex.

use recordings::Position;

use super::noise::Noise;

/// Share of the random dipoles that are radial, as in the crowns of gyri. The others are
/// tangential, as in the walls of sulci.
const RADIAL: f64 = 0.7;
/// Smallest z coordinate of a random dipole's direction, a unit vector: about 17 degrees below the
/// plane through the ears.
const LOWEST: f64 = -0.3;

/// Current dipole in the brain.
#[derive(Debug, Clone, Copy)]
pub(super) struct Dipole {
    /// Distance from the centre of the head, in radii of the scalp: above 0, and below the radius
    /// of the brain.
    pub(super) eccentricity: f64,
    /// Unit vector from the centre of the head towards the dipole.
    pub(super) direction: Position,
    /// Dipole moment, without a unit: `Scalp` scales the potentials, so only ratios of moments
    /// matter.
    pub(super) moment: Position,
}

impl Dipole {
    /// Creates a dipole at `place`, in radii of the scalp.
    pub(super) fn at(place: [f64; 3], moment: [f64; 3]) -> Self {
        let [place, moment] = [place, moment].map(|[x, y, z]| Position { x, y, z });
        let eccentricity = place.dot(place).sqrt();
        Self { eccentricity, direction: place.scaled(1.0 / eccentricity), moment }
    }

    /// Draws a dipole with a moment of length 1: the direction uniform over the upper part of the
    /// head, the eccentricity uniform between the two limits.
    pub(super) fn draw(noise: &mut Noise, eccentricity: (f64, f64)) -> Self {
        let direction = loop {
            let direction = direction(noise);
            if direction.z >= LOWEST {
                break direction;
            }
        };
        let moment =
            if noise.uniform(0.0, 1.0) < RADIAL { direction } else { tangent(direction, noise) };
        Self { eccentricity: noise.uniform(eccentricity.0, eccentricity.1), direction, moment }
    }
}

/// Draws a direction, uniform over the sphere: draws points of a cube until one is in the sphere.
fn direction(noise: &mut Noise) -> Position {
    loop {
        let mut coordinate = || noise.uniform(-1.0, 1.0);
        let (x, y, z) = (coordinate(), coordinate(), coordinate());
        let point = Position { x, y, z };
        let square = point.dot(point);
        if (0.01..1.0).contains(&square) {
            return point.scaled(1.0 / square.sqrt());
        }
    }
}

/// Draws a direction at right angles to `axis`.
fn tangent(axis: Position, noise: &mut Noise) -> Position {
    loop {
        let other = direction(noise);
        let along = other.dot(axis);
        let across = other.minus(axis.scaled(along));
        let square = across.dot(across);
        if square > 0.01 {
            return across.scaled(1.0 / square.sqrt());
        }
    }
}
