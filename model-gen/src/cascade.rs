//! From a filter specification to quantised sections.

use fixed_dsp::{Coefficient, LONGEST, Section};
use num_complex::Complex64;

use crate::{
    FilterError,
    design::{BandPass, butterworth_band_pass, notch},
};

/// What to filter out at one sampling rate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilterSpec {
    /// Sampling rate in Hz.
    pub rate_hz: f64,
    /// Mains frequency in Hz, notched out.
    pub mains_hz: f64,
    /// Quality of the notch: frequency over -3 dB width. The harmonics' notches have the same, as
    /// the mains strays k times as far at its k-th multiple.
    pub notch_q: f64,
    /// Further notches, at 2, 3, .. times the mains frequency.
    pub harmonics: u32,
    /// Lower and upper -3 dB edge in Hz.
    pub band_hz: [f64; 2],
    /// Order of the band-pass per edge.
    pub order: usize,
}

/// Highest order per edge: beyond it poles crowd so closely that sections stop being sensible.
const HIGHEST_ORDER: usize = 8;

/// The cascade of a specification: notches, high-pass sections (low Q first), the mixed section if
/// the order is odd, low-pass sections (low Q first), each with gain 1 in its pass band.
///
/// This order keeps the signal large at every node and any rounding noise small; scipy's order
/// with its 0.0024 in front loses a factor of two.
///
/// # Errors
/// When an edge or the mains frequency cannot exist at this rate, a number makes no sense, there are
/// more than [`LONGEST`] sections, or one is unstable after quantisation.
pub fn cascade(spec: &FilterSpec) -> Result<Vec<Section>, FilterError> {
    check(spec)?;
    let [low, high] = spec.band_hz;
    let mut sections: Vec<Section> = (0..=spec.harmonics)
        .map(|index| spec.mains_hz * (f64::from(index) + 1.0))
        .map(|hz| notch_section(notch(hz, spec.notch_q, spec.rate_hz)))
        .collect();
    let filter = butterworth_band_pass(spec.order, low, high, spec.rate_hz);
    let pairs = pole_pairs(&filter.poles);
    if pairs.len() != spec.order {
        return Err(FilterError::Poles {
            low_hz: low,
            high_hz: high,
        });
    }
    sections.extend(band_sections(&filter, &pairs));
    for (index, section) in sections.iter().enumerate() {
        if !is_stable(section) {
            return Err(FilterError::Unstable {
                index,
                section: *section,
            });
        }
    }
    Ok(sections)
}

fn check(spec: &FilterSpec) -> Result<(), FilterError> {
    let nyquist_hz = spec.rate_hz / 2.0;
    let inside = |hz: f64| hz > 0.0 && hz < nyquist_hz;
    for (name, hz) in [
        ("mains frequency", spec.mains_hz),
        ("lower band edge", spec.band_hz[0]),
        ("upper band edge", spec.band_hz[1]),
    ] {
        if !inside(hz) {
            return Err(FilterError::OutsideNyquist {
                name,
                hz,
                nyquist_hz,
            });
        }
    }
    let highest_notch_hz = spec.mains_hz * (f64::from(spec.harmonics) + 1.0);
    if !inside(highest_notch_hz) {
        return Err(FilterError::Harmonic {
            hz: highest_notch_hz,
            harmonics: spec.harmonics,
            mains_hz: spec.mains_hz,
            nyquist_hz,
        });
    }
    if spec.band_hz[0] >= spec.band_hz[1] {
        return Err(FilterError::EmptyBand {
            low_hz: spec.band_hz[0],
            high_hz: spec.band_hz[1],
        });
    }
    if !(1..=HIGHEST_ORDER).contains(&spec.order) {
        return Err(FilterError::Order {
            order: spec.order,
            highest: HIGHEST_ORDER,
        });
    }
    let notches = usize::try_from(spec.harmonics).map_or(usize::MAX, |more| more.saturating_add(1));
    let sections = notches.saturating_add(spec.order);
    if sections > LONGEST {
        return Err(FilterError::Sections {
            harmonics: spec.harmonics,
            order: spec.order,
            sections,
            longest: LONGEST,
        });
    }
    // The widest notch's half width in radians must stay below a right angle, where its tangent
    // turns.
    let half_width = std::f64::consts::PI * highest_notch_hz / spec.rate_hz / spec.notch_q;
    if !(half_width > 0.0 && half_width < std::f64::consts::FRAC_PI_2) {
        return Err(FilterError::NotchQuality { q: spec.notch_q });
    }
    Ok(())
}

