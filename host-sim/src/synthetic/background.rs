//! The 1/f background: independent sources, each seen by several electrodes.

use recordings::Position;

use super::{
    noise::{LowPassNoise, Noise},
    scalp::Scalp,
};

/// Corner frequencies of the low-pass noises whose sum is one source, Hz. Each noise has four times
/// the corner frequency and half the variance of the previous one. The power spectrum of the sum
/// falls as 1/f^1.5 from the first corner to the last.
const CORNERS: [f64; 5] = [0.5, 2.0, 8.0, 32.0, 128.0];

/// Share of a source's variance within 0.5-60 Hz: the mean, weighted by variance, of
/// `2/pi (atan(60 / c) - atan(0.5 / c))` over the corners c.
const IN_BAND: f64 = 0.633;

/// Reach of a source (see `Scalp::weights`), in radii of the head. Together with [`COMMON`], the
/// reach sets how the correlation between two electrodes (within 0.5-60 Hz) falls with the distance
/// between them. The result is close to a recording:
///
/// | Distance, radii | Generator, measured | EEGMMIDB S001R03 |
/// | --- | --- | --- |
/// | 0.3 | 0.96 | 0.93 |
/// | 1.1 | 0.60 | 0.65 |
/// | 1.7 | 0.42 | 0.41 |
const REACH: f64 = 0.8;
/// Share of each electrode's variance that comes from a source common to all electrodes.
const COMMON: f64 = 0.3;

/// White sensor noise of each electrode, uV RMS. An ADS1299 at gain 24 and 512 Hz contributes about
/// 0.2 (`ads1299::typical_noise_uv`, derived from the data sheet); the rest represents wet
/// electrodes.
const SENSOR_UV: f64 = 0.3;

#[derive(Debug, Clone)]
pub(super) struct Background {
    noise: Noise,
    sources: Vec<[LowPassNoise; CORNERS.len()]>,
    /// Amplitude of each source at each electrode, uV RMS: `mixing[electrode][source]`.
    mixing: Vec<Vec<f64>>,
    now: Vec<f64>,
    sensor_uv: f64,
}

impl Background {
    pub(super) fn new(mut noise: Noise, scalp: &Scalp, rate: f64, rms_uv: f64) -> Self {
        let sites = sites();
        let seen: Vec<Vec<f64>> = sites
            .iter()
            .map(|site| scalp.weights(*site, REACH))
            .collect();
        let mixing = (0..scalp.electrodes())
            .map(|electrode| {
                let squares: f64 = seen.iter().map(|row| row[electrode] * row[electrode]).sum();
                let own = ((1.0 - COMMON) / squares).sqrt();
                let gain = rms_uv * noise.uniform(0.7, 1.3);
                let shared = std::iter::once(COMMON.sqrt());
                shared
                    .chain(seen.iter().map(|row| row[electrode] * own))
                    .map(|w| w * gain)
                    .collect()
            })
            .collect();
        let source = |_| CORNERS.map(|corner| LowPassNoise::new(corner, rate, &mut noise));
        let sources: Vec<_> = (0..=sites.len()).map(source).collect();
        let now = vec![0.0; sources.len()];
        let sensor_uv = if rms_uv > 0.0 { SENSOR_UV } else { 0.0 };
        Self {
            noise,
            sources,
            mixing,
            now,
            sensor_uv,
        }
    }

    pub(super) fn add(&mut self, microvolts: &mut [f64]) {
        // The variances 1, 1/2, ... 1/16 of the noises sum to 31/16. Scale the variance within
        // 0.5-60 Hz to 1.
        let scale = (16.0 / 31.0 / IN_BAND).sqrt();
        let half = 0.5_f64.sqrt();
        for (now, source) in self.now.iter_mut().zip(&mut self.sources) {
            let mut weight = scale;
            *now = 0.0;
            for component in source {
                *now += weight * component.advance(&mut self.noise);
                weight *= half;
            }
        }
        for (uv, row) in microvolts.iter_mut().zip(&self.mixing) {
            let mixed: f64 = row
                .iter()
                .zip(&self.now)
                .map(|(weight, now)| weight * now)
                .sum();
            *uv += mixed + self.sensor_uv * self.noise.normal();
        }
    }
}

/// Returns 24 source positions that cover the head above the ears: two rings and the vertex.
fn sites() -> Vec<Position> {
    let rings = [
        "Fpz AF7 F7 FT7 T7 TP7 P7 PO7 Oz PO8 P8 TP8 T8 FT8 F8 AF8",
        "Fz FC3 C3 CP3 Pz CP4 C4",
        "Cz",
    ];
    let labels = rings.iter().flat_map(|labels| labels.split(' '));
    labels.filter_map(Position::from_label).collect()
}
