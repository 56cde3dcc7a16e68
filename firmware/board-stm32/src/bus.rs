//! SPI by DMA, through a buffer that the DMA can reach.

use ads1299::{Speed, TooFast};
use embassy_stm32::{
    mode::Async,
    spi::{Config, Error, MODE_1, Spi, mode::Master},
    time::Hertz,
};
use embedded_hal_async::spi::{ErrorType, SpiBus};

use crate::CHIPS;

/// Bytes of a sample.
pub const FRAME_BYTES: usize = ads1299::frame_bytes(CHIPS);

/// Fastest SCLK of an ADS1299, Hz (SBAS499C, 7.6: 50 ns with DVDD from 2.7 V).
const FASTEST_HZ: u32 = 20_000_000;

/// Fastest SCLK at which the resistors of the way back let registers be read, Hz (decision 0011).
const FASTEST_REGISTERS_HZ: u32 = 105_000;

/// The converters' SPI.
pub struct Bus {
    spi: Spi<'static, Async, Master>,
    config: Config,
    /// Where the DMA reads and writes; what callers hand over may lie where it cannot.
    buffer: &'static mut [u8; FRAME_BYTES],
}

impl Bus {
    /// What a board makes its [`Spi`] with: registers first.
    pub fn config() -> Config {
        let mut config = Config::default();
        config.mode = MODE_1;
        config.frequency = Hertz(FASTEST_REGISTERS_HZ);
        config
    }

    /// A bus with what the DMA may use.
    pub fn new(spi: Spi<'static, Async, Master>, buffer: &'static mut [u8; FRAME_BYTES]) -> Self {
        Self {
            spi,
            config: Self::config(),
            buffer,
        }
    }
}

impl ads1299::Bus for Bus {
    /// SCLK as fast as what is clocked and the divider allow.
    fn set_speed(&mut self, speed: Speed) -> Result<(), TooFast> {
        let fastest_hz = match speed {
            Speed::Registers => FASTEST_REGISTERS_HZ,
            Speed::Bursts => FASTEST_HZ,
        };
        self.config.frequency = Hertz(fastest_hz);
        let set = self.spi.set_config(&self.config);
        // Dividers round to the nearest: what comes out is checked.
        let hz = self.spi.get_current_config().frequency.0;
        if set.is_err() || hz > fastest_hz {
            return Err(TooFast { hz });
        }
        Ok(())
    }
}

impl ErrorType for Bus {
    type Error = Error;
}

impl SpiBus for Bus {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<(), Error> {
        bytes.fill(0);
        self.transfer_in_place(bytes).await
    }

    async fn write(&mut self, bytes: &[u8]) -> Result<(), Error> {
        for part in bytes.chunks(FRAME_BYTES) {
            let buffer = &mut self.buffer[..part.len()];
            buffer.copy_from_slice(part);
            self.spi.transfer_in_place(buffer).await?;
        }
        Ok(())
    }

    async fn transfer(&mut self, read: &mut [u8], write: &[u8]) -> Result<(), Error> {
        let both = read.len().min(write.len());
        read.fill(0);
        read[..both].copy_from_slice(&write[..both]);
        self.transfer_in_place(read).await?;
        self.write(&write[both..]).await
    }

    async fn transfer_in_place(&mut self, bytes: &mut [u8]) -> Result<(), Error> {
        for part in bytes.chunks_mut(FRAME_BYTES) {
            let buffer = &mut self.buffer[..part.len()];
            buffer.copy_from_slice(part);
            self.spi.transfer_in_place(buffer).await?;
            part.copy_from_slice(buffer);
        }
        Ok(())
    }

    async fn flush(&mut self) -> Result<(), Error> {
        // A transfer ends when the last bit has come back.
        Ok(())
    }
}
