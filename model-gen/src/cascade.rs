//! Designs the quantised sections of a filter specification.

use std::f64::consts::{FRAC_PI_2, PI};

use fixed_dsp::{Coefficient, MAX_SECTIONS, Section};
use num_complex::Complex64;

use crate::{
    design::{BandPass, Notch, butterworth_band_pass, notch},
    error::FilterError,
};

/// Specification of the filters at one sampling rate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilterSpec {
    /// Sampling rate of the input, Hz.
    pub rate_hz: f64,
    /// Mains frequency in Hz, removed by a notch.
    pub mains_hz: f64,
    /// Quality factor of every notch: its frequency divided by its -3 dB width. Harmonics have the
    /// same factor: if the mains frequency deviates, its k-th harmonic deviates k times as far.
    pub notch_q: f64,
    /// Number of notches at harmonics: at 2, 3, .. times the mains frequency.
    pub harmonics: u32,
    /// Lower and upper -3 dB edge of the band-pass, Hz.
    pub band_hz: [f64; 2],
    /// Order of the band-pass per edge; the band-pass has as many sections.
    pub order: usize,
}

/// Highest order per edge; at higher orders, poles are too close together for quantised sections.
pub(crate) const MAX_ORDER: usize = 8;

/// Designs the cascade of a specification: notches, high-pass sections (low Q first), one band-pass
/// section if the order is odd, low-pass sections (low Q first), each with gain 1 in its pass band.
///
/// This order keeps the signal large and the rounding noise small at every node. scipy's order,
/// whose first section has the whole gain of 0.0024, doubles the noise.
///
/// # Errors
/// If a frequency is not below half of the sampling rate, another number is out of range, there are
/// more than [`MAX_SECTIONS`] sections, or one is unstable after quantisation.
pub fn cascade(spec: &FilterSpec) -> Result<Vec<Section>, FilterError> {
    spec.check()?;
    let [low, high] = spec.band_hz;
    let mut sections: Vec<Section> = (0..=spec.harmonics)
        .map(|index| spec.mains_hz * (f64::from(index) + 1.0))
        .map(|hz| notch_section(notch(hz, spec.notch_q, spec.rate_hz)))
        .collect();
    let filter = butterworth_band_pass(spec.order, low, high, spec.rate_hz);
    let pairs = pole_pairs(&filter.poles);
    if pairs.len() != spec.order {
        return Err(FilterError::Poles(*spec));
    }
    sections.extend(band_sections(&filter, &pairs));
    match sections.iter().position(|section| !is_stable(section)) {
        Some(index) => Err(FilterError::Unstable(index)),
        None => Ok(sections),
    }
}

impl FilterSpec {
    /// Returns half of the sampling rate, Hz: the upper limit of every frequency.
    pub(crate) fn nyquist_hz(&self) -> f64 {
        self.rate_hz / 2.0
    }

    /// Returns the frequency of the highest notch, Hz.
    pub(crate) fn highest_notch_hz(&self) -> f64 {
        self.mains_hz * (f64::from(self.harmonics) + 1.0)
    }

    /// Returns the number of sections of the cascade.
    pub(crate) fn sections(&self) -> usize {
        let harmonics = usize::try_from(self.harmonics).unwrap_or(usize::MAX);
        harmonics.saturating_add(1).saturating_add(self.order)
    }

    /// Returns an error if a number is out of range.
    fn check(&self) -> Result<(), FilterError> {
        let inside = |hz: f64| hz > 0.0 && hz < self.nyquist_hz();
        for (name, hz) in [
            ("mains frequency", self.mains_hz),
            ("lower band edge", self.band_hz[0]),
            ("upper band edge", self.band_hz[1]),
        ] {
            if !inside(hz) {
                return Err(FilterError::OutsideNyquist(name, hz, *self));
            }
        }
        // This is half the width of the widest notch, in radians. It must be below pi / 2, where
        // the tangent in the design changes sign.
        let half_width = PI * self.highest_notch_hz() / self.rate_hz / self.notch_q;
        if !inside(self.highest_notch_hz()) {
            Err(FilterError::Harmonic(*self))
        } else if self.band_hz[0] >= self.band_hz[1] {
            Err(FilterError::EmptyBand(*self))
        } else if !(1..=MAX_ORDER).contains(&self.order) {
            Err(FilterError::Order(*self))
        } else if self.sections() > MAX_SECTIONS {
            Err(FilterError::Sections(*self))
        } else if !(half_width > 0.0 && half_width < FRAC_PI_2) {
            Err(FilterError::NotchQuality(*self))
        } else {
            Ok(())
        }
    }
}

fn notch_section(notch: Notch) -> Section {
    Section::Notch {
        a1: Coefficient::nearest(-notch.gain * notch.cosine),
        one_minus_b0: Coefficient::nearest(1.0 - notch.gain),
    }
}

/// Denominator `1 - a1 z^-1 - a2 z^-2` of one section, with the signs of [`Section`].
#[derive(Clone, Copy)]
struct Feedback {
    a1: f64,
    a2: f64,
}

