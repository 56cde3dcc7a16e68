//! Power spectral density, by Welch's method.

use std::f64::consts::PI;

use realfft::RealFftPlanner;

/// Samples of a segment; 8 s at 512 Hz, so that the band's lower edge of 0.5 Hz is the fourth bin.
const SEGMENT: usize = 4096;

/// Power per Hz over frequency.
#[derive(Debug, Clone)]
pub(crate) struct Spectrum {
    /// Width of a bin, Hz; the first is around 0.
    bin_hz: f64,
    /// Unit of the signal, squared, per Hz.
    power: Vec<f64>,
}

impl Spectrum {
    /// Mean of the spectra of Hann-windowed segments that overlap by half, each without its mean.
    ///
    /// # Panics
    /// When the signal is shorter than a segment.
    pub(crate) fn of(signal: &[f64], rate_hz: f64) -> Self {
        assert!(signal.len() >= SEGMENT, "{} samples", signal.len());
        let transform = RealFftPlanner::<f64>::new().plan_fft_forward(SEGMENT);
        let window: Vec<f64> = (0..SEGMENT)
            .map(|n| (PI * real(n) / real(SEGMENT)).sin().powi(2))
            .collect();
        let energy: f64 = window.iter().map(|w| w * w).sum();
        let mut spectrum = Self {
            bin_hz: rate_hz / real(SEGMENT),
            power: vec![0.0; SEGMENT / 2 + 1],
        };
        let mut bins = transform.make_output_vec();
        let segments = signal.windows(SEGMENT).step_by(SEGMENT / 2);
        let count = real(segments.len());
        for segment in segments {
            let mean = segment.iter().sum::<f64>() / real(SEGMENT);
            let mut windowed: Vec<f64> = segment
                .iter()
                .zip(&window)
                .map(|(x, w)| (x - mean) * w)
                .collect();
            // Fails only for lengths that the plan was not made for.
            if transform.process(&mut windowed, &mut bins).is_ok() {
                for (power, bin) in spectrum.power.iter_mut().zip(&bins) {
                    // Twice: the negative frequencies.
                    *power += 2.0 * bin.norm_sqr() / energy / rate_hz / count;
                }
            }
        }
        spectrum
    }

    /// Mean of spectra of the same rate; none of none.
    pub(crate) fn mean(spectra: &[Self]) -> Option<Self> {
        let mut mean = spectra.first()?.clone();
        for (bin, power) in mean.power.iter_mut().enumerate() {
            *power =
                spectra.iter().map(|other| other.power[bin]).sum::<f64>() / real(spectra.len());
        }
        Some(mean)
    }

    /// Root of the power between two frequencies, both included.
    pub(crate) fn rms(&self, [low, high]: [f64; 2]) -> f64 {
        let inside = self.points().filter(|(hz, _)| (low..=high).contains(hz));
        let power: f64 = inside.map(|(_, power)| power * self.bin_hz).sum();
        power.sqrt()
    }

    /// Frequency in Hz and power per Hz of each bin.
    pub(crate) fn points(&self) -> impl Iterator<Item = (f64, f64)> {
        let points = self.power.iter().enumerate();
        points.map(|(bin, power)| (real(bin) * self.bin_hz, *power))
    }
}

/// A count as a float.
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
        let spectrum = Spectrum::of(&signal, 512.0);
        let inside = spectrum.rms([9.5, 10.5]);
        assert!((inside - 2.0_f64.sqrt()).abs() < 1e-9, "{inside}");
        assert!(spectrum.rms([11.0, 256.0]) < 1e-9);
    }
}
