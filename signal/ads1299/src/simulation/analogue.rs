//! Analogue part of a simulated chip: from the inputs to counts.

use crate::decoder::CHANNELS;
use crate::limits::typical_noise_uv;
use crate::register::Register;
use crate::settings::{Gain, Input, Rate, TestAmplitude, VREF};
use crate::simulation::chip::Chip;

/// Signal at the electrodes of a channel.
#[derive(Clone, Copy, Debug)]
pub(super) enum Electrode {
    /// Differential voltage of the channel's inputs, in volts.
    Volts(f64),
    /// Counts that the channel must return, whatever its gain.
    Counts(i32),
}

/// Disconnected electrodes of a chip: positive and negative, one bit per channel.
pub(super) type Off = [u8; 2];

/// Time and rate of a conversion.
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

/// Returns whether a channel converts its electrodes.
pub(super) fn converts_electrodes(chip: &Chip, channel: usize) -> bool {
    channel_set(chip, channel) & 0x87 == Input::Electrodes as u8
}

/// Returns the lead-off status: disconnected electrodes with a lead-off current; 0 while the
/// comparators are off.
pub(super) fn lead_off(chip: &Chip, off: Off) -> [u8; 2] {
    let comparators = chip.register(Register::CONFIG4) & 2 != 0;
    let lost = without_contact(chip, off);
    lost.map(|bits| if comparators { bits } else { 0 })
}

/// Returns the counts of a sample, clipped to 24 bits.
pub(super) fn convert(
    chip: &Chip,
    electrodes: &[Electrode; CHANNELS],
    off: Off,
    conversion: Conversion,
    noise: &mut Noise,
) -> [i32; CHANNELS] {
    let [positive, negative] = without_contact(chip, off);
    let flipped = chip.register(Register::LOFF_FLIP);
    let reference = chip.reference(conversion.now_ns);
    core::array::from_fn(|channel| {
        let set = channel_set(chip, channel);
        if set & 0x80 != 0 {
            return 0;
        }
        // Gain code 7 is reserved; it is treated as gain 24.
        let gain = Gain::ALL.get(usize::from(set >> 4 & 7));
        let gain = gain.copied().unwrap_or(Gain::X24);
        let mut volts = match Input::ALL[usize::from(set & 7)] {
            // The lead-off current drives an open input to one rail, a reversed current to the
            // other rail.
            Input::Electrodes if (positive | negative) >> channel & 1 != 0 => {
                let up = flipped >> channel & 1 == 0;
                if up { VREF } else { -VREF }
            }
            Input::Electrodes => match electrodes[channel] {
                Electrode::Volts(volts) => volts,
                // The counts are exact once the reference has settled, because `reference` is then
                // 1.
                Electrode::Counts(counts) => return clip(f64::from(counts) / reference),
            },
            Input::TestSignal => test_signal(chip, conversion) * VREF * reference,
            Input::Temperature => 0.1453,
            // Other inputs are not modelled; they are treated as shorted.
            _ => 0.0,
        };
        volts += noise.next() * 1e-6 * f64::from(typical_noise_uv(gain, conversion.rate));
        clip(volts * f64::from(gain.factor()) / (VREF * reference) * f64::from(1 << 23))
    })
}

/// Returns the disconnected electrodes that have a lead-off current.
fn without_contact(chip: &Chip, [positive, negative]: Off) -> [u8; 2] {
    [
        positive & chip.register(Register::LOFF_SENSP),
        negative & chip.register(Register::LOFF_SENSN),
    ]
}

fn channel_set(chip: &Chip, channel: usize) -> u8 {
    let first = Register::CH1SET.address();
    let address = u8::try_from(channel).map(|channel| first + channel);
    let register = address.ok().and_then(Register::at);
    register.map_or(0, |register| chip.register(register))
}

/// Rounds to a count and clips to 24 bits. NaN, the quotient of 0 V and a reference that is off,
/// becomes 0.
#[expect(clippy::cast_possible_truncation, reason = "clamped to 24 bits")]
fn clip(counts: f64) -> i32 {
    counts.round().clamp(-8_388_608.0, 8_388_607.0) as i32
}

/// Returns the internal square wave after the third-order sinc filter, as a fraction of VREF; 0 if
/// the test signal is external.
#[expect(clippy::cast_precision_loss, reason = "less than 2^21")]
fn test_signal(chip: &Chip, conversion: Conversion) -> f64 {
    let config2 = chip.register(Register::CONFIG2);
    if config2 & 0x10 == 0 {
        return 0.0;
    }
    let double = config2 & 4 != 0;
    let amplitude = if double {
        TestAmplitude::Double
    } else {
        TestAmplitude::Single
    };
    let amplitude = amplitude.uv() * 1e-6 / VREF;
    let half = match config2 & 3 {
        0 => 1_u64 << 20,
        1 => 1 << 19,
        _ => return amplitude,
    };
    let since = (conversion.cycles % half) as f64 / f64::from(conversion.rate.divider());
    let up = (conversion.cycles / half).is_multiple_of(2);
    let swing = 2.0 * step_response(since) - 1.0;
    if up {
        amplitude * swing
    } else {
        -amplitude * swing
    }
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
