//! Power spectral density, by Welch's method.

use std::f64::consts::PI;

use realfft::RealFftPlanner;

/// Samples per segment: 8 s at 512 Hz, which puts the band's lower edge, 0.5 Hz, at bin 4 (DC is bin 0).
const SEGMENT: usize = 4096;

/// Power spectral density of a signal, in bins of equal width from 0 Hz upwards.
#[derive(Debug, Clone)]
pub(crate) struct Spectrum {
    /// Width of a bin, Hz; the first bin is centred on 0.
    bin_hz: f64,
    /// Density of each bin, in the squared unit of the signal per Hz.
    power: Vec<f64>,
}

impl Spectrum {
    /// Averages the spectra of Hann-windowed segments that overlap by half, each without its mean.
    ///
    /// # Panics
    /// When the signal is shorter than a segment.
    pub(crate) fn new(signal: &[f64], rate_hz: f64) -> Self {
        assert!(signal.len() >= SEGMENT, "{} samples", signal.len());
        let transform = RealFftPlanner::<f64>::new().plan_fft_forward(SEGMENT);
        let window: Vec<f64> = (0..SEGMENT)
            .map(|n| (PI * real(n) / real(SEGMENT)).sin().powi(2))
            .collect();
        let energy: f64 = window.iter().map(|w| w * w).sum();
        let mut power = vec![0.0; SEGMENT / 2 + 1];
        let mut bins = transform.make_output_vec();
        let segments = signal.windows(SEGMENT).step_by(SEGMENT / 2);
        let count = real(segments.len());
        for segment in segments {
            let mean = segment.iter().sum::<f64>() / real(SEGMENT);
            let windowed = segment.iter().zip(&window).map(|(x, w)| (x - mean) * w);
            // Fails only if a length differs from the plan's.
            if transform
                .process(&mut windowed.collect::<Vec<_>>(), &mut bins)
                .is_ok()
            {
                for (power, bin) in power.iter_mut().zip(&bins) {
                    // The factor 2 adds the negative frequencies.
                    *power += 2.0 * bin.norm_sqr() / energy / rate_hz / count;
                }
            }
        }
        Self {
            bin_hz: rate_hz / real(SEGMENT),
            power,
        }
    }

    /// Returns the mean of one or more spectra of the same rate.
    pub(crate) fn mean(spectra: &[Self]) -> Self {
        let mut mean = spectra[0].clone();
        for (bin, power) in mean.power.iter_mut().enumerate() {
            let sum: f64 = spectra.iter().map(|other| other.power[bin]).sum();
            *power = sum / real(spectra.len());
        }
        mean
    }

    /// Returns the rms value of the signal between two frequencies in Hz, both included.
    pub(crate) fn rms(&self, [low, high]: [f64; 2]) -> f64 {
        let inside = self.points().filter(|(hz, _)| (low..=high).contains(hz));
        let power: f64 = inside.map(|(_, power)| power * self.bin_hz).sum();
        power.sqrt()
    }

    /// Returns the frequency in Hz and the power density of each bin.
    pub(crate) fn points(&self) -> impl Iterator<Item = (f64, f64)> {
        let points = self.power.iter().enumerate();
        points.map(|(bin, power)| (real(bin) * self.bin_hz, *power))
    }
}

/// Converts a count to a float, saturating at 2^32 - 1.
pub(crate) fn real(count: usize) -> f64 {
    f64::from(u32::try_from(count).unwrap_or(u32::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sine_of_amplitude_2_has_rms_root_2_in_a_band_around_it_and_none_elsewhere() {
        let sine = |n| 2.0 * (2.0 * PI * 10.0 * real(n) / 512.0).sin() + 700.0;
        let signal: Vec<f64> = (0..5 * SEGMENT).map(sine).collect();
        let spectrum = Spectrum::new(&signal, 512.0);
        let inside = spectrum.rms([9.5, 10.5]);
        assert!((inside - 2.0_f64.sqrt()).abs() < 1e-9, "{inside}");
        assert!(spectrum.rms([11.0, 256.0]) < 1e-9);
    }
}