impl Feedback {
    fn from_poles(pair: [Complex64; 2]) -> Self {
        Self {
            a1: (pair[0] + pair[1]).re,
            a2: -(pair[0] * pair[1]).re,
        }
    }
}

/// Returns the sections of the band-pass `filter`; `pairs` are its pole pairs in order of
/// frequency.
fn band_sections(filter: &BandPass, pairs: &[[Complex64; 2]]) -> Vec<Section> {
    let half = filter.order / 2;
    let by_radius = |range: &[[Complex64; 2]]| {
        let mut sorted = range.to_vec();
        sorted.sort_by(|a, b| (a[0] * a[1]).re.total_cmp(&(b[0] * b[1]).re));
        sorted
            .into_iter()
            .map(Feedback::from_poles)
            .collect::<Vec<_>>()
    };
    let high_pass = by_radius(&pairs[..half]);
    let mixed = by_radius(&pairs[half..pairs.len() - half]);
    let low_pass = by_radius(&pairs[pairs.len() - half..]);

    // Each low-pass section has unit gain at DC. The rest of the total gain goes to the band-pass
    // section or, if the order is even, to the last low-pass section.
    let mut low_gains: Vec<f64> = low_pass.iter().map(|f| (1.0 - f.a1 - f.a2) / 4.0).collect();
    let rest = filter.gain / low_gains.iter().product::<f64>();
    if mixed.is_empty()
        && let Some(last) = low_gains.last_mut()
    {
        *last *= rest;
    }

    let a1 = |feedback: &Feedback| Coefficient::nearest(feedback.a1);
    let a2 = |feedback: &Feedback| Coefficient::nearest(feedback.a2);
    let high = high_pass.iter().map(|f| Section::HighPass {
        a1: a1(f),
        a2: a2(f),
    });
    let middle = mixed.iter().map(|f| Section::BandPass {
        gain: Coefficient::nearest(rest),
        a1: a1(f),
        a2: a2(f),
    });
    let low = low_pass
        .iter()
        .zip(&low_gains)
        .map(|(f, &gain)| Section::LowPass {
            gain: Coefficient::nearest(gain),
            a1: a1(f),
            a2: a2(f),
        });
    high.chain(middle).chain(low).collect()
}

/// Returns the poles in conjugate pairs, in order of frequency. The two real poles of a wide band
/// form the middle pair, which goes to the band-pass section.
fn pole_pairs(poles: &[Complex64]) -> Vec<[Complex64; 2]> {
    /// Largest imaginary part of a pole that counts as real; it comes from rounding.
    const REAL_POLE: f64 = 1e-9;
    let mut upper: Vec<Complex64> = poles.iter().copied().filter(|p| p.im > REAL_POLE).collect();
    upper.sort_by(|a, b| a.arg().total_cmp(&b.arg()));
    let real: Vec<Complex64> = poles
        .iter()
        .copied()
        .filter(|p| p.im.abs() <= REAL_POLE)
        .collect();
    let middle = upper.len() / 2;
    let mut pairs: Vec<_> = upper.into_iter().map(|p| [p, p.conj()]).collect();
    if let [a, b] = real[..] {
        pairs.insert(middle, [a, b]);
    }
    pairs
}

/// Returns whether both poles of the quantised section are inside the unit circle.
fn is_stable(section: &Section) -> bool {
    let (d1, d2) = denominator(section);
    d2.abs() < 1.0 && d1.abs() < 1.0 + d2
}

/// Returns `d1` and `d2` of the quantised denominator `1 + d1 z^-1 + d2 z^-2`: the negatives of
/// `a1` and `a2` of [`Section`].
pub(crate) fn denominator(section: &Section) -> (f64, f64) {
    match *section {
        Section::Notch { a1, one_minus_b0 } => (-value(a1), 1.0 - 2.0 * value(one_minus_b0)),
        Section::HighPass { a1, a2 }
        | Section::BandPass { a1, a2, .. }
        | Section::LowPass { a1, a2, .. } => (-value(a1), -value(a2)),
    }
}

/// Returns `b0`, `b1` and `b2` of the quantised section.
pub(crate) fn numerator(section: &Section) -> [f64; 3] {
    match *section {
        Section::Notch { a1, one_minus_b0 } => {
            let b0 = 1.0 - value(one_minus_b0);
            [b0, -value(a1), b0]
        }
        Section::HighPass { .. } => [1.0, -2.0, 1.0],
        Section::BandPass { gain, .. } => [value(gain), 0.0, -value(gain)],
        Section::LowPass { gain, .. } => [value(gain), 2.0 * value(gain), value(gain)],
    }
}

#[expect(clippy::cast_precision_loss, reason = "|q32| < 2^34 is exact in f64")]
fn value(coefficient: Coefficient) -> f64 {
    coefficient.to_q32() as f64 / 4_294_967_296.0
}
