//! SPI bus and pins of a chain of ADS1299 chips, and the commands to the chips with their timing.

use core::ops::Range;

use embedded_hal::digital::{Error as _, OutputPin};
use embedded_hal_async::delay::DelayNs;
use embedded_hal_async::spi::Error as _;

use crate::bus::{Bus, Speed};
use crate::clock::Clock;
use crate::decoder::CHIP_BYTES;
use crate::error::{Error, Pin};
use crate::image::Image;
use crate::register::Register;
use crate::settings::{Control, Settings, Wiring};

/// SPI bus (mode 1) and pins of a chain of 1 to 8 chips; all pins have the type `Line`.
///
/// The driver sets a slower SCLK for registers than for bursts ([`Bus`]). The chips themselves
/// accept 20 MHz for registers too, because the driver waits for the decoding time after each byte;
/// only the resistors between the chips and MISO require a slower SCLK.
#[derive(Debug)]
pub struct Chain<Spi, Line, Delay, const CHIPS: usize> {
    /// SPI bus; must not be used for other devices while a chip is selected.
    pub spi: Spi,
    /// Chip selects, active low; chip 0 drives MISO.
    pub selects: [Line; CHIPS],
    /// START, shared by all chips; stays low with [`Control::Commands`].
    pub start: Line,
    /// RESET, shared by all chips, active low; stays high with [`Control::Commands`].
    pub reset: Line,
    /// Delay provider, for the waits between bytes, between commands and after power-up.
    pub delay: Delay,
}

/// Opcodes (data sheet section 9.5.3). RDATA and STANDBY are not used.
pub(crate) mod opcode {
    /// Reset the chip, as a pulse at the pin RESET does.
    pub(crate) const RESET: u8 = 0x06;
    /// Start conversions; the pin START must be low.
    pub(crate) const START: u8 = 0x08;
    /// Stop conversions.
    pub(crate) const STOP: u8 = 0x0A;
    /// Read data continuously: the chip sends data at every DRDY and accepts no opcode but
    /// [`SDATAC`]. This is the state after a reset.
    pub(crate) const RDATAC: u8 = 0x10;
    /// Stop reading data continuously; registers can be read and written afterwards.
    pub(crate) const SDATAC: u8 = 0x11;
    /// Read registers: ORed with the address of the first register, and followed by a byte with the
    /// number of registers less one.
    pub(crate) const RREG: u8 = 0x20;
    /// Write registers: ORed with the address of the first register, and followed by a byte with
    /// the number of registers less one and by the values.
    pub(crate) const WREG: u8 = 0x40;
    /// Mask of the opcode's bits in a byte that also holds an address.
    #[cfg(any(test, feature = "simulation"))]
    pub(crate) const MASK: u8 = 0xE0;
}

/// Clock cycles that a chip needs to decode a byte, and to execute a command before it is
/// deselected (data sheet section 9.5.3, tSDECODE; 7.6, tSCCS).
pub(crate) const DECODE: u32 = 4;

/// Clock cycles that a chip must stay deselected between commands (data sheet section 7.6, tCSH).
pub(crate) const DESELECTED: u32 = 2;

/// Clock cycles from power-up to the reset (data sheet section 11.1, tPOR). By then, VCAP1 must
/// also have reached 1.1 V.
pub(crate) const POWER_ON: u32 = 1 << 18;

/// [`POWER_ON`] at the slowest clock, in microseconds: 175 ms.
pub(crate) const POWER_ON_US: u32 = Clock::SLOWEST.microseconds(POWER_ON);

/// Delay from power-up to the reset on boards that do not measure VCAP1, in microseconds. The data
/// sheet states no charging time for VCAP1's capacitor; its power-up flow waits 1 s (figure 67).
pub(crate) const COLD_US: u32 = 1_000_000;

const _: () = assert!(POWER_ON_US < COLD_US);

/// Clock cycles for which RESET must stay low (data sheet section 11.1, tRST).
pub(crate) const RESET_LOW: u32 = 2;

/// Clock cycles from the end of the reset to the first command (data sheet section 9.4.2).
pub(crate) const AFTER_RESET: u32 = 18;

/// Settling time of the internal reference, in microseconds (data sheet section 7.5).
pub(crate) const REFERENCE_US: u32 = 150_000;

/// Longest delay between two calls of `progress`, in microseconds. The caller feeds its watchdog in
/// `progress`, and the shortest watchdog period is 136 ms.
const SLICE_US: u32 = 20_000;

impl<Spi: Bus, Line: OutputPin, Delay: DelayNs, const CHIPS: usize> Chain<Spi, Line, Delay, CHIPS> {
    /// Waits 2^18 clock cycles for the supplies, resets the chips and sends SDATAC; calls
    /// `progress` every 20 ms.
    pub(crate) async fn reset(
        &mut self,
        settings: Settings,
        progress: &mut impl FnMut(),
    ) -> Result<(), Error> {
        self.rest_pins()?;
        self.rest(POWER_ON_US, progress).await;
        self.reset_now(settings).await
    }

