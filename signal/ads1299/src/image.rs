//! Values of all registers of a chip, to be written or as read back.

use crate::decoder::CHANNELS;
use crate::error::Error;
use crate::register::{ID, ID_MASK, Register};
use crate::settings::{Input, Settings, Wiring};

/// Value of LOFF with excitation: a square wave of 6 nA (ILEAD_OFF 00) at a quarter of the sample
/// rate (FLEAD_OFF 11, data sheet section 9.6.1.5).
pub(crate) const LOFF_EXCITATION: u8 = 0b0000_0011;

/// Register values of a chip, indexed by address.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Image(pub [u8; Register::COUNT]);

impl Settings {
    /// Returns the register values for the chip with the index `chip`.
    pub fn image(self, chip: usize) -> Image {
        let mut values = Register::RESET;
        let mut set = |register: Register, value: u8| values[register.index()] = value;
        let is_eeg = self.input == Input::Electrodes;
        // In CONFIG1, bit 7 is always 1, and bits 4:3 are always 10. Bit 6 is 0 for the daisy chain
        // and 1 for chips that are read one by one.
        let is_cascaded = self.wiring == Wiring::Cascaded;
        set(Register::CONFIG1, 0x90 | u8::from(is_cascaded) << 6 | self.rate as u8);
        // Bits 7:5 of CONFIG2 are always 110. Bit 4 switches the internal test signal on. Bits 2:0
        // select the signal's amplitude and frequency: 0 is VREF / 2400 and a period of 2^21 clock
        // cycles.
        set(Register::CONFIG2, 0xC0 | u8::from(!is_eeg) << 4);
        // Bits 6:5 of CONFIG3 are always 11. Bit 7 switches the reference buffer on, bit 3 the
        // internal reference of the bias amplifier, and bit 2 the bias amplifier.
        let has_bias = chip == 0;
        set(Register::CONFIG3, if has_bias { 0xEC } else { 0xE0 });
        set(Register::BIAS_SENSP, all_inputs(has_bias));
        let excited = self.excited_channels();
        if is_eeg && excited > 0 {
            // Number of electrodes at this chip and at the chips after it.
            let electrodes = usize::from(excited).saturating_sub(CHANNELS * chip);
            let spare = CHANNELS.saturating_sub(electrodes);
            set(Register::LOFF, LOFF_EXCITATION);
            set(Register::LOFF_SENSP, lowest_inputs(CHANNELS - spare));
        } else {
            set(Register::LOFF_SENSP, all_inputs(self.lead_off && is_eeg));
        }
        set(Register::MISC1, u8::from(is_eeg) << 5);
        set(Register::CONFIG4, u8::from(self.lead_off) << 1);
        let channel = (self.gain as u8) << 4 | self.input as u8;
        values[Register::CH1SET.index()..][..CHANNELS].fill(channel);
        Image(values)
    }
}

/// Returns the value of a register with one bit per input: all ones if `on` is true, else 0.
const fn all_inputs(on: bool) -> u8 {
    if on { u8::MAX } else { 0 }
}

/// Returns the value of a register with one bit per input: ones for the first `inputs`, at most 8.
#[expect(clippy::cast_possible_truncation, reason = "the lowest 8 bits")]
const fn lowest_inputs(inputs: usize) -> u8 {
    ((1_u32 << inputs) - 1) as u8
}

/// Registers of one chip as read back, compared with the values written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReadBack {
    /// Register values read back from the chip.
    pub read: Image,
    /// Registers that differ, one bit each; the bit number is the address.
    pub differing: u32,
    /// True if the chip has the ID of an eight-channel ADS1299.
    pub id_fits: bool,
}

impl ReadBack {
    /// Value before the first read: all registers 0, and an ID that does not fit.
    pub(crate) const NONE: Self =
        Self { read: Image([0; Register::COUNT]), differing: 0, id_fits: false };

    /// Compares `read` with `written`, except for bits that a chip does not return as written.
    pub fn new(written: &Image, read: Image) -> Self {
        let kept = Register::KEPT.iter().zip(written.0.iter().zip(&read.0));
        let differing = kept
            .enumerate()
            .filter(|(_, (mask, (wrote, read)))| (*wrote ^ *read) & **mask != 0)
            .fold(0, |bits, (address, _)| bits | 1 << address);
        Self { read, differing, id_fits: read.0[0] & ID_MASK == ID & ID_MASK }
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

    #[test]
    fn the_eeg_settings_are_these_bytes() {
        let image = Settings::EEG.image(0).0;
        let expected = [
            0x3E, 0x95, 0xC0, 0xEC, 0x00, 0x60, 0x60, 0x60, 0x60, 0x60, 0x60, 0x60, 0x60, 0xFF, 0,
            0, 0, 0, 0, 0, 0x0F, 0x20, 0, 0,
        ];
        assert_eq!(image, expected);
        let second = Settings::EEG.image(1).0;
        assert_eq!(second[Register::CONFIG3.index()], 0xE0, "one bias drive");
        let cascaded = Settings { wiring: Wiring::Cascaded, ..Settings::EEG };
        assert_eq!(cascaded.image(0).0[Register::CONFIG1.index()], 0xD5);
    }

    #[test]
    fn input_and_lead_off_detection_reach_their_bits() {
        let registers = [
            Register::CONFIG2,
            Register::CH1SET,
            Register::LOFF_SENSP,
            Register::MISC1,
            Register::CONFIG4,
        ];
        for (input, expected) in [
            (Input::Electrodes, [0xC0, 0x60, 0xFF, 0x20, 2]),
            (Input::Shorted, [0xD0, 0x61, 0, 0, 2]),
            (Input::TestSignal, [0xD0, 0x65, 0, 0, 2]),
        ] {
            let settings = Settings { input, lead_off: true, ..Settings::EEG };
            let image = settings.image(1).0;
            let found = registers.map(|register| image[register.index()]);
            assert_eq!(found, expected, "{input:?}");
        }
    }

    #[test]
    fn excitation_replaces_the_direct_current_and_spares_channels_without_an_electrode() {
        let registers = [Register::LOFF, Register::LOFF_SENSP];
        let found = |input, chip| {
            let settings = Settings { input, lead_off: true, excited: 13, ..Settings::EEG };
            registers.map(|register| settings.image(chip).0[register.index()])
        };
        assert_eq!(found(Input::Electrodes, 0), [3, 0xFF]);
        assert_eq!(found(Input::Electrodes, 1), [3, 0x1F]);
        assert_eq!(found(Input::Shorted, 0), [0, 0]);
        assert_eq!(found(Input::Electrodes, 2), [3, 0]);
    }
}
