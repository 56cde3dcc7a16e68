//! Measures the noise that fixed-point arithmetic adds to a filter's output: the difference from
//! its twin, the same filter in f64.

use std::f64::consts::PI;

use dsp_process::SplitProcess;
use fixed_dsp::{CascadeState, Filter};
use idsp::iir::{DirectForm1Dither, DirectForm1Wide};
use model::GUARD_BITS;
use pipeline::Mains;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use realfft::{RealFftPlanner, num_complex::Complex64};
use serde::Serialize;

use crate::idsp_cascade::{IdspCascade, Section29};
use demo::response::{BAND_HZ, MAINS_HZ, Twin};

/// Length of time before the measurement in which the filters settle, s. The slowest poles decay as
/// exp(-0.97 t): to e^-31 in this time.
const SETTLING_S: usize = 32;
/// Duration of the measured part of each signal, s.
const MEASURED_S: usize = 64;
/// Number of electrodes with different signals, over which the noise power is averaged.
const ELECTRODES: u64 = 8;

/// Amplitudes of a test signal, uV: electrode offset, mains at 50 Hz (peak), and pink noise from
/// 0.5 Hz upwards (rms). The sign of the offset alternates from electrode to electrode.
type Amplitudes = [f64; 3];
const EEG: Amplitudes = [20_000.0, 100.0, 30.0];
const MAINS: Amplitudes = [0.0, 100.0, 0.0];
const SILENCE: Amplitudes = [0.0; 3];

/// Noise of our filters, and of idsp's two low-noise forms `DirectForm1Dither` and
/// `DirectForm1Wide`.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Noise {
    pub(crate) ours: Measured,
    idsp_dither: Measured,
    idsp_wide: Measured,
}

/// Noise of one filter between 0.5 and 60 Hz, for each of the test signals, nV rms.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Measured {
    pub(crate) eeg: f64,
    mains: f64,
    silence: f64,
}

impl Noise {
    pub(crate) fn measure(twin: &Twin) -> Self {
        let ours = || {
            let mut state = CascadeState::REST;
            move |x| Mains::Hz50.apply(&mut state, x)
        };
        Self {
            ours: measure(twin, ours),
            idsp_dither: measure(twin, peer::<DirectForm1Dither>),
            idsp_wide: measure(twin, peer::<DirectForm1Wide>),
        }
    }
}

fn peer<S: Default>() -> impl FnMut(i32) -> i32
where
    Section29: SplitProcess<i32, i32, S>,
{
    let mut cascade = IdspCascade::<S>::default();
    move |x| cascade.apply(0, x)
}

/// Measures the noise of a filter with each test signal. `at_rest` returns a new filter for each
/// signal and electrode.
fn measure<F: FnMut(i32) -> i32>(twin: &Twin, at_rest: impl Fn() -> F) -> Measured {
    let spectrum = |amplitudes| {
        let spectra = (0..ELECTRODES).map(|electrode| {
            let counts = counts(amplitudes, electrode);
            let error = error_nv(&counts, twin.clone(), at_rest());
            Spectrum::new(&error, model::ADC_RATE_HZ.into())
        });
        Spectrum::mean(&spectra.collect::<Vec<_>>())
    };
    Measured {
        eeg: spectrum(EEG).rms(BAND_HZ),
        mains: spectrum(MAINS).rms(BAND_HZ),
        silence: spectrum(SILENCE).rms(BAND_HZ),
    }
}

/// Returns the output of `filter` minus the output of `twin` for the same counts, nV, without the
/// time in which the filters settle.
fn error_nv(counts: &[i32], mut twin: Twin, mut filter: impl FnMut(i32) -> i32) -> Vec<f64> {
    let nv = f64::from(model::LSB_NV) / f64::from(1 << GUARD_BITS);
    let errors = counts.iter().map(|count| {
        let x = count << GUARD_BITS;
        (f64::from(filter(x)) - twin.apply(x.into())) * nv
    });
    errors.skip(SETTLING_S * rate()).collect()
}

