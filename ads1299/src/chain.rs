//! The wires of a chain, and the words on them.

use core::ops::Range;

use embedded_hal::digital::{Error as _, OutputPin};
use embedded_hal_async::delay::DelayNs;
use embedded_hal_async::spi::Error as _;

use crate::MAX_CHIPS;
use crate::bring_up::BringUp;
use crate::bus::{Bus, Speed};
use crate::clock::Clock;
use crate::command::{AFTER_RESET, DECODE, DESELECTED, POWER_ON_US, RESET_LOW, opcode};
use crate::configured::Configured;
use crate::error::{Error, Pin};
use crate::image::{Image, ReadBack};
use crate::register::ID_MASK;
use crate::register::{ID, Register};
use crate::settings::Settings;

/// The wires of a chain of 1 to 8 chips: SPI in mode 1, and pins of one type.
///
/// The driver changes SCLK as it needs it ([`Bus`]). As far as the chips go registers may be clocked
/// with up to 20 MHz too: every byte is followed by the time that they need to decode it.
#[derive(Debug)]
pub struct Chain<Spi, Line, Delay, const CHIPS: usize> {
    /// The bus; nobody else may use it while a chip is selected.
    pub spi: Spi,
    /// The chips' selects, low is selected; chip 0 is the one at MISO.
    pub selects: [Line; CHIPS],
    /// START of all chips.
    pub start: Line,
    /// RESET of all chips, low is reset.
    pub reset: Line,
    /// Waits.
    pub delay: Delay,
}

/// Longest wait without a sign of life, us: a watchdog of 136 ms sees one in time.
const SLICE_US: u32 = 20_000;

/// Values of a run of registers.
type Run<'a> = (Register, &'a [u8]);

