//! Potential of a current dipole on a spherical head: brain, skull and scalp.

use recordings::Position;

use super::dipole::Dipole;

/// Outer radii of brain and skull, in radii of the scalp (Cuffin and Cohen 1979; Berg and Scherg
/// 1994).
const RADII: [f64; 2] = [0.87, 0.92];
/// Conductivities of brain, skull and scalp, divided by the brain's. The skull conducts 15 times
/// worse than brain and scalp (Oostendorp, Delbeke and Stegeman 2000).
pub(super) const CONDUCTIVITIES: [f64; 3] = [1.0, 1.0 / 15.0, 1.0];
/// Number of terms of the series for the potential. A term falls with `eccentricity^n`. Largest
/// error, measured against 400 terms: 5e-6 of the largest potential for the eyes, which are
/// farthest out (0.83), below 1e-7 for the cortex (at most 0.75).
const TERMS: usize = 64;

/// Three concentric spheres, each of one conductivity, in air.
///
/// With the dipole at eccentricity b and in direction d, its moment q, a point r on the scalp and
/// `x = d . r`, the potential in units of `|q| / (4 pi sigma R^2)` is
///
/// ```text
/// V = sum over n >= 1 of g_n b^(n-1) [ n (q.d) P_n(x) + (q.r - x (q.d)) P_n'(x) ]
/// ```
///
/// with the Legendre polynomials `P_n`. `g_n` follows from the boundary conditions: potential and
/// normal current are continuous between the spheres, and no current leaves the scalp. One sphere
/// has `g_n = (2n + 1) / n`. Source: de Munck and Peters 1993; Zhang 1995.
///
/// Only `+ - * /` are used, so the result is the same on every platform.
#[derive(Debug, Clone)]
pub(super) struct Head {
    /// Factors `g_n` of the series, from n = 1 on.
    transfer: [f64; TERMS],
}

impl Head {
    /// Creates a head. `conductivities` holds the conductivities of brain, skull and scalp, each
    /// divided by the brain's.
    pub(super) fn new(conductivities: [f64; 3]) -> Self {
        let [brain, skull, scalp] = conductivities;
        let mut powers = RADII;
        let mut order = 0.0;
        let transfer = std::array::from_fn(|_| {
            order += 1.0;
            let n = order;
            // In each sphere the potential of order n is `rising r^n + falling r^-(n+1)`. With
            // these values no current leaves the scalp, where r = 1 and the potential is 2n + 1.
            let (mut rising, mut falling) = (n + 1.0, n);
            let outer = [skull / brain, scalp / skull];
            for index in [1, 0] {
                // Advance the power of the boundary's radius r from r^(2n-1) to r^(2n+1).
                powers[index] *= RADII[index] * RADII[index];
                let power = powers[index];
                // Potential divided by r^n, and radial current divided by r^(n-1), at the inner
                // side of the boundary.
                let potential = rising + falling / power;
                let current = (n * rising - (n + 1.0) * falling / power) * outer[index];
                rising = ((n + 1.0) * potential + current) / (2.0 * n + 1.0);
                falling = power * (n * potential - current) / (2.0 * n + 1.0);
            }
            // In the brain, the falling part is the dipole's own potential. `g_n` is the scalp's
            // potential divided by it.
            (2.0 * n + 1.0) / falling
        });
        Self { transfer }
    }

