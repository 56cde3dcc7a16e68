//! Stopped state of a chain: brought up, its registers accessible, not yet converting.

use embedded_hal::digital::OutputPin;
use embedded_hal_async::delay::DelayNs;

use crate::bus::{Bus, Speed};
use crate::chain::Chain;
use crate::error::Error;
use crate::image::ReadBack;
use crate::settings::Settings;
use crate::streaming::Streaming;

/// A chain that has been brought up and is stopped: registers can be read and written.
#[derive(Debug)]
pub struct Configured<'a, Spi, Line, Delay, const CHIPS: usize> {
    /// Wires of the chain, borrowed while it is stopped.
    pub chain: &'a mut Chain<Spi, Line, Delay, CHIPS>,
    settings: Settings<CHIPS>,
}

impl<'a, Spi: Bus, Line: OutputPin, Delay: DelayNs, const CHIPS: usize>
    Configured<'a, Spi, Line, Delay, CHIPS>
{
    pub(crate) fn new(
        chain: &'a mut Chain<Spi, Line, Delay, CHIPS>,
        settings: &Settings<CHIPS>,
    ) -> Self {
        Self {
            chain,
            settings: *settings,
        }
    }

    /// Returns the settings that were written to the chips last.
    pub const fn settings(&self) -> &Settings<CHIPS> {
        &self.settings
    }

    /// Writes new settings, whose clock must be that of the previous settings.
    ///
    /// # Errors
    /// The first register that did not keep its value, or a bus or pin that failed. After an error the
    /// chips must be configured again before they start.
    pub async fn configure(&mut self, settings: &Settings<CHIPS>) -> Result<(), Error> {
        self.settings = *settings;
        self.chain.configure(settings).await
    }

    /// Reads all registers of all chips and compares them with the settings.
    ///
    /// # Errors
    /// When the bus or a pin fails. A register that differs is not an error; the result names it.
    pub async fn read_back(&mut self) -> Result<[ReadBack; CHIPS], Error> {
        self.chain.set_speed(Speed::Registers)?;
        let mut all = [ReadBack::NONE; CHIPS];
        for (chip, back) in all.iter_mut().enumerate() {
            let written = self.settings.image(chip);
            *back = self.chain.read_back(chip, &written).await?;
        }
        Ok(all)
    }

    /// Starts conversion: START for all chips at once, RDATAC, SCLK for bursts. The first DRDY follows
    /// after [`Rate::settling`](crate::rate::Rate::settling) clock cycles, with settled data.
    ///
    /// # Errors
    /// When the bus or a pin fails.
    pub async fn start(&mut self) -> Result<Streaming<'_, Spi, Line, Delay, CHIPS>, Error> {
        self.chain.run().await?;
        Ok(Streaming::new(
            self.chain,
            self.settings.clock,
            self.settings.rate,
        ))
    }
}