/// Returns the samples of a test signal at one electrode, ADC counts.
fn counts([offset, mains, eeg]: Amplitudes, electrode: u64) -> Vec<i32> {
    let mut random = ChaCha8Rng::seed_from_u64(electrode);
    let samples = (SETTLING_S + MEASURED_S) * rate();
    let pink = pink(&mut random, samples);
    let phase = random.random_range(0.0..2.0 * PI);
    let is_even = electrode.is_multiple_of(2);
    let sign = if is_even { 1.0 } else { -1.0 };
    let uv = pink.iter().enumerate().map(|(n, pink)| {
        let angle = phase + 2.0 * PI * MAINS_HZ * real(n) / real(rate());
        sign * offset + mains * angle.sin() + eeg * pink
    });
    #[expect(clippy::cast_possible_truncation, reason = "below 21 mV, a ninth of full scale")]
    uv.map(|uv| (uv * 1000.0 / f64::from(model::LSB_NV)).round() as i32).collect()
}

/// Returns noise with an rms of 1, random phases, and a power density proportional to 1/f from 0.5
/// Hz.
fn pink(random: &mut ChaCha8Rng, samples: usize) -> Vec<f64> {
    let transform = RealFftPlanner::<f64>::new().plan_fft_inverse(samples);
    let mut bins = transform.make_input_vec();
    let last = bins.len() - 1;
    for (bin, value) in bins.iter_mut().enumerate().take(last).skip(1) {
        let hz = real(bin) * real(rate()) / real(samples);
        if hz >= BAND_HZ[0] {
            *value = Complex64::from_polar(hz.powf(-0.5), random.random_range(0.0..2.0 * PI));
        }
    }
    let mut signal = transform.make_output_vec();
    // An error is impossible: it occurs only if the length of a slice differs from the plan's.
    let _ = transform.process(&mut bins, &mut signal);
    let rms = (signal.iter().map(|x| x * x).sum::<f64>() / real(samples)).sqrt();
    signal.iter().map(|x| x / rms).collect()
}

fn rate() -> usize {
    model::ADC_RATE_HZ.into()
}

/// Number of samples per segment of the spectrum: 8 s at 512 Hz, which puts the band's lower edge,
/// 0.5 Hz, at bin 4 (DC is bin 0).
const SEGMENT: usize = 4096;

/// Power spectral density of a signal, in bins of equal width from 0 Hz upwards.
#[derive(Debug, Clone)]
struct Spectrum {
    /// Width of a bin, Hz; the first bin is centred on 0.
    bin_hz: f64,
    /// Power density of each bin: the squared unit of the signal, per Hz.
    power: Vec<f64>,
}

impl Spectrum {
    /// Averages the spectra of Hann-windowed segments that overlap by half. The mean of each
    /// segment is removed first.
    ///
    /// # Panics
    /// When the signal is shorter than a segment.
    fn new(signal: &[f64], rate_hz: f64) -> Self {
        assert!(signal.len() >= SEGMENT, "{} samples", signal.len());
        let transform = RealFftPlanner::<f64>::new().plan_fft_forward(SEGMENT);
        let window: Vec<f64> =
            (0..SEGMENT).map(|n| (PI * real(n) / real(SEGMENT)).sin().powi(2)).collect();
        let energy: f64 = window.iter().map(|w| w * w).sum();
        let mut power = vec![0.0; SEGMENT / 2 + 1];
        let mut bins = transform.make_output_vec();
        let segments = signal.windows(SEGMENT).step_by(SEGMENT / 2);
        let count = real(segments.len());
        for segment in segments {
            let mean = segment.iter().sum::<f64>() / real(SEGMENT);
            let windowed = segment.iter().zip(&window).map(|(x, w)| (x - mean) * w);
            // An error is impossible: it occurs only if the length of a slice differs from the
            // plan's.
            if transform.process(&mut windowed.collect::<Vec<_>>(), &mut bins).is_ok() {
                for (power, bin) in power.iter_mut().zip(&bins) {
                    // The factor 2 adds the power of the negative frequencies.
                    *power += 2.0 * bin.norm_sqr() / energy / rate_hz / count;
                }
            }
        }
        Self { bin_hz: rate_hz / real(SEGMENT), power }
    }

