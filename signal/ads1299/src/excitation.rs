//! Excitation: the alternating lead-off current from which the impedance of electrodes is measured.

use core::f64::consts::{PI, SQRT_2};

use embedded_hal::digital::OutputPin;
use embedded_hal_async::delay::DelayNs;

use crate::bus::Bus;
use crate::chain::{Chain, opcode};
use crate::error::Error;
use crate::register::Register;
use crate::sampler::Sampler;
use crate::settings::Settings;

/// Value of LOFF with excitation: a square wave of 6 nA (ILEAD_OFF 00) at a quarter of the sample
/// rate (FLEAD_OFF 11, data sheet section 9.6.1.5).
pub(crate) const LOFF: u8 = 0b0000_0011;

/// Magnitude of the square wave, in amperes. The tolerance of a real chip is 20 % (from memory).
pub(crate) const AMPERES: f64 = 6e-9;

/// Amplitude of the square wave's fundamental in the samples, relative to the square wave: `4 / pi`
/// for the fundamental, times `(sin(pi / 4) / (pi / 4))^3`, 0.73, for the chip's sinc filter of
/// third order. Together `64 sqrt(2) / pi^4`, 0.929.
///
/// Sampled, all odd harmonics fall on the fundamental. The third one changes the amplitude by up to
/// 1.3 %, all of them by up to 1.5 %, depending on when the square wave changes between two
/// samples. The data sheet does not state that phase; this is the mean over all of them.
pub(crate) const FUNDAMENTAL: f64 = 64.0 * SQRT_2 / (PI * PI * PI * PI);

impl<Spi: Bus, Line: OutputPin, Delay: DelayNs, const CHIPS: usize> Chain<Spi, Line, Delay, CHIPS> {
    /// Writes the registers of the excitation while the chips convert: SDATAC, WREG, RDATAC. Only
    /// samples that end meanwhile are lost, because CONFIG1 keeps its value and so the filters go
    /// on. SCLK stays that of bursts, which writes permit.
    async fn write_excitation(&mut self, settings: Settings) -> Result<(), Error> {
        self.command_all(opcode::SDATAC).await?;
        let written = self.write_excitation_registers(settings).await;
        // The chips must send samples again after a failure too.
        written.and(self.command_all(opcode::RDATAC).await)
    }

    async fn write_excitation_registers(&mut self, settings: Settings) -> Result<(), Error> {
        let first = settings.image(0).0;
        for register in [Register::LOFF, Register::LOFF_SENSP] {
            let bytes = [
                opcode::WREG | register.address(),
                0,
                first[register.index()],
            ];
            self.exchange(0..CHIPS, &bytes, &mut []).await?;
        }
        // Chips with channels that have no electrode get a mask of their own.
        for chip in 1..CHIPS {
            let mask = settings.image(chip).0[Register::LOFF_SENSP.index()];
            if mask != first[Register::LOFF_SENSP.index()] {
                self.write_registers(chip, Register::LOFF_SENSP, &[mask])
                    .await?;
            }
        }
        Ok(())
    }
}

impl<Spi: Bus, Line: OutputPin, Delay: DelayNs, const CHIPS: usize, const BYTES: usize>
    Sampler<Spi, Line, Delay, CHIPS, BYTES>
{
    /// Sets [`Settings::excitation`], also in a chain that converts.
    ///
    /// Registers are not read back, which would take longer than a sample: a chip that ignores the
    /// command shows electrodes without impedance.
    ///
    /// # Errors
    /// The bus or a pin fails; the settings then stay as they are.
    ///
    /// # Timing
    /// Call it between two samples. It clocks 14 bytes at most for a chain of whole chips and one
    /// with spare channels, with four clock cycles after each: 0.05 ms at 12.8 MHz.
    pub async fn set_excitation(&mut self, channels: u64) -> Result<(), Error> {
        let settings = Settings {
            excitation: channels,
            ..self.settings
        };
        if self.is_running() {
            self.chain.write_excitation(settings).await?;
        }
        self.settings = settings;
        Ok(())
    }
}
