//! SPI bus and delays for the driver of the converters.

use ads1299::{Speed, TooFast, Wiring};
use device::CONVERTER_SETTINGS;
use embassy_stm32::gpio::{self, Pull};
use embassy_stm32::mode::Async;
use embassy_stm32::spi::mode::Master;
use embassy_stm32::spi::{Config, Error, MODE_1, Spi};
use embassy_stm32::time::Hertz;
use embassy_time::{Duration, Timer, block_for};
use embedded_hal_async::delay::DelayNs;
use embedded_hal_async::spi::{ErrorType, SpiBus};

/// Number of bytes that the whole chain of converters sends per sample, status words included.
pub const FRAME_BYTES: usize = ads1299::frame_bytes(device::CHIPS);

/// Fastest SCLK of an ADS1299, Hz (data sheet SBAS499C, section 7.6: a period of 50 ns with DVDD
/// from 2.7 V).
const FASTEST_HZ: u32 = 20_000_000;

/// Fastest SCLK at which registers can be read through the series resistors at DOUT, Hz
/// (docs/decisions/0011-daisy-chain-with-read-back.md).
const FASTEST_REGISTERS_HZ: u32 = 105_000;

/// SPI bus of the converters. It copies every transfer through a buffer that the DMA can access.
pub struct Bus {
    spi: Spi<'static, Async, Master>,
    config: Config,
    /// Memory that the DMA reads and writes instead of a caller's buffer, which can be in memory
    /// that the DMA cannot access.
    buffer: &'static mut [u8; FRAME_BYTES],
}

impl Bus {
    /// Returns the configuration with which a board creates its [`Spi`]: SPI mode 1, and SCLK at
    /// the frequency for register transfers. The edges of SCLK and MOSI are no faster than 20 MHz
    /// needs, so that they ring less on wires. A pull-up on MISO makes all bits 1 if there is no
    /// chip. A daisy chain has no pull-up, because it would form a voltage divider with the
    /// read-back resistors.
    pub fn config() -> Config {
        let has_resistors = device::CHIPS > 1 && CONVERTER_SETTINGS.wiring == Wiring::Daisy;
        let mut config = Config::default();
        config.mode = MODE_1;
        config.frequency = Hertz(FASTEST_REGISTERS_HZ);
        config.gpio_speed = gpio::Speed::Medium;
        config.miso_pull = if has_resistors { Pull::None } else { Pull::Up };
        config
    }

    /// Wraps an SPI that was created with [`Self::config`]; `buffer` must be in memory that the
    /// SPI's DMA can access.
    pub fn new(spi: Spi<'static, Async, Master>, buffer: &'static mut [u8; FRAME_BYTES]) -> Self {
        Self { spi, config: Self::config(), buffer }
    }
}

impl ads1299::Bus for Bus {
    /// Sets the SCLK that is nearest to the limit for transfers of the kind `speed`. Fails if that
    /// SCLK is above the limit.
    fn set_speed(&mut self, speed: Speed) -> Result<(), TooFast> {
        let fastest_hz = match speed {
            Speed::Registers => FASTEST_REGISTERS_HZ,
            Speed::Bursts => FASTEST_HZ,
        };
        self.config.frequency = Hertz(fastest_hz);
        let set = self.spi.set_config(&self.config);
        // The HAL rounds to the nearest divider, so the frequency can exceed the limit: check it.
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
        // A transfer completes only when its last bit has been received, so nothing is left to
        // flush.
        Ok(())
    }
}

/// Longest delay for which the core waits in a loop, microseconds. For such a short delay, setting
/// an alarm would take about as long as the delay.
const SHORT_US: u32 = 10;

/// Delays that are at least as long as requested.
pub(crate) struct Delay;

impl DelayNs for Delay {
    async fn delay_ns(&mut self, ns: u32) {
        self.delay_us(ns.div_ceil(1_000)).await;
    }

    async fn delay_us(&mut self, us: u32) {
        // Add one microsecond: the current microsecond has partly passed, so the delay could
        // otherwise be too short.
        let wait = Duration::from_micros(u64::from(us) + 1);
        if us <= SHORT_US {
            block_for(wait);
        } else {
            Timer::after(wait).await;
        }
    }
}
