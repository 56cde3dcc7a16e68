//! Computes cosine and sine of a linearly growing angle by rotating a point.

use super::noise::Noise;

/// A point that rotates on a circle by `frequency / rate` of a turn per sample.
#[derive(Debug, Clone, Copy)]
pub(super) struct Phasor {
    /// Cosine and sine of the angle by which the point rotates per sample.
    rotation: (f64, f64),
    point: (f64, f64),
}

impl Phasor {
    /// Creates a phasor at (1, 0). Does not use the platform's cosine and sine, because they differ
    /// between platforms. Instead, halves the angle per sample eight times to less than 0.0123,
    /// where four terms of either function's series leave an error below 1e-19, and then doubles it
    /// eight times.
    pub(super) fn new(frequency: f64, rate: f64) -> Self {
        let angle = std::f64::consts::TAU * frequency / rate / 256.0;
        let square = angle * angle;
        let mut cos = 1.0 - square / 2.0 * (1.0 - square / 12.0 * (1.0 - square / 30.0));
        let mut sin = angle * (1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0)));
        for _ in 0..8 {
            (cos, sin) = (cos * cos - sin * sin, 2.0 * sin * cos);
        }
        Self { rotation: (cos, sin), point: (1.0, 0.0) }
    }

    /// Rotates by one sample and returns the point. The factor `(3 - r^2) / 2`, which is close to
    /// `1 / r` near r = 1, keeps the radius r at 1.
    pub(super) fn advance(&mut self) -> (f64, f64) {
        self.rotate(1.0);
        let (x, y) = self.point;
        let correction = (3.0 - (x * x + y * y)) / 2.0;
        self.point = (x * correction, y * correction);
        self.point
    }

    /// Rotates by one sample, damped by the factor `damping` < 1, and returns a coordinate of the
    /// point. Noise drives both coordinates, which keeps the variance of each at 1.
    pub(super) fn resonate(&mut self, damping: f64, noise: &mut Noise) -> f64 {
        let drive = (1.0 - damping * damping).sqrt();
        self.rotate(damping);
        self.point.0 += drive * noise.normal();
        self.point.1 += drive * noise.normal();
        self.point.0
    }

    /// Rotates by one sample and scales the radius by `factor`.
    fn rotate(&mut self, factor: f64) {
        let (x, y) = self.point;
        let (cos, sin) = self.rotation;
        self.point = (factor * (x * cos - y * sin), factor * (x * sin + y * cos));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frequency_and_radius_are_kept_for_an_hour() {
        let mut phasor = Phasor::new(50.0, 512.0);
        for _ in 0..3600 * 512 {
            phasor.advance();
        }
        let (x, y) = phasor.point;
        // After 180,000 whole turns the point is back at (1, 0). Measured: radius exact, angle off
        // by 2.0e-10 rad.
        assert!((x - 1.0).abs() < 1e-12 && y.abs() < 1e-9, "{x} {y}");
    }
}
