//! Designs the filter cascade of a specification: first the zeros, poles and gains of band-pass and
//! notches, then second-order sections with quantised coefficients.

use std::f64::consts::{FRAC_PI_2, PI};

use fixed_dsp::{Coefficient, MAX_SECTIONS, Section};
use num_complex::Complex64;

use crate::error::FilterError;

/// Specification of the filters (notches and band-pass) at one sampling rate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilterSpec {
    /// Sampling rate of the input, Hz.
    pub rate_hz: f64,
    /// Mains frequency, at which a notch is placed, Hz.
    pub mains_hz: f64,
    /// Quality factor of every notch: its centre frequency divided by its -3 dB width. All notches
    /// have the same quality factor, so the k-th notch is k times as wide: if the mains frequency
    /// drifts, the k-th harmonic drifts k times as far.
    pub notch_q: f64,
    /// Number of notches above the mains frequency: at 2, 3, .. times the mains frequency.
    pub harmonics: u32,
    /// Lower and upper -3 dB edge of the band-pass, Hz.
    pub band_hz: [f64; 2],
    /// Order of the band-pass at each of its two edges; the band-pass has as many sections.
    pub order: usize,
}

/// Highest order of the band-pass per edge. Beyond it, poles are too close together to be
/// quantised.
pub(crate) const MAX_ORDER: usize = 8;

/// Designs the cascade of a specification: notches, high-pass sections (low Q first), one band-pass
/// section if the order is odd, low-pass sections (low Q first), each with gain 1 in its pass band.
///
/// This order of sections keeps the signal large and the rounding noise small at every node. In
/// scipy's order, the first section has the whole gain of 0.0024, which doubles the noise.
///
/// # Errors
/// If a frequency is not below half of the sampling rate, another number is out of range, there are
/// more than [`MAX_SECTIONS`] sections, or a section is unstable after quantisation.
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

    /// Returns the number of sections that the cascade of this specification has.
    pub(crate) fn sections(&self) -> usize {
        let harmonics = usize::try_from(self.harmonics).unwrap_or(usize::MAX);
        harmonics.saturating_add(1).saturating_add(self.order)
    }

    /// Returns an error if a number of the specification is out of its range.
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
        // Half the width in radians of the highest and so widest notch. It must be below pi / 2,
        // where the tangent in the notch's design changes sign.
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

/// A digital Butterworth band-pass, given by poles and gain. Half of its zeros are at z = 1 and
/// half at z = -1.
///
/// The transfer function is `gain * ((z - 1)(z + 1))^order / prod(z - pole)`.
#[derive(Clone, Debug)]
pub struct BandPass {
    /// Poles of the transfer function: `2 * order` poles inside the unit circle; complex poles are
    /// in conjugate pairs.
    pub poles: Vec<Complex64>,
    /// Constant factor `gain` of the transfer function.
    pub gain: f64,
    /// Order of the low-pass from which the band-pass is derived; the band-pass has twice as many
    /// poles.
    pub order: usize,
}

/// Designs a Butterworth band-pass of `order` (per edge) between `low_hz` and `high_hz` at
/// `rate_hz`.
///
/// The analogue low-pass prototype becomes a band-pass, and the bilinear transform with both edges
/// pre-warped makes it digital. The result is the transfer function of scipy's
/// `butter(order, [low, high], 'bandpass', fs=rate)`. Expects `0 < low_hz < high_hz < rate_hz / 2`.
pub fn butterworth_band_pass(order: usize, low_hz: f64, high_hz: f64, rate_hz: f64) -> BandPass {
    let prewarp = |hz: f64| 2.0 * rate_hz * (PI * hz / rate_hz).tan();
    let (low, high) = (prewarp(low_hz), prewarp(high_hz));
    let (width, centre_squared) = (high - low, low * high);
    let bilinear = |s: Complex64| (2.0 * rate_hz + s) / (2.0 * rate_hz - s);

    let mut poles = Vec::with_capacity(2 * order);
    // The analogue filter's gain is width^order; each of its zeros at s = 0 adds a factor 2 fs.
    let mut gain = Complex64::new((2.0 * rate_hz * width).powi(as_power(order)), 0.0);
    for k in 0..order {
        let angle = PI * real(2 * k + order + 1) / (2.0 * real(order));
        let half = Complex64::from_polar(width / 2.0, angle);
        let spread = (half * half - centre_squared).sqrt();
        for pole in [half + spread, half - spread] {
            poles.push(bilinear(pole));
            gain /= 2.0 * rate_hz - pole;
        }
    }
    BandPass { poles, gain: gain.re, order }
}

