//! The external interrupt controller (RM0390 rev 6, chapter 10), which the emulator does not model.

use rigless::device::{Device, DeviceContext, Level, RegisterFile};
use rigless::soc::stm32f427::generated::exti::Register;

use crate::model::Pin;

/// Number of EXTI lines that are connected to pins.
const LINES: usize = 16;

/// Number of GPIO ports: A to H.
const PORTS: usize = 8;

/// For each interrupt of the pins, its index in the emulator's EXTI instance and its first and last
/// EXTI line (RM0390, table 38). The interrupt with index 0 is not connected to pins.
const ROUTES: [(usize, u8, u8); 7] = [
    (1, 0, 0),
    (2, 1, 1),
    (3, 2, 2),
    (4, 3, 3),
    (5, 4, 4),
    (6, 5, 9),
    (7, 10, 15),
];

/// Model of EXTI for the lines of pins. Pins that the firmware itself drives cause no edge.
#[derive(Debug, Default)]
pub(super) struct Exti {
    /// Pending lines, one bit each. They are kept here because the emulator's register file would
    /// store a value written to PR, whereas on the chip each bit written as 1 clears a pending
    /// line.
    pending: u64,
    /// For each port and pin, whether the pin is high.
    levels: [[bool; LINES]; PORTS],
    /// For each interrupt of the emulator's EXTI instance, whether it was last driven high.
    raised: [bool; 8],
}

impl Exti {
    /// Applies a system reset; the levels of the pins remain.
    pub(super) fn reset_registers(&mut self) {
        self.pending = 0;
        self.raised = [false; 8];
    }

    /// Sets the level of a pin. `is_routed` is true if SYSCFG routes the pin to the line with its
    /// number.
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
        let selected = if is_high {
            Register::Rtsr
        } else {
            Register::Ftsr
        };
        // The line becomes pending even if it is masked; the mask only gates the interrupt (RM0390,
        // 10.2.1).
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
            // Bits of PR are cleared by writing 1.
            Register::Pr => self.pending &= !value,
            Register::Swier => self.pending |= value & registers.get(Register::Imr),
            Register::Imr | Register::Emr | Register::Rtsr | Register::Ftsr => {}
        }
        self.drive_interrupts(registers, context);
    }
}