impl<Spi: Bus, Line: OutputPin, Delay: DelayNs, const CHIPS: usize> Chain<Spi, Line, Delay, CHIPS> {
    /// Brings the chain up in the data sheet's order (11.1, figure 67): START and selects at rest,
    /// 2^18 tCLK, reset, 18 tCLK, SDATAC, IDs, reference and 150 ms, all other registers, and
    /// everything read back. Takes 0.33 s for eight chips. A board whose VCAP1 needs more than 175 ms
    /// to reach 1.1 V waits before.
    ///
    /// # Errors
    /// The first chip with a wrong ID, the first register that did not keep its value, or a bus or
    /// pin that failed. The chain may be brought up again after any of them.
    pub async fn power_up(
        &mut self,
        settings: &Settings<CHIPS>,
    ) -> Result<Configured<'_, Spi, Line, Delay, CHIPS>, Error> {
        const { assert!(CHIPS >= 1 && CHIPS <= MAX_CHIPS, "1 to 8 chips") };
        self.reset(&mut || ()).await?;
        for chip in 0..CHIPS {
            let read = self.read_id(chip).await?;
            if read & ID_MASK != ID & ID_MASK {
                let chip = number(chip);
                return Err(Error::WrongId { chip, read });
            }
        }
        self.configure(settings).await?;
        Ok(Configured::new(self, settings))
    }

    /// Waits for the power, resets the chips and stops them; `progress` is called every 20 ms.
    pub(crate) async fn reset(&mut self, progress: &mut impl FnMut()) -> Result<(), Error> {
        self.rest_pins()?;
        self.rest(POWER_ON_US, progress).await;
        self.pulse_reset().await
    }

    /// All pins at rest, SCLK for registers.
    pub(crate) fn rest_pins(&mut self) -> Result<(), Error> {
        self.set_speed(Speed::Registers)?;
        self.set_start(false)?;
        self.set_reset(true)?;
        self.select(0..CHIPS, false)
    }

    /// Resets the chips and stops them.
    pub(crate) async fn pulse_reset(&mut self) -> Result<(), Error> {
        self.set_reset(false)?;
        self.wait(RESET_LOW).await;
        self.set_reset(true)?;
        self.wait(AFTER_RESET).await;
        self.command_all(opcode::SDATAC).await
    }

    /// Stops what runs, writes every register and reads it back.
    pub(crate) async fn configure(&mut self, settings: &Settings<CHIPS>) -> Result<(), Error> {
        let backs = self.set_up(settings, &mut || ()).await?;
        check(&backs, settings)
    }

    /// Stops what runs, writes every register, and reads back what the chips made of it; `progress`
    /// is called at least every 20 ms.
    pub(crate) async fn set_up(
        &mut self,
        settings: &Settings<CHIPS>,
        progress: &mut impl FnMut(),
    ) -> Result<[ReadBack; CHIPS], Error> {
        let mut steps = BringUp::from_reset();
        self.finish(settings, &mut steps, progress).await?;
        Ok(steps.backs)
    }

    /// Writes CONFIG3 of a chip; returns whether its reference was on before.
    pub(crate) async fn switch_reference_on(
        &mut self,
        chip: usize,
        settings: &Settings<CHIPS>,
    ) -> Result<bool, Error> {
        let image = settings.image(chip);
        let mut old = [0];
        self.read_registers(chip, Register::CONFIG3, &mut old)
            .await?;
        let own = &image.0[Register::CONFIG3.index()..=Register::CONFIG3.index()];
        self.write_registers(chip, (Register::CONFIG3, own)).await?;
        Ok(old[0] & 0x80 != 0)
    }

    /// Writes registers of a chip.
    pub(crate) async fn write_part(
        &mut self,
        chip: usize,
        settings: &Settings<CHIPS>,
        part: Range<usize>,
    ) -> Result<(), Error> {
        let image = settings.image(chip);
        let Some(first) = register(&part) else {
            return Ok(());
        };
        self.write_registers(chip, (first, &image.0[part])).await
    }

    /// Reads registers of a chip to their places.
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

    /// START for all chips at once, RDATAC, and SCLK for bursts.
    pub(crate) async fn run(&mut self) -> Result<(), Error> {
        self.set_start(true)?;
        self.command_all(opcode::RDATAC).await?;
        self.set_speed(Speed::Bursts)
    }

    /// START low, SCLK for registers, SDATAC.
    pub(crate) async fn halt(&mut self) -> Result<(), Error> {
        self.set_start(false)?;
        self.set_speed(Speed::Registers)?;
        self.command_all(opcode::SDATAC).await
    }

    /// Reads every register of a chip; the chips must be stopped.
    pub(crate) async fn read_back(
        &mut self,
        chip: usize,
        written: &Image,
    ) -> Result<ReadBack, Error> {
        let mut values = [0; Register::COUNT];
        self.read_registers(chip, Register::ID, &mut values).await?;
        Ok(ReadBack::new(written, Image(values)))
    }

    async fn read_id(&mut self, chip: usize) -> Result<u8, Error> {
        let mut id = [0];
        self.read_registers(chip, Register::ID, &mut id).await?;
        Ok(id[0])
    }

    /// The same opcode to all chips at once; what they answer is ignored.
    pub(crate) async fn command_all(&mut self, opcode: u8) -> Result<(), Error> {
        self.exchange(0..CHIPS, &[opcode], &mut []).await
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

    async fn write_registers(
        &mut self,
        chip: usize,
        (first, values): Run<'_>,
    ) -> Result<(), Error> {
        let mut bytes = [0; Register::COUNT + 2];
        bytes[0] = opcode::WREG | first.address();
        bytes[1] = less_one(values);
        let end = values.len() + 2;
        bytes[2..end].copy_from_slice(values);
        self.exchange(chip..chip + 1, &bytes[..end], &mut []).await
    }

    /// Selects, sends, receives, deselects; four cycles behind every byte.
    async fn exchange(
        &mut self,
        chips: Range<usize>,
        send: &[u8],
        receive: &mut [u8],
    ) -> Result<(), Error> {
        self.select(chips.clone(), true)?;
        let result = self.exchange_bytes(send, receive).await;
        // Deselected also after a failure: the next command starts afresh.
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

    /// Clocks bytes out and in, and waits until the last bit is through.
    pub(crate) async fn transfer(&mut self, bytes: &mut [u8]) -> Result<(), Error> {
        let bus = |error: Spi::Error| Error::Bus(error.kind());
        self.spi.transfer_in_place(bytes).await.map_err(bus)?;
        self.spi.flush().await.map_err(bus)
    }

    /// Selects chips or lets them go.
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

    /// Waits long, and shows every 20 ms that it lives.
    pub(crate) async fn rest(&mut self, mut us: u32, progress: &mut impl FnMut()) {
        while us > 0 {
            let slice = us.min(SLICE_US);
            self.delay.delay_us(slice).await;
            us -= slice;
            progress();
        }
    }

    /// Waits for so many cycles of the slowest clock that the chips may have.
    pub(crate) async fn wait(&mut self, cycles: u32) {
        let us = const { Clock::SLOWEST }.microseconds(cycles);
        self.delay.delay_us(us).await;
    }
}

/// Whether every chip is an ADS1299 that kept everything.
pub(crate) fn check<const CHIPS: usize>(
    backs: &[ReadBack; CHIPS],
    settings: &Settings<CHIPS>,
) -> Result<(), Error> {
    let mut chips = backs.iter().enumerate();
    chips.try_for_each(|(chip, back)| back.check(number(chip), &settings.image(chip)))
}

/// The first register of a part.
#[expect(clippy::cast_possible_truncation, reason = "at most 24 registers")]
fn register(part: &Range<usize>) -> Option<Register> {
    Register::at(part.start as u8)
}

/// The second byte of RREG and WREG; 1 to 24 values.
#[expect(clippy::cast_possible_truncation, reason = "at most 24 registers")]
const fn less_one(values: &[u8]) -> u8 {
    values.len().saturating_sub(1) as u8
}

/// A chip's number in a message.
#[expect(clippy::cast_possible_truncation, reason = "at most 8 chips")]
pub(crate) const fn number(chip: usize) -> u8 {
    chip as u8
}
