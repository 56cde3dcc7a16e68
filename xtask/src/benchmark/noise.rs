//! What the arithmetic adds to the signal: the fixed-point filters against their float64 twin.

use std::f64::consts::PI;

use bench::idsp_cascade::{IdspCascade, Section29};
use dsp_process::SplitProcess;
use fixed_dsp::{CascadeState, Filter};
use idsp::iir::{DirectForm1Dither, DirectForm1Wide};
use model::GUARD_BITS;
use pipeline::Mains;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use realfft::{RealFftPlanner, num_complex::Complex64};

use super::spectrum::{Spectrum, real};
use super::twin::Twin;

/// Where noise counts, Hz: the band of the filters.
pub(crate) const BAND_HZ: [f64; 2] = [0.5, 60.0];
/// Left out while the filters settle, s: the slowest poles, 0.97 / s, decay by e^-31.
const SETTLING_S: usize = 32;
/// Measured after that, s.
const MEASURED_S: usize = 64;
/// Electrodes with a signal of their own; their powers are averaged.
const ELECTRODES: u64 = 8;

/// Amplitudes of a signal, uV.
#[derive(Debug, Clone, Copy)]
struct Mixture {
    /// Electrode offset of alternating sign.
    offset: f64,
    /// Amplitude (peak) of 50 Hz.
    mains: f64,
    /// Pink noise from 0.5 Hz on, rms.
    eeg: f64,
}

const SILENCE: Mixture = Mixture {
    offset: 0.0,
    mains: 0.0,
    eeg: 0.0,
};
const MAINS: Mixture = Mixture {
    mains: 100.0,
    ..SILENCE
};
const EEG: Mixture = Mixture {
    offset: 20_000.0,
    mains: 100.0,
    eeg: 30.0,
};

/// In-band noise of one filter, nV rms.
#[derive(Debug, Clone, Copy, serde::Serialize)]
pub(crate) struct InBand {
    /// With 20 mV offset, 100 uV mains and 30 uV EEG.
    pub(crate) eeg: f64,
    /// With 100 uV mains alone.
    pub(crate) mains: f64,
    /// With silence.
    pub(crate) silence: f64,
}

/// Noise of one filter.
#[derive(Debug, Clone)]
pub(crate) struct Measured {
    /// In the band.
    pub(crate) in_band: InBand,
    /// With EEG: frequency in Hz, density in nV per root Hz.
    pub(crate) density: Vec<(f64, f64)>,
}

/// Noise of ours and of the peer's two quiet forms.
#[derive(Debug, Clone)]
pub(crate) struct Noise {
    /// Ours.
    pub(crate) ours: Measured,
    /// idsp's `DirectForm1Dither`.
    pub(crate) idsp_dither: Measured,
    /// idsp's `DirectForm1Wide`.
    pub(crate) idsp_wide: Measured,
}

impl Noise {
    /// How often [`Noise::measure`] tells of its progress.
    pub(crate) const STAGES: usize = 3;

