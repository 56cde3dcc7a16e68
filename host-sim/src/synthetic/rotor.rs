//! A turning pointer: cosine and sine of a steadily growing angle.

/// A point that turns on a circle, `frequency / rate` of a turn per sample.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rotor {
    turn: (f64, f64),
    /// Cosine and sine, or what a driven rotor makes of them.
    pub(super) point: (f64, f64),
}

impl Rotor {
    /// Begins at (1, 0). Cosine and sine of one step come from their series, not from the
    /// platform: eight halvings make the angle < 0.0123, where four terms leave less than 1e-19.
    pub(super) fn new(frequency: f64, rate: f64) -> Self {
        let angle = std::f64::consts::TAU * frequency / rate / 256.0;
        let square = angle * angle;
        let mut cos = 1.0 - square / 2.0 * (1.0 - square / 12.0 * (1.0 - square / 30.0));
        let mut sin = angle * (1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0)));
        for _ in 0..8 {
            (cos, sin) = (cos * cos - sin * sin, 2.0 * sin * cos);
        }
        Self {
            turn: (cos, sin),
            point: (1.0, 0.0),
        }
    }

    /// Turns by one sample and keeps the radius at 1: `(3 - r^2) / 2` is 1 / r near r = 1.
    pub(super) fn step(&mut self) -> (f64, f64) {
        self.turn_by(1.0);
        let (x, y) = self.point;
        let correction = (3.0 - (x * x + y * y)) / 2.0;
        self.point = (x * correction, y * correction);
        self.point
    }

    /// Turns by one sample and scales by `factor`.
    pub(super) fn turn_by(&mut self, factor: f64) {
        let (x, y) = self.point;
        let (cos, sin) = self.turn;
        self.point = (factor * (x * cos - y * sin), factor * (x * sin + y * cos));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rotor_keeps_frequency_and_radius_for_an_hour() {
        let mut rotor = Rotor::new(50.0, 512.0);
        for _ in 0..3600 * 512 {
            rotor.step();
        }
        let (x, y) = rotor.point;
        // 180,000 whole turns; measured: radius exact, angle 2.0e-10 rad.
        assert!((x - 1.0).abs() < 1e-12 && y.abs() < 1e-9, "{x} {y}");
    }
}
