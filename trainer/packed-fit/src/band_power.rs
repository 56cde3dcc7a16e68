//! Correlation of the power of the alpha and the beta band before and after coding.

use crate::in_parallel;
use std::f64::consts::TAU;

/// The alpha and the beta band, Hz. The upper end is not part of a band.
const BANDS_HZ: [[usize; 2]; 2] = [[8, 13], [13, 30]];

/// Logarithm of each band's power in each second, `[band][electrode][second]`.
pub type LogPowers = [Vec<Vec<f64>>; 2];

/// Correlates the band powers of two signals, over windows of one second.
#[derive(Clone, Debug)]
pub struct BandPower {
    electrodes: usize,
    /// Number of steps in a second.
    second: usize,
    /// For each frequency bin of 1 Hz that is part of a band: the index of the band, and for each
    /// step cosine and sine at the bin's frequency, times a Hann window.
    bins: Vec<(usize, Vec<[f64; 2]>)>,
}

impl BandPower {
    /// Creates the windows for signals of `electrodes` electrodes with `rate_hz` steps per second.
    pub fn new(electrodes: usize, rate_hz: u32) -> Self {
        let second = rate_hz as usize;
        let part = |product: usize| TAU * (product % second) as f64 / second as f64;
        let wave = |hz: usize| {
            let value = |step| {
                let hann = 0.5 - 0.5 * part(step).cos();
                let (sin, cos) = part(hz * step).sin_cos();
                [hann * cos, hann * sin]
            };
            (0..second).map(value).collect()
        };
        let bins = BANDS_HZ
            .iter()
            .enumerate()
            .flat_map(|(band, &[low, high])| (low..high).map(move |hz| (band, hz)));
        Self {
            electrodes,
            second,
            bins: bins.map(|(band, hz)| (band, wave(hz))).collect(),
        }
    }

    /// Returns the [`correlation`] between each band's powers in the original and in the coded
    /// sequences. The values of a sequence are in the order step, electrode.
    pub fn correlation(&self, original: &[Vec<f32>], coded: &[Vec<f32>]) -> [f64; 2] {
        let powers =
            |sequences| in_parallel::map(sequences, |values: &Vec<f32>| self.log_powers(values));
        correlation(&powers(original), &powers(coded))
    }

    /// Returns the logarithm of each band's power in each second. The values are in the order step,
    /// electrode.
    pub fn log_powers(&self, values: &[f32]) -> LogPowers {
        let mut powers = [(); 2].map(|()| vec![Vec::new(); self.electrodes]);
        let window = self.second * self.electrodes;
        for values in values.chunks_exact(window) {
            for electrode in 0..self.electrodes {
                let signal = values.iter().skip(electrode).step_by(self.electrodes);
                let mut sums = [1e-12; 2];
                for (band, wave) in &self.bins {
                    let (mut real, mut imaginary) = (0.0, 0.0);
                    for (&value, [cos, sin]) in signal.clone().zip(wave) {
                        real += f64::from(value) * cos;
                        imaginary += f64::from(value) * sin;
                    }
                    sums[*band] += real * real + imaginary * imaginary;
                }
                for (powers, sum) in powers.iter_mut().zip(sums) {
                    powers[electrode].push(sum.ln());
                }
            }
        }
        powers
    }
}

/// Returns, for each band, Pearson's correlation of the powers in two lists of sequences, as the
/// mean over the electrodes.
pub fn correlation(one: &[LogPowers], other: &[LogPowers]) -> [f64; 2] {
    [0, 1].map(|band| {
        let electrodes = one.first().map_or(0, |powers| powers[band].len());
        let series = |sequences: &[LogPowers], electrode: usize| -> Vec<f64> {
            let series = sequences.iter().flat_map(|powers| &powers[band][electrode]);
            series.copied().collect()
        };
        let correlations = (0..electrodes)
            .map(|electrode| pearson(&series(one, electrode), &series(other, electrode)));
        correlations.sum::<f64>() / electrodes.max(1) as f64
    })
}

/// Returns Pearson's correlation of two series of the same length.
fn pearson(one: &[f64], other: &[f64]) -> f64 {
    let count = one.len().max(1) as f64;
    let mean = |values: &[f64]| values.iter().sum::<f64>() / count;
    let (mean_one, mean_other) = (mean(one), mean(other));
    let (mut product, mut square_one, mut square_other) = (0.0, 0.0, 0.0);
    for (a, b) in one.iter().zip(other) {
        let (a, b) = (a - mean_one, b - mean_other);
        product += a * b;
        square_one += a * a;
        square_other += b * b;
    }
    product / (square_one * square_other).sqrt().max(1e-300)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the signals of two electrodes at 128 Hz, a tone of 10 Hz and a tone of 20 Hz.
    /// `amplitudes` holds the amplitudes of both for each second.
    #[expect(clippy::cast_possible_truncation, reason = "signals are f32")]
    fn tones(amplitudes: &[[f64; 2]]) -> Vec<f32> {
        let value = |index: usize, tone: usize| {
            let phase = TAU * [10.0, 20.0][tone] * index as f64 / 128.0;
            (amplitudes[index / 128][tone] * phase.sin()) as f32
        };
        let indices = 0..128 * amplitudes.len();
        indices
            .flat_map(|index| [0, 1].map(|tone| value(index, tone)))
            .collect()
    }

    #[test]
    fn a_tone_has_its_power_in_its_band_only() {
        let powers = BandPower::new(2, 128).log_powers(&tones(&[[2.0, 3.0]]));
        let [alpha, beta] = powers;
        // A Hann window halves the amplitude a: |X|^2 = (a / 2 * 64)^2 in the bin of the tone, and
        // a quarter of that in each of the two bins beside it.
        let expected = |amplitude: f64| ((amplitude * 32.0).powi(2) * 1.5).ln();
        assert!((alpha[0][0] - expected(2.0)).abs() < 1e-3, "{alpha:?}");
        assert!((beta[1][0] - expected(3.0)).abs() < 1e-3, "{beta:?}");
        assert!(
            alpha[1][0] < -5.0 && beta[0][0] < -5.0,
            "{alpha:?} {beta:?}"
        );
    }

    #[test]
    fn the_correlation_follows_the_course_of_the_power_and_not_its_size() {
        let band = BandPower::new(2, 128);
        let original = band.log_powers(&tones(&[[1.0, 1.0], [2.0, 1.5], [4.0, 1.0], [1.0, 3.0]]));
        let halved = band.log_powers(&tones(&[[0.5, 1.0], [1.0, 1.5], [2.0, 1.0], [0.5, 3.0]]));
        let alpha = pearson(&original[0][0], &halved[0][0]);
        assert!((alpha - 1.0).abs() < 1e-9, "{alpha}");
        let turned = band.log_powers(&tones(&[[4.0, 1.0], [2.0, 1.0], [1.0, 1.0], [4.0, 1.0]]));
        let alpha = pearson(&original[0][0], &turned[0][0]);
        assert!((alpha + 1.0).abs() < 1e-9, "{alpha}");
    }
}