    /// Returns the potential of `dipole` at a point of the scalp, relative to a point far away.
    pub(super) fn potential(&self, dipole: &Dipole, at: Position) -> f64 {
        let x = dipole.direction.dot(at);
        let radial = dipole.moment.dot(dipole.direction);
        let tangential = dipole.moment.dot(at) - x * radial;
        // Legendre polynomials P_(n-1) and P_n and their derivatives, by Bonnet's recurrence and
        // P_(n+1)' = P_(n-1)' + (2n + 1) P_n.
        let (mut before, mut polynomial) = (1.0, x);
        let (mut slope_before, mut slope) = (0.0, 1.0);
        let (mut n, mut power, mut sum) = (1.0, 1.0, 0.0);
        for factor in self.transfer {
            sum += factor * power * (n * radial * polynomial + tangential * slope);
            (slope_before, slope) = (slope, slope_before + (2.0 * n + 1.0) * polynomial);
            (before, polynomial) =
                (polynomial, ((2.0 * n + 1.0) * x * polynomial - n * before) / (n + 1.0));
            power *= dipole.eccentricity;
            n += 1.0;
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DIPOLES: [([f64; 3], [f64; 3]); 4] = [
        ([0.0, 0.0, 0.5], [0.0, 0.0, 1.0]),
        ([0.2, -0.5, 0.3], [0.6, 0.0, 0.8]),
        ([-0.3, 0.4, 0.5], [0.0, 1.0, 0.0]),
        ([0.1, -0.6, 0.42], [0.0, -0.8, 0.6]),
    ];
    const ELECTRODES: [&str; 4] = ["Cz", "Oz", "T7", "C4"];

    /// Closed form of the potential on one sphere: the gradient, with respect to the dipole's
    /// position r0, of `2 / d + ln(2 / (1 - r0.r + d))` with `d = |r - r0|`, whose series is `sum
    /// (2n + 1) / n b^n P_n(x)`.
    fn one_sphere(dipole: &Dipole, at: Position) -> f64 {
        let place = dipole.direction.scaled(dipole.eccentricity);
        let to = at.minus(place);
        let distance = to.dot(to).sqrt();
        let first = 2.0 * dipole.moment.dot(to) / distance.powi(3);
        let second = dipole.moment.dot(at.plus(to.scaled(1.0 / distance)));
        first + second / (1.0 - place.dot(at) + distance)
    }

    #[test]
    fn equal_conductivities_yield_the_closed_form_of_one_sphere() {
        let head = Head::new([1.0; 3]);
        for (place, moment) in DIPOLES {
            let dipole = Dipole::at(place, moment);
            for label in ELECTRODES {
                let at = Position::from_label(label).expect("an electrode");
                let (series, closed) = (head.potential(&dipole, at), one_sphere(&dipole, at));
                // The series is truncated after `TERMS` terms. Largest measured error: 2e-7, at
                // eccentricity 0.74.
                assert!((series - closed).abs() < 1e-6, "{label}: {series} {closed}");
            }
        }
    }

    #[test]
    fn potentials_equal_those_of_mne_python() {
        // Potentials, uV, of 10 nA m in a head of 90 mm and 0.33 S/m, by MNE-Python 1.13.2:
        //     sphere = mne.make_sphere_model((0, 0, 0), 0.09, relative_radii=(0.87, 0.92, 1),
        //                                    sigmas=(0.33, 0.022, 0.33))
        //     mne.make_forward_dipole(mne.Dipole([0], [0.09 * place], [1e-8], [moment], [100]),
        //                             sphere, info)[0]["sol"]["data"] * 1e-8 * 1e6
        let golden = [
            [2.340_671, -0.055_363, -0.055_363, 0.935_243],
            [0.671_085, -0.203_111, -0.319_651, 1.106_981],
            [-0.662_854, -0.540_478, -0.512_017, -0.267_586],
            [0.078_543, 2.604_630, -0.198_756, -0.081_163],
        ];
        let head = Head::new(CONDUCTIVITIES);
        let unit_uv = 1e-8 / (4.0 * std::f64::consts::PI * 0.33 * 0.09 * 0.09) * 1e6;
        for ((place, moment), expected) in DIPOLES.into_iter().zip(golden) {
            let dipole = Dipole::at(place, moment);
            for (label, expected) in ELECTRODES.into_iter().zip(expected) {
                let at = Position::from_label(label).expect("an electrode");
                let found = unit_uv * head.potential(&dipole, at);
                // MNE approximates the series of the potential by three dipoles (Berg and Scherg
                // 1994). Largest measured difference: 0.0013 uV.
                assert!(
                    (found - expected).abs() < 0.002,
                    "{place:?} at {label}: {found}, MNE {expected}"
                );
            }
        }
    }
}
