//! Excitation: the alternating lead-off current from which the impedance of electrodes is measured.

use embedded_hal::digital::OutputPin;
use embedded_hal_async::delay::DelayNs;

use crate::bus::Bus;
use crate::chain::{Chain, opcode};
use crate::error::Error;
use crate::register::Register;
use crate::sampler::Sampler;
use crate::settings::Settings;

impl<Spi: Bus, Line: OutputPin, Delay: DelayNs, const CHIPS: usize> Chain<Spi, Line, Delay, CHIPS> {
    /// Writes the registers of the excitation while the chips convert: SDATAC, WREG, RDATAC. Only
    /// samples that end meanwhile are lost, because CONFIG1 keeps its value and so the filters go
    /// on. SCLK stays that of bursts, which writes permit.
    async fn write_excitation(&mut self, settings: Settings) -> Result<(), Error> {
        self.command_all(opcode::SDATAC, settings).await?;
        let written = self.write_excitation_registers(settings).await;
        // The chips must send samples again after a failure too.
        written.and(self.command_all(opcode::RDATAC, settings).await)
    }

    async fn write_excitation_registers(&mut self, settings: Settings) -> Result<(), Error> {
        let first = settings.image(0).0;
        for register in [Register::LOFF, Register::LOFF_SENSP] {
            let bytes = [
                opcode::WREG | register.address(),
                0,
                first[register.index()],
            ];
            self.send_all(&bytes, settings).await?;
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
    /// Sets [`Settings::excited`], also in a chain that converts.
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
    pub async fn set_excitation(&mut self, channels: u8) -> Result<(), Error> {
        let settings = Settings {
            excited: channels,
            ..self.settings
        };
        if self.is_running() {
            self.chain.write_excitation(settings).await?;
        }
        self.settings = settings;
        Ok(())
    }
}
