//! Bring-up of a chain of ADS1299 chips, in stages short enough to run between two samples.

use core::ops::Range;

use embedded_hal::digital::OutputPin;
use embedded_hal_async::delay::DelayNs;

use crate::bus::Bus;
use crate::chain::{Chain, REFERENCE_US};
use crate::error::Error;
use crate::image::ReadBack;
use crate::register::Register;
use crate::settings::Settings;

/// Progress of a bring-up, and the registers that it has read back.
///
/// One stage clocks at most [`STAGE_BYTES`], which takes 1.1 ms at an SCLK of 82 kHz, decoding
/// times included, so a stage fits between two samples of a device with a sample every 1.9 ms.
/// Between stages the caller waits for the time that [`Chain::run_stage`] returns.
#[derive(Clone, Debug)]
pub(crate) struct BringUp<const CHIPS: usize> {
    next: Stage,
    power_us: u32,
    reference_was_on: bool,
    /// Registers of each chip as read back and compared with the values written; complete after the
    /// last stage.
    pub(crate) read_backs: [ReadBack; CHIPS],
}

/// Indices of the registers to write, one range per stage. The ranges skip the read-only registers
/// LOFF_STATP and LOFF_STATN.
const WRITTEN: [Range<usize>; 3] = [
    Register::CONFIG1.index()..9,
    9..Register::LOFF_STATP.index(),
    Register::GPIO.index()..Register::COUNT,
];

/// Indices of the registers to read back, one range per stage.
const READ: [Range<usize>; 3] = [0..8, 8..16, 16..Register::COUNT];

/// Number of ranges in each of [`WRITTEN`] and [`READ`].
const PARTS: usize = 3;

/// Limit on the number of bytes that one stage clocks; asserted below.
const STAGE_BYTES: usize = 11;

/// Number of bytes in RREG and WREG before the register values: opcode and number of registers.
const OPCODE_BYTES: usize = 2;

/// Number of bytes of RDATAC, which is sent in the same stage as the last read.
const RDATAC_BYTES: usize = 1;

const _: () = {
    let mut part = 0;
    while part < PARTS {
        let written = WRITTEN[part].end - WRITTEN[part].start;
        let read = READ[part].end - READ[part].start;
        assert!(OPCODE_BYTES + written <= STAGE_BYTES);
        assert!(OPCODE_BYTES + read + RDATAC_BYTES <= STAGE_BYTES);
        part += 1;
    }
    // CONFIG3 is read and written in one stage: two commands of one register each.
    assert!(2 * (OPCODE_BYTES + 1) <= STAGE_BYTES);
};

/// Stages of a bring-up, in the order of the data sheet's power-up flow (figure 67).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// Drive the pins to their idle level.
    Power,
    Reset,
    Stop,
    /// Switch on the reference of the chip with this index, by writing the chip's CONFIG3.
    Reference(usize),
    /// Write one range of registers of one chip; holds `PARTS * chip + range`.
    Registers(usize),
    ReadBack(usize),
    Done,
}

impl<const CHIPS: usize> BringUp<CHIPS> {
    /// Creates a bring-up for chips whose supplies have just come on: the chips are reset
    /// `power_us` microseconds after the first stage.
    pub(crate) const fn from_power(power_us: u32) -> Self {
        Self {
            next: Stage::Power,
            power_us,
            reference_was_on: true,
            read_backs: [ReadBack::NONE; CHIPS],
        }
    }

    /// Creates a bring-up for chips that have already been reset since power-up.
    pub(crate) const fn from_reset() -> Self {
        let mut bring_up = Self::from_power(0);
        bring_up.next = Stage::Stop;
        bring_up
    }
}

impl<Spi: Bus, Line: OutputPin, Delay: DelayNs, const CHIPS: usize> Chain<Spi, Line, Delay, CHIPS> {
    /// Stops the chips, writes all registers and returns the values read back; calls `progress` at
    /// least every 20 ms.
    pub(crate) async fn set_up(
        &mut self,
        settings: Settings,
        progress: &mut impl FnMut(),
    ) -> Result<[ReadBack; CHIPS], Error> {
        let mut bring_up = BringUp::from_reset();
        self.finish(settings, &mut bring_up, progress).await?;
        Ok(bring_up.read_backs)
    }

    /// Runs the next stage. Returns the delay before the following stage in microseconds, or `None`
    /// after the last one.
    pub(crate) async fn run_stage(
        &mut self,
        settings: Settings,
        bring_up: &mut BringUp<CHIPS>,
    ) -> Result<Option<u32>, Error> {
        let mut wait_us = 0;
        bring_up.next = match bring_up.next {
            Stage::Power => {
                self.rest_pins()?;
                wait_us = bring_up.power_us;
                Stage::Reset
            }
            Stage::Reset => {
                self.reset_now(settings).await?;
                Stage::Stop
            }
            Stage::Stop => {
                self.halt(settings).await?;
                Stage::Reference(0)
            }
            Stage::Reference(chip) => {
                let was_on = self.switch_reference_on(chip, settings).await?;
                bring_up.reference_was_on &= was_on;
                if chip + 1 < CHIPS {
                    Stage::Reference(chip + 1)
                } else {
                    if !bring_up.reference_was_on {
                        wait_us = REFERENCE_US;
                    }
                    Stage::Registers(0)
                }
            }
            Stage::Registers(part) => {
                let run = WRITTEN[part % PARTS].clone();
                self.write_part(part / PARTS, settings, run).await?;
                if part + 1 < PARTS * CHIPS {
                    Stage::Registers(part + 1)
                } else {
                    Stage::ReadBack(0)
                }
            }
            Stage::ReadBack(part) => {
                let (chip, run) = (part / PARTS, READ[part % PARTS].clone());
                let read_back = &mut bring_up.read_backs[chip];
                self.read_part(chip, &mut read_back.read, run).await?;
                // Only the comparison after a chip's last range is complete; it overwrites the
                // earlier, incomplete comparisons.
                *read_back = ReadBack::new(&settings.image(chip), read_back.read);
                if part + 1 < PARTS * CHIPS { Stage::ReadBack(part + 1) } else { Stage::Done }
            }
            Stage::Done => Stage::Done,
        };
        Ok((bring_up.next != Stage::Done).then_some(wait_us))
    }

    /// Runs the remaining stages and their delays; calls `progress` at least every 20 ms.
    pub(crate) async fn finish(
        &mut self,
        settings: Settings,
        bring_up: &mut BringUp<CHIPS>,
        progress: &mut impl FnMut(),
    ) -> Result<(), Error> {
        while let Some(wait_us) = self.run_stage(settings, bring_up).await? {
            progress();
            self.rest(wait_us, progress).await;
        }
        Ok(())
    }
}
