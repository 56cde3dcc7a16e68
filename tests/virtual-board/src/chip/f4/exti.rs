//! The external interrupt controller (RM0390 rev 6, chapter 10), which the emulator does not model.

use rigless::device::{Device, DeviceContext, Level, RegisterFile};
use rigless::soc::stm32f427::generated::exti::Register;

use crate::model::Pin;

/// Number of EXTI lines that pins can be connected to.
const LINES: usize = 16;

/// Number of GPIO ports, A to H.
const PORTS: usize = 8;

/// Interrupts of the EXTI lines that pins use: index in the emulator's EXTI, first and last line
/// (RM0390, table 38). The interrupt with index 0 belongs to no pin.
const ROUTES: [(usize, u8, u8); 7] =
    [(1, 0, 0), (2, 1, 1), (3, 2, 2), (4, 3, 3), (5, 4, 4), (6, 5, 9), (7, 10, 15)];

/// Model of the EXTI lines of pins. It ignores edges that the firmware itself drives on a pin.
#[derive(Debug, Default)]
pub(super) struct Exti {
    /// Pending lines, one bit each. On the chip, writing 1 to a bit of PR clears it, but the
    /// emulator's own register would store the written value.
    pending: u64,
    /// Whether each pin of each port is high.
    levels: [[bool; LINES]; PORTS],
    /// Whether each interrupt of the emulator's EXTI was last driven high.
    raised: [bool; 8],
}

impl Exti {
    /// Resets the model as a system reset does; the pins keep their levels.
    pub(super) fn reset_registers(&mut self) {
        self.pending = 0;
        self.raised = [false; 8];
    }

    /// Sets the level of a pin. `is_routed` is true if SYSCFG connects the pin to the EXTI line
    /// that has the pin's number.
    pub(super) fn set_level(
        &mut self,
        pin: Pin,
        is_high: bool,
        is_routed: bool,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        let ports = self.levels.get_mut(pin.port());
        let Some(level) = ports.and_then(|port| port.get_mut(usize::from(pin.1))) else {
            return;
        };
        if std::mem::replace(level, is_high) == is_high || !is_routed {
            return;
        }
        let selected = if is_high { Register::Rtsr } else { Register::Ftsr };
        // A masked line becomes pending, too; the mask only blocks its interrupt (RM0390, 10.2.1).
        self.pending |= registers.get(selected) & 1 << pin.1;
        self.drive_interrupts(registers, context);
    }

    fn drive_interrupts(&mut self, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        registers.set(Register::Pr, self.pending);
        let active = self.pending & registers.get(Register::Imr);
        for (position, first, last) in ROUTES {
            let is_active = (first..=last).any(|line| active >> line & 1 != 0);
            if std::mem::replace(&mut self.raised[position], is_active) != is_active {
                context.interrupt(position, Level::from(is_active));
            }
        }
    }
}

impl Device for Exti {
    type Register = Register;

    fn write(
        &mut self,
        register: Register,
        value: u64,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        match register {
            // Writing 1 to a bit of PR clears the bit.
            Register::Pr => self.pending &= !value,
            Register::Swier => self.pending |= value & registers.get(Register::Imr),
            Register::Imr | Register::Emr | Register::Rtsr | Register::Ftsr => {}
        }
        self.drive_interrupts(registers, context);
    }
}
