//! Analogue part of a simulated chip: from the inputs to counts.

use crate::decoder::CHANNELS;
use crate::image::LOFF_EXCITATION;
use crate::impedance::AMPERES;
use crate::limits::typical_noise_uv;
use crate::register::Register;
use crate::settings::{Gain, Input, Rate, TEST_AMPLITUDE_UV, TEST_HALF_PERIOD, VREF};
use crate::simulation::chip::Chip;

/// Signal at the electrodes of a channel.
#[derive(Clone, Copy, Debug)]
pub(super) enum Electrode {
    /// Differential voltage of the channel's inputs, in volts.
    Volts(f64),
    /// Counts that the channel must return, whatever its gain.
    Counts(i32),
}

/// Contacts of a chip's electrodes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Contacts {
    /// Positive inputs whose electrode is disconnected, one bit each.
    pub(super) off: u8,
    /// Impedance of the electrode at each positive input, in ohms.
    pub(super) ohms: [f64; CHANNELS],
}

impl Contacts {
    /// Contacts without impedance.
    pub(super) const IDEAL: Self = Self { off: 0, ohms: [0.0; CHANNELS] };
}

/// Time at which a conversion ends, and the sample rate.
#[derive(Clone, Copy, Debug)]
pub(super) struct Conversion {
    pub(super) now_ns: u64,
    /// Time since the board was created, in clock cycles.
    pub(super) cycles: u64,
    pub(super) rate: Rate,
}

/// Returns the rate that CONFIG1 selects; the reserved code is treated as the slowest rate.
pub(super) fn rate(config1: u8) -> Rate {
    let code = usize::from(config1 & 7);
    Rate::ALL.get(code).copied().unwrap_or(Rate::Div8192)
}

/// Returns whether a channel is switched on and converts its electrodes.
pub(super) fn converts_electrodes(chip: &Chip, channel: usize) -> bool {
    channel_set(chip, channel) & 0x87 == Input::Electrodes as u8
}

/// Returns a chip's counts for one sample, clipped to 24 bits.
pub(super) fn convert(
    chip: &Chip,
    electrodes: &[Electrode; CHANNELS],
    contacts: &Contacts,
    conversion: Conversion,
    noise: &mut Noise,
) -> [i32; CHANNELS] {
    let currents = chip.register(Register::LOFF_SENSP);
    let off = contacts.off & currents;
    // `None` if there is no excitation; the lead-off current is then a direct current.
    let excitation = excitation(chip, conversion);
    let reference = chip.reference(conversion.now_ns);
    core::array::from_fn(|channel| {
        let set = channel_set(chip, channel);
        if set & 0x80 != 0 {
            return 0;
        }
        // Gain code 7 is reserved; it is treated as gain 24.
        let gain = Gain::ALL.get(usize::from(set >> 4 & 7));
        let gain = gain.copied().unwrap_or(Gain::X24);
        let input = set & 7;
        let mut volts = if input == Input::TestSignal as u8 {
            test_signal(chip, conversion) * VREF * reference
        } else if input != Input::Electrodes as u8 {
            // Inputs that the simulation lacks are treated as shorted.
            0.0
        } else if off >> channel & 1 != 0 {
            // A direct lead-off current drives an open input to one rail, an alternating current to
            // both rails in turn.
            VREF * excitation.unwrap_or(1.0)
        } else {
            let is_excited = currents >> channel & 1 != 0;
            let excitation = excitation.filter(|_| is_excited).unwrap_or(0.0);
            let excited = excitation * AMPERES * contacts.ohms[channel];
            match electrodes[channel] {
                Electrode::Volts(volts) => volts + excited,
                // The counts are exact once `reference` has settled at 1.
                Electrode::Counts(counts) => {
                    let excited = excited * f64::from(gain.factor()) / VREF * f64::from(1 << 23);
                    return clip((f64::from(counts) + excited) / reference);
                }
            }
        };
        volts += noise.next() * 1e-6 * f64::from(typical_noise_uv(gain, conversion.rate));
        clip(volts * f64::from(gain.factor()) / (VREF * reference) * f64::from(1 << 23))
    })
}

/// Returns the value of a channel's register CHnSET.
fn channel_set(chip: &Chip, channel: usize) -> u8 {
    let first = Register::CH1SET.address();
    let address = u8::try_from(channel).map(|channel| first + channel);
    let register = address.ok().and_then(Register::at);
    register.map_or(0, |register| chip.register(register))
}

/// Rounds to a count and clips to 24 bits. NaN, from 0 V and a reference that is off, becomes 0.
#[expect(clippy::cast_possible_truncation, reason = "clamped to 24 bits")]
fn clip(counts: f64) -> i32 {
    counts.round().clamp(-8_388_608.0, 8_388_607.0) as i32
}

/// Returns the internal square wave after the third-order sinc filter, as a fraction of VREF; 0 if
/// the chip does not generate it.
#[expect(clippy::cast_precision_loss, reason = "less than 2^21")]
fn test_signal(chip: &Chip, conversion: Conversion) -> f64 {
    if chip.register(Register::CONFIG2) & 0x10 == 0 {
        return 0.0;
    }
    let amplitude = TEST_AMPLITUDE_UV * 1e-6 / VREF;
    let half = u64::from(TEST_HALF_PERIOD);
    let since = (conversion.cycles % half) as f64 / f64::from(conversion.rate.divider());
    let up = (conversion.cycles / half).is_multiple_of(2);
    let swing = 2.0 * step_response(since) - 1.0;
    if up { amplitude * swing } else { -amplitude * swing }
}

/// Returns the excitation after the third-order sinc filter, as a fraction of its magnitude; `None`
/// if LOFF does not select it. The excitation repeats every four samples, at a phase that depends
/// on when the conversions were started.
#[expect(clippy::cast_precision_loss, reason = "less than 2^17")]
fn excitation(chip: &Chip, conversion: Conversion) -> Option<f64> {
    if chip.register(Register::LOFF) != LOFF_EXCITATION {
        return None;
    }
    let period = u64::from(conversion.rate.divider());
    let half = 2 * period;
    let since = (conversion.cycles % half) as f64 / period as f64;
    let up = (conversion.cycles / half).is_multiple_of(2);
    // The newest change was `since` periods ago, and the change before it two periods earlier.
    let level = 1.0 + 2.0 * step_response(since) - 2.0 * step_response(since + 2.0);
    Some(if up { level } else { -level })
}

/// Returns the step response of a third-order sinc filter, `periods` sample periods after the step.
/// It rises from 0 to 1 in three periods.
fn step_response(periods: f64) -> f64 {
    match periods {
        u if u < 1.0 => u.powi(3) / 6.0,
        u if u < 2.0 => (-2.0 * u.powi(3) + 9.0 * u.powi(2) - 9.0 * u + 3.0) / 6.0,
        u if u < 3.0 => 1.0 - (3.0 - u).powi(3) / 6.0,
        _ => 1.0,
    }
}

/// Pseudo-random Gaussian noise: the sum of twelve uniform numbers from xorshift64*.
#[derive(Clone, Debug)]
pub(super) struct Noise(u64);

impl Noise {
    pub(super) const fn new(seed: u64) -> Self {
        // The generator's state must not be 0.
        Self(seed | 1 << 63)
    }

    /// Returns the next number from a distribution with mean 0 and rms 1.
    pub(super) fn next(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }

    /// Returns the next uniform number, 0 to 1.
    fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        let bits = self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 32;
        let bits = bits as u32;
        f64::from(bits) / f64::from(u32::MAX)
    }
}