    /// Returns the mean of one or more spectra whose signals have the same rate.
    fn mean(spectra: &[Self]) -> Self {
        let mut mean = spectra[0].clone();
        for (bin, power) in mean.power.iter_mut().enumerate() {
            let sum: f64 = spectra.iter().map(|other| other.power[bin]).sum();
            *power = sum / real(spectra.len());
        }
        mean
    }

    /// Returns the rms of the signal from `low` to `high` Hz, both included.
    fn rms(&self, [low, high]: [f64; 2]) -> f64 {
        let inside = self.points().filter(|(hz, _)| (low..=high).contains(hz));
        let power: f64 = inside.map(|(_, power)| power * self.bin_hz).sum();
        power.sqrt()
    }

    /// Returns the frequency in Hz and the power density of each bin.
    fn points(&self) -> impl Iterator<Item = (f64, f64)> {
        let points = self.power.iter().enumerate();
        points.map(|(bin, power)| (real(bin) * self.bin_hz, *power))
    }
}

/// Converts a count to f64; it saturates at 2^32 - 1.
fn real(count: usize) -> f64 {
    f64::from(u32::try_from(count).unwrap_or(u32::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::checked_in;

    #[test]
    fn rounding_every_output_to_a_count_measures_as_the_noise_of_rounding() {
        // A filter with known noise: the twin, with its output rounded to whole counts.
        let artifact = checked_in::artifact().expect("the artifact");
        let twin = Twin::new(&artifact.description.filters);
        let mut exact = twin.clone();
        #[expect(clippy::cast_possible_truncation, reason = "an EEG of 20 mV at most")]
        let filter = move |x| {
            let levels_per_count = 1 << GUARD_BITS;
            let counts = exact.apply(f64::from(x)) / f64::from(levels_per_count);
            counts.round() as i32 * levels_per_count
        };
        let error = error_nv(&counts(EEG, 0), twin, filter);
        let rms = Spectrum::new(&error, model::ADC_RATE_HZ.into()).rms(BAND_HZ);
        // The noise, LSB / sqrt(12) rms, is spread evenly from 0 Hz to half the rate.
        let width = (BAND_HZ[1] - BAND_HZ[0]) / (f64::from(model::ADC_RATE_HZ) / 2.0);
        let expected = f64::from(model::LSB_NV) / 12.0_f64.sqrt() * width.sqrt();
        // The measured and the expected value differ by 1 %: the rms of 64 s of white noise has a
        // standard error of about 0.9 % in this band.
        assert!((rms / expected - 1.0).abs() < 0.05, "{rms} instead of {expected}");
    }

    #[test]
    fn the_test_signal_has_its_offset_mains_and_eeg() {
        let nv = f64::from(model::LSB_NV);
        let uv: Vec<f64> =
            counts(EEG, 1).iter().map(|count| f64::from(*count) * nv / 1000.0).collect();
        let mean = uv.iter().sum::<f64>() / real(uv.len());
        assert!((mean + 20_000.0).abs() < 1.0, "{mean}");
        let spectrum = Spectrum::new(&uv, model::ADC_RATE_HZ.into());
        let mains = spectrum.rms([49.5, 50.5]);
        assert!((mains - 100.0 / 2.0_f64.sqrt()).abs() < 1.0, "{mains}");
        let eeg = spectrum.rms([0.25, 49.0]).hypot(spectrum.rms([51.0, 256.0]));
        assert!((eeg - 30.0).abs() < 1.0, "{eeg}");
    }
}