fn notch_section(notch: crate::design::Notch) -> Section {
    Section::Notch {
        turn: Coefficient::nearest(-notch.gain * notch.cosine),
        loss: Coefficient::nearest(1.0 - notch.gain),
    }
}

/// Denominator `1 - first z^-1 - second z^-2` of one section.
#[derive(Clone, Copy)]
struct Feedback {
    first: f64,
    second: f64,
}

impl Feedback {
    fn of(pair: [Complex64; 2]) -> Self {
        Self {
            first: (pair[0] + pair[1]).re,
            second: -(pair[0] * pair[1]).re,
        }
    }
}

fn band_sections(filter: &BandPass, pairs: &[[Complex64; 2]]) -> Vec<Section> {
    let half = filter.order / 2;
    let by_radius = |range: &[[Complex64; 2]]| {
        let mut sorted = range.to_vec();
        sorted.sort_by(|a, b| (a[0] * a[1]).re.total_cmp(&(b[0] * b[1]).re));
        sorted.into_iter().map(Feedback::of).collect::<Vec<_>>()
    };
    let high_pass = by_radius(&pairs[..half]);
    let mixed = by_radius(&pairs[half..pairs.len() - half]);
    let low_pass = by_radius(&pairs[pairs.len() - half..]);

    // Unit gain at DC for each low-pass; what is left of the whole gain goes to the mixed section
    // or, where there is none (even order), to the last low-pass.
    let mut low_gains: Vec<f64> = low_pass
        .iter()
        .map(|f| (1.0 - f.first - f.second) / 4.0)
        .collect();
    let rest = filter.gain / low_gains.iter().product::<f64>();
    if mixed.is_empty()
        && let Some(last) = low_gains.last_mut()
    {
        *last *= rest;
    }

    let first = |feedback: &Feedback| Coefficient::nearest(feedback.first);
    let second = |feedback: &Feedback| Coefficient::nearest(feedback.second);
    let high = high_pass.iter().map(|f| Section::HighPass {
        first: first(f),
        second: second(f),
    });
    let middle = mixed.iter().map(|f| Section::BandPass {
        gain: Coefficient::nearest(rest),
        first: first(f),
        second: second(f),
    });
    let low = low_pass
        .iter()
        .zip(&low_gains)
        .map(|(f, &gain)| Section::LowPass {
            gain: Coefficient::nearest(gain),
            first: first(f),
            second: second(f),
        });
    high.chain(middle).chain(low).collect()
}

/// Conjugate pairs by rising frequency; the real poles, which only a wide band has, pair up in the
/// middle, where the mixed section takes them.
fn pole_pairs(poles: &[Complex64]) -> Vec<[Complex64; 2]> {
    /// Imaginary parts below this are rounding noise of a real pole.
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

/// Both poles inside the unit circle, judged on the quantised coefficients.
fn is_stable(section: &Section) -> bool {
    let (a1, a2) = denominator(section);
    a2.abs() < 1.0 && a1.abs() < 1.0 + a2
}

/// `a1` and `a2` of `1 + a1 z^-1 + a2 z^-2` as quantised.
pub(crate) fn denominator(section: &Section) -> (f64, f64) {
    match *section {
        Section::Notch { turn, loss } => (-value(turn), 1.0 - 2.0 * value(loss)),
        Section::HighPass { first, second }
        | Section::BandPass { first, second, .. }
        | Section::LowPass { first, second, .. } => (-value(first), -value(second)),
    }
}

/// `b0`, `b1`, `b2` as quantised.
pub(crate) fn numerator(section: &Section) -> [f64; 3] {
    match *section {
        Section::Notch { turn, loss } => {
            let outer = 1.0 - value(loss);
            [outer, -value(turn), outer]
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
