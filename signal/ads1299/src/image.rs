//! Values of all registers of a chip, to write or as read back.

use crate::error::Error;
use crate::register::{ID, ID_MASK, Register};
use crate::settings::{Channel, Input, Settings};

/// Register values of a chip, indexed by address.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Image(pub [u8; Register::COUNT]);

impl<const CHIPS: usize> Settings<CHIPS> {
    /// Returns the register values for a chip; the reset values if `chip >= CHIPS`.
    pub fn image(&self, chip: usize) -> Image {
        let mut values = Register::RESET;
        let Some(own) = self.chips.get(chip) else {
            return Image(values);
        };
        let mut set = |register: Register, value: u8| values[register.index()] = value;
        // In CONFIG1, bit 7 is always 1, and bits 4:3 are always 10. Bit 6 is 0, which selects the
        // daisy chain.
        let clock_out = u8::from(self.clock.is_internal() && chip == 0) << 5;
        set(Register::CONFIG1, 0x90 | clock_out | self.rate as u8);
        // Bits 7:5 of CONFIG2 are always 110.
        let test = self.test_signal;
        let source = u8::from(test.internal) << 4;
        let shape = (test.amplitude as u8) << 2 | test.frequency as u8;
        set(Register::CONFIG2, 0xC0 | source | shape);
        // Bits 6:5 of CONFIG3 are always 11. Bit 7 switches the reference buffer on.
        let bias = own.bias;
        let measured = own
            .channels
            .iter()
            .any(|channel| channel.input == Input::BiasMeasurement);
        let amplifier = u8::from(measured) << 4
            | u8::from(bias.internal_reference) << 3
            | u8::from(bias.on) << 2
            | u8::from(bias.lead_off) << 1;
        set(Register::CONFIG3, 0xE0 | amplifier);
        let lead_off = self.lead_off;
        let current = (lead_off.current as u8) << 2 | lead_off.frequency as u8;
        set(Register::LOFF, (lead_off.threshold as u8) << 5 | current);
        set(Register::BIAS_SENSP, bias.positive);
        set(Register::BIAS_SENSN, bias.negative);
        set(Register::LOFF_SENSP, own.lead_off_positive);
        set(Register::LOFF_SENSN, own.lead_off_negative);
        set(Register::LOFF_FLIP, own.lead_off_flip);
        set(Register::MISC1, u8::from(own.srb1) << 5);
        set(Register::CONFIG4, u8::from(lead_off.comparators) << 1);
        let first = Register::CH1SET.index();
        for (value, channel) in values[first..].iter_mut().zip(&own.channels) {
            *value = channel_set(*channel);
        }
        Image(values)
    }
}

/// Returns the value of CHnSET for the settings of a channel.
fn channel_set(channel: Channel) -> u8 {
    u8::from(!channel.on) << 7
        | (channel.gain as u8) << 4
        | u8::from(channel.srb2) << 3
        | channel.input as u8
}

/// Registers of one chip as read back, compared with the values written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReadBack {
    /// Values read back.
    pub read: Image,
    /// Registers that differ, one bit each; the bit number is the address.
    pub differing: u32,
    /// True if the ID is that of an eight-channel ADS1299.
    pub id_fits: bool,
}

impl ReadBack {
    /// Value before the first read: all registers 0, and an ID that does not fit.
    pub(crate) const NONE: Self = Self {
        read: Image([0; Register::COUNT]),
        differing: 0,
        id_fits: false,
    };

    /// Compares `read` with `written`, in the bits that a chip returns as they were written.
    pub fn new(written: &Image, read: Image) -> Self {
        let kept = Register::KEPT.iter().zip(written.0.iter().zip(&read.0));
        let differing = kept
            .enumerate()
            .filter(|(_, (mask, (wrote, read)))| (*wrote ^ *read) & **mask != 0)
            .fold(0, |bits, (address, _)| bits | 1 << address);
        Self {
            read,
            differing,
            id_fits: read.0[0] & ID_MASK == ID & ID_MASK,
        }
    }

    /// Checks that the chip is an eight-channel ADS1299 that kept all values. `chip` is the index
    /// that the error names.
    ///
    /// # Errors
    /// [`Error::WrongId`], or [`Error::NotKept`] with the first register that differs.
    pub fn check(&self, chip: u8, written: &Image) -> Result<(), Error> {
        if !self.id_fits {
            let read = self.read.0[Register::ID.index()];
            return Err(Error::WrongId { chip, read });
        }
        let Some(register) = self.first_differing() else {
            return Ok(());
        };
        Err(Error::NotKept {
            chip,
            register,
            wrote: written.0[register.index()],
            read: self.read.0[register.index()],
        })
    }

    /// Returns the first register that differs; `None` if no register differs.
    #[expect(clippy::cast_possible_truncation, reason = "at most 32")]
    pub fn first_differing(&self) -> Option<Register> {
        Register::at(self.differing.trailing_zeros() as u8)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Bias;
    use crate::settings::{LeadOff, LeadOffCurrent, LeadOffThreshold};

    #[test]
    fn the_eeg_settings_are_these_bytes() {
        let image = Settings::<2>::EEG.image(0).0;
        let expected = [
            0x3E, 0x95, 0xC0, 0xEC, 0x00, 0x60, 0x60, 0x60, 0x60, 0x60, 0x60, 0x60, 0x60, 0xFF, 0,
            0, 0, 0, 0, 0, 0x0F, 0x20, 0, 0,
        ];
        assert_eq!(image, expected);
        let second = Settings::<2>::EEG.image(1).0;
        assert_eq!(second[Register::CONFIG3.index()], 0xE0, "one bias drive");
    }

    #[test]
    fn every_field_reaches_its_bits() {
        let mut settings = Settings::<1>::EEG;
        settings.clock = crate::clock::Clock::INTERNAL;
        settings.lead_off = LeadOff {
            comparators: true,
            threshold: LeadOffThreshold::P70,
            current: LeadOffCurrent::Ua6,
            frequency: crate::settings::LeadOffFrequency::Quarter,
        };
        settings.chips[0].bias = Bias {
            lead_off: true,
            ..Bias::OFF
        };
        settings.chips[0].channels[6].input = Input::BiasMeasurement;
        settings.chips[0].channels[7].on = false;
        settings.chips[0].channels[7].srb2 = true;
        let image = settings.image(0).0;
        assert_eq!(image[Register::CONFIG1.index()], 0xB5);
        assert_eq!(image[Register::CONFIG3.index()], 0xF2);
        assert_eq!(image[Register::LOFF.index()], 0xEB);
        assert_eq!(image[Register::CONFIG4.index()], 0x02);
        assert_eq!(image[0x0C], 0xE8);
    }
}
