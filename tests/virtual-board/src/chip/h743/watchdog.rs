//! The independent watchdog of the STM32H743 (RM0433 rev 9, chapter 45), which the emulator does
//! not model.

use rigless::device::{Device, DeviceContext, RegisterFile};
use rigless::soc::stm32h743::generated::iwdg::Register;
use rigless::time::{EventId, VirtualNanos};

/// Index of the emulator's signal with which the watchdog requests its clock, the LSI oscillator,
/// from the clock controller (RM0433, 8.5.2).
const STARTED: usize = 0;

/// Keys that the firmware writes to the register KR to control the watchdog (RM0433, 45.4.1).
const UNLOCK: u64 = 0x5555;
const START: u64 = 0xCCCC;
const RELOAD: u64 = 0xAAAA;

/// Start value of the counter until the value in RLR has reached the counter's clock domain
/// (RM0433, 45.3).
const RESET_RELOAD: u64 = 0xFFF;

/// Number of LSI cycles until a written PR or RLR reaches the counter's clock domain (RM0433,
/// 45.4.4).
const CROSSING: u64 = 5;

/// Model of the watchdog without the window of WINR: the firmware keeps the reset value of WINR,
/// which disables the window.
#[derive(Debug, Default)]
pub(super) struct Watchdog {
    unlocked: bool,
    started: bool,
    /// Frequency of the LSI oscillator in Hz; 0 while it is stopped.
    clock_hz: u64,
    /// Value of PR that the counter uses: the value at the last transfer from the register.
    prescaler: u64,
    /// Value of RLR that the counter uses; `None` before the first transfer from the register.
    reload: Option<u64>,
    /// Event at which the running transfer of PR and RLR ends; `None` if none runs.
    crossing: Option<EventId>,
    /// Event at which the counter reaches 0 and the watchdog resets the chip.
    expiry: Option<EventId>,
    /// Time at which the counter was last loaded, and number of ticks from then until it reaches 0.
    loaded: Option<(VirtualNanos, u64)>,
}

impl Watchdog {
    /// Converts ticks of the prescaled clock to nanoseconds.
    fn nanoseconds(&self, ticks: u64) -> u64 {
        let divider = 4 << self.prescaler.min(6);
        ticks * divider * 1_000_000_000 / self.clock_hz.max(1)
    }

    fn load(&mut self, ticks: u64, context: &mut DeviceContext<'_>) {
        self.loaded = Some((context.now(), ticks));
        self.schedule(context);
    }

    fn schedule(&mut self, context: &mut DeviceContext<'_>) {
        self.expiry = None;
        if let Some((at, ticks)) = self.loaded
            && self.started
            && self.clock_hz > 0
        {
            let end = VirtualNanos(at.0 + self.nanoseconds(ticks));
            self.expiry = Some(context.schedule(end));
        }
    }

    /// Starts the transfer of PR and RLR to the counter's clock domain, if the counter has a clock.
    fn start_crossing(&mut self, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        registers.set(Register::Sr, 0b011);
        if let Some(wait) = (CROSSING * 1_000_000_000).checked_div(self.clock_hz) {
            let arrives = VirtualNanos(context.now().0 + wait);
            self.crossing = Some(context.schedule(arrives));
        }
    }
}

impl Device for Watchdog {
    type Register = Register;

    fn write(
        &mut self,
        register: Register,
        value: u64,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        match register {
            Register::Kr => {
                let key = value & 0xFFFF;
                self.unlocked = key == UNLOCK;
                registers.set(Register::Kr, 0);
                if key == START && !self.started {
                    self.started = true;
                    context.request(STARTED, true.into());
                    self.load(RESET_RELOAD + 1, context);
                } else if key == RELOAD && self.started {
                    self.load(self.reload.unwrap_or(RESET_RELOAD) + 1, context);
                }
            }
            Register::Pr | Register::Rlr if self.unlocked => {
                self.start_crossing(registers, context);
            }
            Register::Pr | Register::Rlr => {
                context.tell(
                    "PR",
                    "RM0433 rev 9 45.4.2: PR and RLR are write-protected until KR unlocks them",
                );
            }
            Register::Sr | Register::Winr => {}
        }
    }

    fn on_clock(&mut self, hz: u64, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        self.clock_hz = hz;
        if registers.get(Register::Sr) != 0 {
            self.start_crossing(registers, context);
        }
        self.schedule(context);
    }

    fn on_event(
        &mut self,
        event: EventId,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        if self.crossing == Some(event) {
            self.crossing = None;
            self.prescaler = registers.get(Register::Pr) & 0b111;
            self.reload = Some(registers.get(Register::Rlr) & 0xFFF);
            registers.set(Register::Sr, 0);
            self.schedule(context);
        } else if self.expiry == Some(event) {
            context.request_reset();
        }
    }
}
