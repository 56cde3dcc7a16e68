//! The external interrupt controller (RM0390 rev 6, chapter 10), which the emulator's part lacks.

use rigless::device::{Device, DeviceContext, Level, RegisterFile};
use rigless::soc::stm32f427::generated::exti::Register;

use crate::chip::Pin;

/// Lines of pins.
const LINES: usize = 16;

/// Ports, A to H.
const PORTS: usize = 8;

/// The first and last line of each interrupt, with its position among the instance's (RM0390, table 38):
/// tamper and wake-up come first and last, lines 0 to 4 have one each.
const ROUTES: [(usize, u8, u8); 7] = [
    (1, 0, 0),
    (2, 1, 1),
    (3, 2, 2),
    (4, 3, 3),
    (5, 4, 4),
    (6, 5, 9),
    (7, 10, 15),
];

/// The controller, for the lines of pins. A pin that the firmware drives itself causes no edge.
#[derive(Debug, Default)]
pub(super) struct Exti {
    /// The emulator's register file stores what is written to PR, which clears bits.
    pending: u64,
    /// Of each port's pins.
    levels: [[bool; LINES]; PORTS],
    raised: [bool; 8],
}

impl Exti {
    /// The system reset: the pins keep their levels.
    pub(super) fn reset_registers(&mut self) {
        self.pending = 0;
        self.raised = [false; 8];
    }

    /// The level of a pin; `is_routed` says whether SYSCFG routes it to the line of its number.
    pub(super) fn level(
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
        let edge = registers.get(selected) & 1 << pin.1;
        self.pend(edge, registers, context);
    }

    /// A pending bit is set whatever the mask; the mask gates the interrupt (RM0390, 10.2.1).
    fn pend(&mut self, lines: u64, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        self.pending |= lines;
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
            // Written 1 to clear.
            Register::Pr => self.pending &= !value,
            Register::Swier => self.pending |= value & registers.get(Register::Imr),
            Register::Imr | Register::Emr | Register::Rtsr | Register::Ftsr => {}
        }
        self.drive_interrupts(registers, context);
    }
}
