//! Impedance of electrodes, demodulated from the samples of an excited chain.

use core::f64::consts::{PI, SQRT_2};

use crate::settings::Settings;

/// Magnitude of the excitation current, a square wave, in amperes; on a real chip it is accurate to
/// 20 % (data sheet section 7.5).
pub(crate) const AMPERES: f64 = 6e-9;

/// Amplitude of the excitation's fundamental in the samples, relative to the magnitude of the
/// square wave: `4 / pi` for the fundamental, times `(sin(pi / 4) / (pi / 4))^3`, 0.73, for the
/// chip's third-order sinc filter. The product is `64 sqrt(2) / pi^4`, 0.929.
///
/// In the samples, all odd harmonics alias to the fundamental. The third harmonic changes the
/// amplitude by up to 1.3 %, all harmonics together by up to 1.5 %, depending on the phase at which
/// the square wave changes between two samples. The data sheet does not state this phase; the
/// constant is the mean over all phases.
pub(crate) const FUNDAMENTAL: f64 = 64.0 * SQRT_2 / (PI * PI * PI * PI);

/// Number of samples ignored after a restart: the chips' filter settles in three samples, and the
/// differences need two earlier samples. It is a multiple of four, so that every measurement starts
/// at the same phase of the excitation.
const LEAD: u32 = 8;

/// Measures the impedance of `N` electrodes once a second from all samples of that second.
///
/// The excitation repeats every four samples, so its amplitude is demodulated without a table of
/// sines: `I` sums the differences `x0 - x2` and `Q` the differences `x1 - x3` over the whole
/// measurement:
///
/// ```text
/// ohms = sqrt(I^2 + Q^2) lsb / samples / (6 nA 0.929)
/// ```
///
/// The result does not depend on the phase of the excitation. The sums are coherent: the bandwidth
/// is 1 Hz, and tones at all other multiples of 1 Hz, such as harmonics of mains, add up to zero.
/// Offsets and slopes cancel in the differences. The noise of a converter at gain 24 reads as 3
/// ohms.
///
/// At 250 Hz, where a second is no multiple of four samples, a measurement takes two seconds.
///
/// # Timing
/// A sample takes two comparisons and three additions for each electrode, a measurement one integer
/// square root. The state is 17 bytes for each electrode.
///
/// ```
/// use ads1299::{ImpedanceMeter, Settings};
///
/// // 20 kOhm times 6 nA and 0.929 are 111.5 uV, 4989 counts at gain 24.
/// let mut meter = ImpedanceMeter::<1>::new(Settings::EEG);
/// let mut samples = [4989, 0, -4989, 0].into_iter().cycle();
/// let ohms = loop {
///     if let Some([ohms]) = meter.observe(&[samples.next().expect("a cycle")]) {
///         break ohms;
///     }
/// };
/// assert!(ohms.abs_diff(20_000) < 10, "{ohms}");
/// ```
#[derive(Clone, Debug)]
pub struct ImpedanceMeter<const N: usize> {
    /// Number of samples since the restart; after the first measurement, [`LEAD`] plus the number
    /// of samples of the current measurement.
    age: u32,
    /// Number of samples in a measurement.
    samples: u32,
    /// Ohms per unit of `sqrt(I^2 + Q^2)`.
    scale: f32,
    /// The newest sample with an even number and the newest one with an odd number, for each
    /// channel, in counts.
    newest: [[i32; N]; 2],
    /// Sums I and Q of each channel, in counts; they saturate.
    sums: [[i32; N]; 2],
    /// Whether a sample was at the rail in this measurement.
    at_rail: [bool; N],
}

impl<const N: usize> ImpedanceMeter<N> {
    /// Reading of an electrode that cannot be measured: above [`Self::MAX_OHMS`], or with a sample
    /// at the converter's rail. A disconnected electrode has this reading.
    pub const OPEN: u32 = u32::MAX;

    /// Largest reading except [`Self::OPEN`], in ohms. At 128 Hz the capacitance of a cable, some
    /// 100 pF, is 12 Mohm in parallel, which lowers this reading by only 0.3 %.
    pub const MAX_OHMS: u32 = 1_000_000;

    /// Creates a meter for a chain with these settings.
    pub const fn new(settings: Settings) -> Self {
        let samples = samples(settings);
        let volts = settings.gain.lsb_uv() * 1e-6 / samples as f64;
        #[expect(clippy::cast_possible_truncation, reason = "24 bits suffice")]
        let scale = (volts / (AMPERES * FUNDAMENTAL)) as f32;
        Self { age: 0, samples, scale, newest: [[0; N]; 2], sums: [[0; N]; 2], at_rail: [false; N] }
    }

    /// Restarts the measurement. Call this at a sample without excitation and at missing samples.
    pub const fn restart(&mut self) {
        self.age = 0;
        self.sums = [[0; N]; 2];
        self.at_rail = [false; N];
    }

    /// Returns the number of samples of a measurement.
    pub const fn samples(&self) -> u32 {
        self.samples
    }

    /// Adds a sample: one count for each electrode, |count| <= 2^23. If the sample is the last of a
    /// measurement, returns the impedances in ohms: at most [`Self::MAX_OHMS`], or [`Self::OPEN`].
    pub fn observe(&mut self, counts: &[i32]) -> Option<[u32; N]> {
        let (parity, is_second) = (self.age as usize & 1, self.age & 2 != 0);
        let is_measured = self.age >= LEAD;
        self.age += 1;
        let sums = self.sums[parity].iter_mut().zip(&mut self.at_rail);
        let channels = self.newest[parity].iter_mut().zip(sums);
        for ((newest, (sum, at_rail)), &count) in channels.zip(counts) {
            let difference = if is_second { *newest - count } else { count - *newest };
            *newest = count;
            if is_measured {
                *sum = sum.saturating_add(difference);
                *at_rail |= count >= MAX_COUNT || count <= -MAX_COUNT;
            }
        }
        if self.age < LEAD + self.samples {
            return None;
        }
        let ohms = core::array::from_fn(|channel| self.ohms(channel));
        self.restart();
        self.age = LEAD;
        Some(ohms)
    }

    /// Returns the impedance of an electrode from the sums of a complete measurement.
    #[expect(
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "24 bits suffice, and the conversion to u32 saturates"
    )]
    fn ohms(&self, channel: usize) -> u32 {
        let [i, q] = [0, 1].map(|part: usize| u64::from(self.sums[part][channel].unsigned_abs()));
        // |I| and |Q| <= 2^31, so the sum of their squares is at most 2^63.
        let ohms = (i * i + q * q).isqrt() as f32 * self.scale;
        if self.at_rail[channel] || ohms > Self::MAX_OHMS as f32 {
            return Self::OPEN;
        }
        (ohms + 0.5) as u32
    }
}

/// Largest positive count; the rails are this count and -2^23.
const MAX_COUNT: i32 = (1 << 23) - 1;

/// Returns the number of samples in a measurement: the samples of one second, or of two seconds if
/// one second is no multiple of four samples.
const fn samples(settings: Settings) -> u32 {
    let hz = settings.rate.millihertz(settings.clock) / 1000;
    if hz.is_multiple_of(4) { hz } else { 2 * hz }
}
