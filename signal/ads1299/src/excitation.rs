//! Excitation: the alternating lead-off current from which the impedance of electrodes is measured.

use embedded_hal::digital::OutputPin;
use embedded_hal_async::delay::DelayNs;

use crate::bus::Bus;
use crate::chain::{Chain, opcode};
use crate::error::Error;
use crate::register::Register;
use crate::sampler::Sampler;
use crate::settings::{Settings, Wiring};

impl Settings {
    /// Returns the number of bytes that switch on the excitation of `chips` chips: SDATAC, RDATAC
    /// and two register writes, once for a daisy chain or for each cascaded chip, and one more
    /// register write for each chip whose LOFF_SENSP differs from that of chip 0.
    pub(crate) fn excitation_bytes(self, chips: usize) -> usize {
        let mask = |chip| self.image(chip).0[Register::LOFF_SENSP.index()];
        let others = (1..chips).filter(|chip| mask(*chip) != mask(0)).count();
        let commands = match self.wiring {
            Wiring::Daisy => 8,
            Wiring::Cascaded => 8 * chips,
        };
        commands + 3 * others
    }
}

impl<Spi: Bus, Line: OutputPin, Delay: DelayNs, const CHIPS: usize> Chain<Spi, Line, Delay, CHIPS> {
    /// Writes the registers of the excitation while the chips convert: SDATAC, WREG, RDATAC. Only
    /// samples that end during the writes are lost: the filters do not restart, because CONFIG1
    /// keeps its value. SCLK stays at the frequency of bursts, which is not too fast for writes.
    async fn write_excitation(&mut self, settings: Settings) -> Result<(), Error> {
        self.command_all(opcode::SDATAC, settings).await?;
        let written = self.write_excitation_registers(settings).await;
        // Send RDATAC after a failure too, so that the chips send samples again.
        written.and(self.command_all(opcode::RDATAC, settings).await)
    }

    async fn write_excitation_registers(&mut self, settings: Settings) -> Result<(), Error> {
        let first = settings.image(0).0;
        for register in [Register::LOFF, Register::LOFF_SENSP] {
            let bytes = [opcode::WREG | register.address(), 0, first[register.index()]];
            self.send_all(&bytes, settings).await?;
        }
        // Chips with spare channels need their own value of LOFF_SENSP.
        for chip in 1..CHIPS {
            let mask = settings.image(chip).0[Register::LOFF_SENSP.index()];
            if mask != first[Register::LOFF_SENSP.index()] {
                self.write_registers(chip, Register::LOFF_SENSP, &[mask]).await?;
            }
        }
        Ok(())
    }
}

impl<Spi: Bus, Line: OutputPin, Delay: DelayNs, const CHIPS: usize, const BYTES: usize>
    Sampler<Spi, Line, Delay, CHIPS, BYTES>
{
    /// Sets [`Settings::excited`], also while the chain converts.
    ///
    /// Registers are not read back, because this would take longer than a sample. If a chip ignores
    /// the command, its electrodes read nearly 0 ohms.
    ///
    /// # Errors
    /// The bus or a pin fails. Some chips may be excited by then, so all channels count as excited
    /// until a later call succeeds.
    ///
    /// # Timing
    /// Call it between two samples, with enough time before the next sample to write the registers.
    pub async fn set_excitation(&mut self, channels: u8) -> Result<(), Error> {
        let settings = Settings { excited: channels, ..self.settings };
        let written =
            if self.is_running() { self.chain.write_excitation(settings).await } else { Ok(()) };
        self.settings = settings;
        if written.is_err() {
            self.settings.excited = u8::MAX;
        }
        written
    }
}