    /// Measures them; `stage` is told what comes next.
    pub(crate) fn measure(twin: &Twin, mut stage: impl FnMut(&'static str)) -> Self {
        stage("noise of ours");
        let ours = measure(twin, || {
            let mut state = CascadeState::REST;
            move |x| Mains::Hz50.apply(&mut state, x)
        });
        stage("noise of idsp's dither");
        let idsp_dither = measure(twin, peer::<DirectForm1Dither>);
        stage("noise of idsp's wide");
        let idsp_wide = measure(twin, peer::<DirectForm1Wide>);
        Self {
            ours,
            idsp_dither,
            idsp_wide,
        }
    }
}

fn peer<S: Default>() -> impl FnMut(i32) -> i32
where
    Section29: SplitProcess<i32, i32, S>,
{
    let mut cascade = IdspCascade::<S>::default();
    move |x| cascade.step(0, x)
}

/// Noise of the filters that `at_rest` makes.
fn measure<F: FnMut(i32) -> i32>(twin: &Twin, at_rest: impl Fn() -> F) -> Measured {
    let spectrum = |mixture| {
        let spectra: Vec<Spectrum> = (0..ELECTRODES)
            .map(|electrode| {
                let counts = counts(mixture, electrode);
                let error = error_nv(&counts, twin.clone(), at_rest());
                Spectrum::of(&error, model::ADC_RATE_HZ.into())
            })
            .collect();
        Spectrum::mean(&spectra)
    };
    let rms = |mixture| spectrum(mixture).map_or(f64::NAN, |spectrum| spectrum.rms(BAND_HZ));
    let eeg = spectrum(EEG);
    let density = eeg.iter().flat_map(Spectrum::points);
    Measured {
        in_band: InBand {
            eeg: eeg.as_ref().map_or(f64::NAN, |eeg| eeg.rms(BAND_HZ)),
            mains: rms(MAINS),
            silence: rms(SILENCE),
        },
        density: density.map(|(hz, power)| (hz, power.sqrt())).collect(),
    }
}

/// Difference of filter and twin on the same counts, settled, nV.
fn error_nv(counts: &[i32], mut twin: Twin, mut filter: impl FnMut(i32) -> i32) -> Vec<f64> {
    let nv = f64::from(model::LSB_NV) / f64::from(1 << GUARD_BITS);
    let errors = counts.iter().map(|count| {
        let x = count << GUARD_BITS;
        (f64::from(filter(x)) - twin.step(x.into())) * nv
    });
    errors.skip(SETTLING_S * rate()).collect()
}

/// What the ADC gives of this mixture at one electrode.
fn counts(mixture: Mixture, electrode: u64) -> Vec<i32> {
    let mut random = ChaCha8Rng::seed_from_u64(electrode);
    let samples = (SETTLING_S + MEASURED_S) * rate();
    let eeg = pink(&mut random, samples);
    let phase = random.random_range(0.0..2.0 * PI);
    let sign = if electrode.is_multiple_of(2) {
        1.0
    } else {
        -1.0
    };
    let uv = eeg.iter().enumerate().map(|(n, eeg)| {
        let angle = phase + 2.0 * PI * 50.0 * real(n) / real(rate());
        sign * mixture.offset + mixture.mains * angle.sin() + mixture.eeg * eeg
    });
    #[expect(
        clippy::cast_possible_truncation,
        reason = "below 21 mV, a ninth of full scale"
    )]
    uv.map(|uv| (uv * 1000.0 / f64::from(model::LSB_NV)).round() as i32)
        .collect()
}

/// Noise of power 1/f from 0.5 Hz up, random phases, rms 1.
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
    // Fails only for lengths that the plan was not made for, and gives silence then.
    let _ = transform.process(&mut bins, &mut signal);
    let rms = (signal.iter().map(|x| x * x).sum::<f64>() / real(samples)).sqrt();
    signal.iter().map(|x| x / rms).collect()
}

fn rate() -> usize {
    model::ADC_RATE_HZ.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_every_output_to_a_count_is_heard_as_the_noise_of_rounding() {
        // The twin itself, rounded to whole counts: a filter whose noise is known.
        let twin = Twin::of_the_model().expect("the artifact");
        let mut exact = twin.clone();
        #[expect(clippy::cast_possible_truncation, reason = "an EEG of 20 mV at most")]
        let filter = move |x| {
            let steps_per_count = 1 << GUARD_BITS;
            let counts = exact.step(f64::from(x)) / f64::from(steps_per_count);
            counts.round() as i32 * steps_per_count
        };
        let error = error_nv(&counts(EEG, 0), twin, filter);
        let rms = Spectrum::of(&error, model::ADC_RATE_HZ.into()).rms(BAND_HZ);
        // LSB / sqrt(12), of which the band has 59.5 of 256 Hz.
        let expected = f64::from(model::LSB_NV) / 12.0_f64.sqrt() * (59.5_f64 / 256.0).sqrt();
        // Measured 1 % apart; white noise of 64 s gives 2 %.
        assert!(
            (rms / expected - 1.0).abs() < 0.05,
            "{rms} instead of {expected}"
        );
    }

    #[test]
    fn the_test_signal_has_its_offset_mains_and_eeg() {
        let nv = f64::from(model::LSB_NV);
        let uv: Vec<f64> = counts(EEG, 1)
            .iter()
            .map(|count| f64::from(*count) * nv / 1000.0)
            .collect();
        let mean = uv.iter().sum::<f64>() / real(uv.len());
        assert!((mean + 20_000.0).abs() < 1.0, "{mean}");
        let spectrum = Spectrum::of(&uv, model::ADC_RATE_HZ.into());
        let mains = spectrum.rms([49.5, 50.5]);
        assert!((mains - 100.0 / 2.0_f64.sqrt()).abs() < 1.0, "{mains}");
        let eeg = spectrum
            .rms([0.25, 49.0])
            .hypot(spectrum.rms([51.0, 256.0]));
        assert!((eeg - 30.0).abs() < 1.0, "{eeg}");
    }
}