    /// Drives all pins to their idle level and sets SCLK to the frequency for registers.
    pub(crate) fn rest_pins(&mut self) -> Result<(), Error> {
        self.set_speed(Speed::Registers)?;
        self.set_start(false)?;
        self.set_reset(true)?;
        self.select(0..CHIPS, false)
    }

    /// Resets the chips and sends SDATAC.
    pub(crate) async fn reset_now(&mut self, settings: Settings) -> Result<(), Error> {
        match settings.control {
            Control::Pins => {
                self.set_reset(false)?;
                self.wait(RESET_LOW).await;
                self.set_reset(true)?;
            }
            Control::Commands => {
                // In RDATAC mode, a chip accepts no other opcode than SDATAC.
                self.command_all(opcode::SDATAC, settings).await?;
                self.command_all(opcode::RESET, settings).await?;
            }
        }
        self.wait(AFTER_RESET).await;
        self.command_all(opcode::SDATAC, settings).await
    }

    /// Switches on the reference of a chip through CONFIG3, and returns whether it was on before.
    pub(crate) async fn switch_reference_on(
        &mut self,
        chip: usize,
        settings: Settings,
    ) -> Result<bool, Error> {
        let image = settings.image(chip);
        let mut old = [0];
        self.read_registers(chip, Register::CONFIG3, &mut old).await?;
        let own = &image.0[Register::CONFIG3.index()..=Register::CONFIG3.index()];
        self.write_registers(chip, Register::CONFIG3, own).await?;
        Ok(old[0] & 0x80 != 0)
    }

    /// Writes the registers with the indices in `part`; the values come from the chip's settings.
    pub(crate) async fn write_part(
        &mut self,
        chip: usize,
        settings: Settings,
        part: Range<usize>,
    ) -> Result<(), Error> {
        let image = settings.image(chip);
        let Some(first) = register(&part) else {
            return Ok(());
        };
        self.write_registers(chip, first, &image.0[part]).await
    }

    /// Reads the registers with the indices in `part` into `image`.
    pub(crate) async fn read_part(
        &mut self,
        chip: usize,
        image: &mut Image,
        part: Range<usize>,
    ) -> Result<(), Error> {
        let Some(first) = register(&part) else {
            return Ok(());
        };
        self.read_registers(chip, first, &mut image.0[part]).await
    }

    /// Starts conversion, sends RDATAC and sets SCLK to the frequency for reading samples.
    pub(crate) async fn run(&mut self, settings: Settings) -> Result<(), Error> {
        match settings.control {
            Control::Pins => self.set_start(true)?,
            Control::Commands => self.command_all(opcode::START, settings).await?,
        }
        self.command_all(opcode::RDATAC, settings).await?;
        self.set_speed(Speed::Bursts)
    }

    /// Clocks one frame out of the chips: [`frame_bytes`](crate::decoder::frame_bytes) bytes.
    ///
    /// # Timing
    /// Call it directly after DRDY falls; it must end before DRDY falls again. Clocking takes 108
    /// us for eight chips at 16 MHz, and another 3 us pass before the chips are deselected: once in
    /// a daisy chain, once per chip if they are cascaded.
    pub(crate) async fn read_frame(
        &mut self,
        frame: &mut [u8],
        wiring: Wiring,
    ) -> Result<(), Error> {
        // The chips would execute an opcode sent here, so only zeros are sent: 0 is not an opcode.
        frame.fill(0);
        match wiring {
            Wiring::Daisy => self.burst(0..CHIPS, frame).await,
            Wiring::Cascaded => {
                for (chip, part) in frame.chunks_exact_mut(CHIP_BYTES).enumerate() {
                    self.burst(chip..chip + 1, part).await?;
                }
                Ok(())
            }
        }
    }

    /// Selects `chips`, clocks `bytes` out of them and deselects them.
    async fn burst(&mut self, chips: Range<usize>, bytes: &mut [u8]) -> Result<(), Error> {
        self.select(chips.clone(), true)?;
        let result = self.transfer(bytes).await;
        self.wait(DECODE).await;
        result.and(self.select(chips, false))
    }

    /// Stops conversion, sets SCLK for registers and sends SDATAC.
    pub(crate) async fn halt(&mut self, settings: Settings) -> Result<(), Error> {
        if settings.control == Control::Pins {
            self.set_start(false)?;
        }
        self.set_speed(Speed::Registers)?;
        self.command_all(opcode::SDATAC, settings).await?;
        if settings.control == Control::Commands {
            self.command_all(opcode::STOP, settings).await?;
        }
        Ok(())
    }

    pub(crate) async fn command_all(
        &mut self,
        opcode: u8,
        settings: Settings,
    ) -> Result<(), Error> {
        self.send_all(&[opcode], settings).await
    }