/// Designs a Butterworth band-pass of order 2 at each edge as two sections
/// `y[n] = gain (x[n] - x[n-2]) + a1 y[n-1] + a2 y[n-2]`. Returns `[gain, a1, a2]` of each section
/// in Q32. Both sections have the same gain; the first has the poles of lower frequency.
///
/// Expects `0 < low_hz < high_hz < rate_hz / 2`.
pub fn band_power_sections([low_hz, high_hz]: [f64; 2], rate_hz: f64) -> [[i64; 3]; 2] {
    let filter = butterworth_band_pass(2, low_hz, high_hz, rate_hz);
    let pairs = pole_pairs(&filter.poles);
    std::array::from_fn(|section| {
        let Feedback { a1, a2 } = Feedback::from_poles(pairs[section]);
        [filter.gain.sqrt(), a1, a2].map(|value| Coefficient::nearest(value).to_q32())
    })
}

/// A second-order notch: its transfer function has the numerator `gain [1, cosine, 1]` and the
/// denominator `[1, gain cosine, 2 gain - 1]`, as coefficients of z^0, z^-1 and z^-2.
#[derive(Clone, Copy, Debug)]
pub struct Notch {
    /// Factor of the numerator, `1 / (1 + tan(w0 / 2Q))`, with w0 the notch's angular frequency.
    pub gain: f64,
    /// Middle coefficient of the numerator, `-2 cos(w0)`, before it is multiplied by `gain`.
    pub cosine: f64,
}

/// Designs a notch at `frequency_hz` with quality factor `q` (frequency divided by -3 dB width),
/// like scipy's `iirnotch(frequency, q, fs=rate)`.
///
/// Expects `0 < frequency_hz < rate_hz / 2` and `q > 0`.
pub fn notch(frequency_hz: f64, q: f64, rate_hz: f64) -> Notch {
    let w0 = 2.0 * PI * frequency_hz / rate_hz;
    Notch { gain: 1.0 / (1.0 + (w0 / (2.0 * q)).tan()), cosine: -2.0 * w0.cos() }
}

#[expect(clippy::cast_precision_loss, reason = "filter orders are below 100")]
fn real(count: usize) -> f64 {
    count as f64
}

#[expect(clippy::cast_possible_truncation, clippy::cast_possible_wrap, reason = "order < 100")]
fn as_power(order: usize) -> i32 {
    order as i32
}

fn notch_section(notch: Notch) -> Section {
    Section::Notch {
        a1: Coefficient::nearest(-notch.gain * notch.cosine),
        one_minus_b0: Coefficient::nearest(1.0 - notch.gain),
    }
}

/// Denominator `1 - a1 z^-1 - a2 z^-2` of one section's transfer function, with the sign convention
/// of [`Section`].
#[derive(Clone, Copy)]
struct Feedback {
    a1: f64,
    a2: f64,
}

impl Feedback {
    fn from_poles(pair: [Complex64; 2]) -> Self {
        Self { a1: (pair[0] + pair[1]).re, a2: -(pair[0] * pair[1]).re }
    }
}

/// Returns the sections of the band-pass `filter`; `pairs` are its pairs of poles, sorted by
/// frequency.
fn band_sections(filter: &BandPass, pairs: &[[Complex64; 2]]) -> Vec<Section> {
    let half = filter.order / 2;
    let by_radius = |range: &[[Complex64; 2]]| {
        let mut sorted = range.to_vec();
        sorted.sort_by(|a, b| (a[0] * a[1]).re.total_cmp(&(b[0] * b[1]).re));
        sorted.into_iter().map(Feedback::from_poles).collect::<Vec<_>>()
    };
    let high_pass = by_radius(&pairs[..half]);
    let mixed = by_radius(&pairs[half..pairs.len() - half]);
    let low_pass = by_radius(&pairs[pairs.len() - half..]);

    // Each low-pass section gets gain 1 at DC. The rest of the total gain goes to the band-pass
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
    let high = high_pass.iter().map(|f| Section::HighPass { a1: a1(f), a2: a2(f) });
    let middle = mixed.iter().map(|f| Section::BandPass {
        gain: Coefficient::nearest(rest),
        a1: a1(f),
        a2: a2(f),
    });
    let low = low_pass.iter().zip(&low_gains).map(|(f, &gain)| Section::LowPass {
        gain: Coefficient::nearest(gain),
        a1: a1(f),
        a2: a2(f),
    });
    high.chain(middle).chain(low).collect()
}

/// Returns the poles in conjugate pairs, sorted by frequency. A wide band has two real poles; they
/// form the pair in the middle, which becomes the band-pass section.
fn pole_pairs(poles: &[Complex64]) -> Vec<[Complex64; 2]> {
    /// Largest imaginary part of a pole that counts as real; rounding leaves such small parts.
    const REAL_POLE: f64 = 1e-9;
    let mut upper: Vec<Complex64> = poles.iter().copied().filter(|p| p.im > REAL_POLE).collect();
    upper.sort_by(|a, b| a.arg().total_cmp(&b.arg()));
    let real: Vec<Complex64> = poles.iter().copied().filter(|p| p.im.abs() <= REAL_POLE).collect();
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

/// Returns the numerator `b0 + b1 z^-1 + b2 z^-2` of the quantised section as `[b0, b1, b2]`.
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
