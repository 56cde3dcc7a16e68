//! The timer with which the firmware measures the external clock (HSE). It captures its own count
//! at every 8th edge of HSE / RTCPRE, which the emulator's timers cannot do.

use rigless::device::{Device, DeviceContext, RegisterFile};
use rigless::soc::stm32f427::generated::tim11;
use rigless::soc::stm32h743::generated::tim17;
use rigless::soc::{FieldSpec, Layout};
use rigless::time::VirtualNanos;

/// Registers of a timer that can measure HSE.
pub(crate) trait HseTimerRegisters: Layout + PartialEq {
    const STATUS: Self;
    const CAPTURED: Self;
    /// Fields that must have these values for the timer to capture each 8th edge of HSE / RTCPRE.
    const CAPTURES: [(Self, &'static FieldSpec, u64); 5];
}

impl HseTimerRegisters for tim17::Register {
    const STATUS: Self = Self::Sr;
    const CAPTURED: Self = Self::Ccr1;
    const CAPTURES: [(Self, &'static FieldSpec, u64); 5] = [
        (Self::Cr1, tim17::cr1::CEN, 1),
        (Self::Ccer, tim17::ccer::CC1E, 1),
        (Self::Ccmr1Input, tim17::ccmr1_input::CC1S, 1),
        (Self::Ccmr1Input, tim17::ccmr1_input::IC1PSC, 3),
        (Self::Tim17Tisel, tim17::tim17_tisel::TI1SEL, 2),
    ];
}

impl HseTimerRegisters for tim11::Register {
    const STATUS: Self = Self::Sr;
    const CAPTURED: Self = Self::Ccr1;
    const CAPTURES: [(Self, &'static FieldSpec, u64); 5] = [
        (Self::Cr1, tim11::cr1::CEN, 1),
        (Self::Ccer, tim11::ccer::CC1E, 1),
        (Self::Ccmr1Input, tim11::ccmr1_input::CC1S, 1),
        (Self::Ccmr1Input, tim11::ccmr1_input::ICPCS, 3),
        (Self::Or, tim11::or::RMP, 2),
    ];
}

/// Model of the timer: a counter that runs from the first access on, without a prescaler.
#[derive(Debug)]
pub(crate) struct HseTimer<R> {
    /// Frequency in Hz of the timer's clock, which equals the core's frequency after a reset.
    timer_hz: u64,
    /// Frequency in Hz of the external clock; 0 for none.
    pub(crate) hse_hz: u64,
    /// Value of RCC_CFGR.RTCPRE, by which HSE is divided; below 2, there is no divided clock.
    pub(crate) divider: u64,
    /// Number of captures until the firmware last read the captured count.
    taken: u64,
    registers: std::marker::PhantomData<R>,
}

impl<R> HseTimer<R> {
    pub(crate) const fn new(timer_hz: u64) -> Self {
        Self { timer_hz, hse_hz: 0, divider: 0, taken: 0, registers: std::marker::PhantomData }
    }

    /// Returns the number of captures from power-on to `now`.
    fn captures(&self, now: VirtualNanos) -> u64 {
        let edges = u128::from(now.0) * u128::from(self.hse_hz) / 1_000_000_000;
        let captures = edges / u128::from(8 * self.divider.max(2));
        u64::try_from(captures).unwrap_or(u64::MAX)
    }
}

impl<R: HseTimerRegisters> Device for HseTimer<R> {
    type Register = R;

    fn read(
        &mut self,
        register: R,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) -> Option<u64> {
        let is_set = |(register, field, value): (R, &FieldSpec, u64)| {
            field.get(registers.get(register)) == value
        };
        let is_set_up = R::CAPTURES.into_iter().all(is_set);
        let runs = is_set_up && self.divider >= 2 && self.hse_hz > 0;
        let captures = if runs { self.captures(context.now()) } else { 0 };
        if register == R::STATUS {
            // Set CC1IF for a new capture, and CC1OF if a further one has overwritten it.
            let new = captures.saturating_sub(self.taken);
            return Some(u64::from(new > 0) << 1 | u64::from(new > 1) << 9);
        }
        if register != R::CAPTURED {
            return None;
        }
        self.taken = captures;
        let edges = u128::from(captures * 8 * self.divider.max(2));
        let count = edges * u128::from(self.timer_hz) / u128::from(self.hse_hz.max(1));
        u64::try_from(count & 0xFFFF).ok()
    }
}