    /// Sends a command to all chips and ignores MISO. All chips of a daisy chain get the command at
    /// once; cascaded chips get it one after the other, because their DOUTs would drive MISO
    /// against each other.
    pub(crate) async fn send_all(&mut self, bytes: &[u8], settings: Settings) -> Result<(), Error> {
        match settings.wiring {
            Wiring::Daisy => self.exchange(0..CHIPS, bytes, &mut []).await,
            Wiring::Cascaded => {
                for chip in 0..CHIPS {
                    self.exchange(chip..chip + 1, bytes, &mut []).await?;
                }
                Ok(())
            }
        }
    }

    async fn read_registers(
        &mut self,
        chip: usize,
        first: Register,
        values: &mut [u8],
    ) -> Result<(), Error> {
        let opcodes = [opcode::RREG | first.address(), less_one(values)];
        self.exchange(chip..chip + 1, &opcodes, values).await
    }

    pub(crate) async fn write_registers(
        &mut self,
        chip: usize,
        first: Register,
        values: &[u8],
    ) -> Result<(), Error> {
        let mut bytes = [0; Register::COUNT + 2];
        bytes[0] = opcode::WREG | first.address();
        bytes[1] = less_one(values);
        let end = values.len() + 2;
        bytes[2..end].copy_from_slice(values);
        self.exchange(chip..chip + 1, &bytes[..end], &mut []).await
    }

    /// Selects the chips, sends `send`, fills `receive` with the bytes on MISO, and deselects the
    /// chips. Waits four clock cycles after every byte.
    pub(crate) async fn exchange(
        &mut self,
        chips: Range<usize>,
        send: &[u8],
        receive: &mut [u8],
    ) -> Result<(), Error> {
        self.select(chips.clone(), true)?;
        let result = self.exchange_bytes(send, receive).await;
        // The chips are deselected after a failure too, because that resets their command decoders.
        let released = self.select(chips, false);
        self.wait(DESELECTED).await;
        result.and(released)
    }

    async fn exchange_bytes(&mut self, send: &[u8], receive: &mut [u8]) -> Result<(), Error> {
        for byte in send {
            self.transfer(&mut [*byte]).await?;
            self.wait(DECODE).await;
        }
        for byte in receive {
            *byte = 0;
            self.transfer(core::slice::from_mut(byte)).await?;
            self.wait(DECODE).await;
        }
        Ok(())
    }

    /// Sends `bytes`, replaces them with the received bytes, and waits until the last bit is out.
    pub(crate) async fn transfer(&mut self, bytes: &mut [u8]) -> Result<(), Error> {
        let bus = |error: Spi::Error| Error::Bus(error.kind());
        self.spi.transfer_in_place(bytes).await.map_err(bus)?;
        self.spi.flush().await.map_err(bus)
    }

    /// Selects or deselects the chips of a range. Sets all of them even after an error, and returns
    /// the first error.
    pub(crate) fn select(&mut self, chips: Range<usize>, selected: bool) -> Result<(), Error> {
        let mut result = Ok(());
        for (chip, line) in self.selects.iter_mut().enumerate() {
            if chips.contains(&chip) {
                let set = line.set_state((!selected).into());
                result =
                    result.and(set.map_err(|e| Error::Pin(Pin::Select(number(chip)), e.kind())));
            }
        }
        result
    }

    pub(crate) fn set_start(&mut self, high: bool) -> Result<(), Error> {
        let set = self.start.set_state(high.into());
        set.map_err(|error| Error::Pin(Pin::Start, error.kind()))
    }

    pub(crate) fn set_speed(&mut self, speed: Speed) -> Result<(), Error> {
        let set = self.spi.set_speed(speed);
        set.map_err(|error| Error::TooFast(speed, error))
    }

    fn set_reset(&mut self, high: bool) -> Result<(), Error> {
        let set = self.reset.set_state(high.into());
        set.map_err(|error| Error::Pin(Pin::Reset, error.kind()))
    }

    /// Delays by `us` microseconds in slices of up to 20 ms; calls `progress` after each slice.
    pub(crate) async fn rest(&mut self, mut us: u32, progress: &mut impl FnMut()) {
        while us > 0 {
            let slice = us.min(SLICE_US);
            self.delay.delay_us(slice).await;
            us -= slice;
            progress();
        }
    }

    /// Delays by at least `cycles` clock cycles, computed for the slowest permitted clock.
    pub(crate) async fn wait(&mut self, cycles: u32) {
        let us = const { Clock::SLOWEST }.microseconds(cycles);
        self.delay.delay_us(us).await;
    }
}

/// Returns the first register of a range; `None` if the range starts after the last register.
#[expect(clippy::cast_possible_truncation, reason = "at most 24 registers")]
fn register(part: &Range<usize>) -> Option<Register> {
    Register::at(part.start as u8)
}

/// Returns the second byte of RREG and WREG: the number of values (1 to 24) less one.
#[expect(clippy::cast_possible_truncation, reason = "at most 24 registers")]
const fn less_one(values: &[u8]) -> u8 {
    values.len().saturating_sub(1) as u8
}

/// Returns a chip's index as a byte, the type that errors and reports use.
#[expect(clippy::cast_possible_truncation, reason = "at most 8 chips")]
pub(crate) const fn number(chip: usize) -> u8 {
    chip as u8
}
