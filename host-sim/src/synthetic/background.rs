//! The background: dipoles in the cortex, and the activity of the reference electrodes.

use super::{
    dipole::Dipole,
    noise::{LowPassNoise, Noise},
    scalp::Scalp,
};

/// A group of dipoles whose noise has the same low-pass spectrum.
struct Band {
    /// Corner frequency of the low-pass that shapes the noise, Hz.
    corner: f64,
    /// Smallest and largest eccentricity of a dipole, in radii of the scalp.
    eccentricity: (f64, f64),
}

/// Bands of the background. Each has four times the corner frequency and [`FALL`] times the
/// variance of the previous one, so the power spectrum falls as 1/f^1.7 from the first corner to
/// the last, as in EEGMMIDB S001 (exponents of 1.6 to 1.7 from 2 to 40 Hz in R01, R03, R07 and
/// R11).
///
/// Slow activity spans larger patches of cortex than fast activity, and a dipole with the same
/// potential as a patch lies deeper than the patch (de Munck, Vijn and Lopes da Silva 1992). In
/// S001R11, ten spatial components hold 99.1 % of the variance from 0.5 to 2 Hz and 95.3 % from 14
/// to 30 Hz.
const BANDS: [Band; 4] = [
    Band { corner: 0.5, eccentricity: (0.35, 0.55) },
    Band { corner: 2.0, eccentricity: (0.35, 0.55) },
    Band { corner: 8.0, eccentricity: (0.45, 0.65) },
    Band { corner: 32.0, eccentricity: (0.55, 0.75) },
];
/// Ratio of the variances of two successive bands: `4^-0.7`.
const FALL: f64 = 0.379;
/// Share of the background's variance that lies within 0.5-60 Hz: the mean, weighted by variance,
/// of `2/pi (atan(60 / c) - atan(0.5 / c))` over the bands' corner frequencies c.
const IN_BAND: f64 = 0.6146;
/// Number of dipoles in each band.
const DIPOLES: usize = 48;

/// Share of the variance that comes from the reference: potentials at the ear lobes, which appear
/// equally at each electrode of the scalp. This share sets the correlation of distant electrodes.
const REFERENCE: f64 = 0.5;

/// Electrodes over which the variance of the background is averaged: the 10-20 system.
const SITES: &str = "Fp1 Fp2 F7 F3 Fz F4 F8 T7 C3 Cz C4 T8 P7 P3 Pz P4 P8 O1 O2";

#[derive(Debug, Clone)]
pub(super) struct Background {
    noise: Noise,
    sources: Vec<Source>,
}

/// A source of noise: a dipole, or the reference electrodes. Its noise is independent of the noise
/// of all other sources.
#[derive(Debug, Clone)]
struct Source {
    activity: LowPassNoise,
    /// Amplitude of this source at each electrode, uV RMS.
    amplitudes: Vec<f64>,
}

impl Background {
    pub(super) fn new(mut noise: Noise, scalp: &Scalp, rate: f64, rms_uv: f64) -> Self {
        let mut sources = Vec::new();
        // `total` is the sum of the bands' relative variances 1, FALL, FALL^2 and FALL^3.
        let total = 1.0 + FALL * (1.0 + FALL * (1.0 + FALL));
        let mut variance = rms_uv * rms_uv / (total * IN_BAND);
        for band in BANDS {
            let dipoles = [(); DIPOLES].map(|()| Dipole::draw(&mut noise, band.eccentricity));
            let powers = scalp.powers_at(&dipoles, SITES);
            let (sum, sites) =
                powers.iter().fold((0.0, 0.0), |(sum, sites), power| (sum + power, sites + 1.0));
            let mean_square = sum / sites;
            let scale = (variance * (1.0 - REFERENCE) / mean_square).sqrt();
            let reference = (variance * REFERENCE).sqrt();
            let amplitudes = dipoles.iter().map(|dipole| scalp.potentials(dipole, scale));
            let common = vec![reference; scalp.electrodes()];
            for amplitudes in amplitudes.chain([common]) {
                let activity = LowPassNoise::new(band.corner, rate, &mut noise);
                sources.push(Source { activity, amplitudes });
            }
            variance *= FALL;
        }
        Self { noise, sources }
    }

    pub(super) fn add(&mut self, microvolts: &mut [f64]) {
        for source in &mut self.sources {
            let activity = source.activity.advance(&mut self.noise);
            for (uv, amplitude) in microvolts.iter_mut().zip(&source.amplitudes) {
                *uv += amplitude * activity;
            }
        }
    }
}
