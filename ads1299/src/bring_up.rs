//! Bringing a chain up, step by step.

use core::ops::Range;

use embedded_hal::digital::OutputPin;
use embedded_hal_async::delay::DelayNs;

use crate::bus::Bus;
use crate::chain::Chain;
use crate::command::REFERENCE_US;
use crate::error::Error;
use crate::image::ReadBack;
use crate::register::Register;
use crate::settings::Settings;

/// How far a chain has been brought up.
///
/// A step clocks at most [`STEP_BYTES`], 1.1 ms at 82 kHz with the times to decode them, so that a device
/// that samples every 1.9 ms is not late by it; the waits, which are most of a bring-up, are the caller's.
#[derive(Clone, Debug)]
pub(crate) struct BringUp<const CHIPS: usize> {
    next: Step,
    power_us: u32,
    reference_was_on: bool,
    /// The registers of each chip, read back.
    pub(crate) backs: [ReadBack; CHIPS],
}

/// Registers that are written in one step; between them is the read-only status of lead-off.
const WRITTEN: [Range<usize>; 3] = [
    Register::CONFIG1.index()..9,
    9..Register::LOFF_STATP.index(),
    Register::GPIO.index()..Register::COUNT,
];

/// Registers that are read in one step.
const READ: [Range<usize>; 3] = [0..8, 8..16, 16..Register::COUNT];

/// Parts of a chip's registers.
const PARTS: usize = 3;

/// Bytes that a step clocks at most.
const STEP_BYTES: usize = 11;

/// Bytes of RREG and WREG before the values: opcode and number.
const OPCODE_BYTES: usize = 2;

/// RDATAC, which follows the last part that is read in the same step.
const RDATAC_BYTES: usize = 1;

const _: () = {
    let mut part = 0;
    while part < PARTS {
        let written = WRITTEN[part].end - WRITTEN[part].start;
        let read = READ[part].end - READ[part].start;
        assert!(OPCODE_BYTES + written <= STEP_BYTES);
        assert!(OPCODE_BYTES + read + RDATAC_BYTES <= STEP_BYTES);
        part += 1;
    }
    // CONFIG3 is read and written in one step.
    assert!(2 * (OPCODE_BYTES + 1) <= STEP_BYTES);
};

/// The order is the data sheet's (11.1, figure 67).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    /// Pins at rest.
    Power,
    Reset,
    Stop,
    /// CONFIG3 of a chip.
    Reference(usize),
    /// A part of the registers of a chip, counted over all chips.
    Registers(usize),
    ReadBack(usize),
    Done,
}

impl<const CHIPS: usize> BringUp<CHIPS> {
    /// From the power to registers that are read back; `power_us` is how long the power may take from
    /// now on until the chips can be reset.
    pub(crate) const fn from_power(power_us: u32) -> Self {
        Self {
            next: Step::Power,
            power_us,
            reference_was_on: true,
            backs: [ReadBack::NONE; CHIPS],
        }
    }

    /// Of chips that have been reset since their power came.
    pub(crate) const fn from_reset() -> Self {
        let mut steps = Self::from_power(0);
        steps.next = Step::Stop;
        steps
    }
}

impl<Spi: Bus, Line: OutputPin, Delay: DelayNs, const CHIPS: usize> Chain<Spi, Line, Delay, CHIPS> {
    /// Takes the next step; returns how long to wait before the one after it, us, or none if that was the
    /// last one.
    pub(crate) async fn step(
        &mut self,
        settings: &Settings<CHIPS>,
        steps: &mut BringUp<CHIPS>,
    ) -> Result<Option<u32>, Error> {
        let mut wait_us = 0;
        steps.next = match steps.next {
            Step::Power => {
                self.rest_pins()?;
                wait_us = steps.power_us;
                Step::Reset
            }
            Step::Reset => {
                self.pulse_reset().await?;
                Step::Stop
            }
            Step::Stop => {
                self.halt().await?;
                Step::Reference(0)
            }
            Step::Reference(chip) => {
                let was_on = self.switch_reference_on(chip, settings).await?;
                steps.reference_was_on &= was_on;
                if chip + 1 < CHIPS {
                    Step::Reference(chip + 1)
                } else {
                    if !steps.reference_was_on {
                        wait_us = REFERENCE_US;
                    }
                    Step::Registers(0)
                }
            }
            Step::Registers(part) => {
                let run = WRITTEN[part % PARTS].clone();
                self.write_part(part / PARTS, settings, run).await?;
                if part + 1 < PARTS * CHIPS {
                    Step::Registers(part + 1)
                } else {
                    Step::ReadBack(0)
                }
            }
            Step::ReadBack(part) => {
                let (chip, run) = (part / PARTS, READ[part % PARTS].clone());
                let back = &mut steps.backs[chip];
                self.read_part(chip, &mut back.read, run).await?;
                // The last part completes it.
                *back = ReadBack::new(&settings.image(chip), back.read);
                if part + 1 < PARTS * CHIPS {
                    Step::ReadBack(part + 1)
                } else {
                    Step::Done
                }
            }
            Step::Done => Step::Done,
        };
        Ok((steps.next != Step::Done).then_some(wait_us))
    }

    /// Takes all steps that are left, with the waits between them; `progress` is called at least every
    /// 20 ms.
    pub(crate) async fn finish(
        &mut self,
        settings: &Settings<CHIPS>,
        steps: &mut BringUp<CHIPS>,
        progress: &mut impl FnMut(),
    ) -> Result<(), Error> {
        while let Some(wait_us) = self.step(settings, steps).await? {
            progress();
            self.rest(wait_us, progress).await;
        }
        Ok(())
    }
}
