//! Connects the model of the USB core to the emulator's model of a microcontroller.
//!
//! The registers and FIFOs are in a window at free addresses, to which accesses of the processor
//! are redirected ([`Otg::redirect`]). The emulator's own peripheral for the core only receives the
//! core's clock and reset line. The model of a chip contains an [`Otg`]: its `split` returns the
//! model from [`Otg::model`] if there is one for the slot, and its `poll` and `reset` end with
//! calls of [`Otg::poll`] and [`Otg::reset`].

use std::marker::PhantomData;
use std::num::NonZeroU64;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rigless::device::{Device, DeviceContext, ErasedDevice, Level, RegisterFile, RequestChange};
use rigless::soc::{Bus, Error, Layout, RegisterSpec, Width, Window};
use rigless::time::{EventId, VirtualNanos};

use super::core::{Core, Supply};
use super::host::UsbHost;
use super::instance::{Instance, Slots};
use crate::core_bus::Redirect;

/// Index of the core's global interrupt among the interrupts of its window in the emulator.
const GLOBAL: usize = 0;

/// The core and its host, and what they last passed to the emulator.
#[derive(Debug)]
struct CoreAndHost {
    core: Core,
    host: UsbHost,
    /// Level of the interrupt line last passed to the emulator; true is high.
    raised: bool,
    /// Earliest time for which the emulator has an event scheduled, in ns.
    scheduled: Option<u64>,
}

impl CoreAndHost {
    /// Lets the host do what is due now, then drives the interrupt line and schedules the next
    /// event.
    fn settle(&mut self, context: &mut DeviceContext<'_>) {
        let now = context.now().0;
        self.core.set_now(now);
        let host = self.host.step(now, &mut self.core);
        let wanted = host.into_iter().chain(self.core.next_frame_interrupt()).min();
        if self.scheduled.is_some_and(|at| at <= now) {
            self.scheduled = None;
        }
        if let Some(at) = wanted.filter(|&at| self.scheduled.is_none_or(|known| at < known)) {
            context.schedule(VirtualNanos(at));
            self.scheduled = Some(at);
        }
        let raised = self.core.interrupt();
        if raised != self.raised {
            self.raised = raised;
            context.interrupt(GLOBAL, Level::from(raised));
        }
    }
}

type Shared = Arc<Mutex<CoreAndHost>>;

fn lock(link: &Shared) -> MutexGuard<'_, CoreAndHost> {
    link.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The emulator's device for the address window of the core's registers and FIFOs.
#[derive(Debug)]
struct Registers {
    link: Shared,
    layout: &'static [RegisterSpec],
}

impl ErasedDevice for Registers {
    fn layout(&self) -> &'static [RegisterSpec] {
        self.layout
    }

    fn read(&mut self, _: usize, _: &mut RegisterFile, _: &mut DeviceContext<'_>) -> Option<u64> {
        None
    }

    fn write(&mut self, _: usize, _: u64, _: &mut RegisterFile, _: &mut DeviceContext<'_>) {}

    fn on_event(&mut self, _: EventId, _: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        lock(&self.link).settle(context);
    }

    fn on_request(&mut self, _: RequestChange, _: &mut RegisterFile, _: &mut DeviceContext<'_>) {}

    fn on_clock(&mut self, _: u64, _: &mut RegisterFile, _: &mut DeviceContext<'_>) {}

    fn poll(&mut self, _: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        lock(&self.link).settle(context);
    }

    fn reset(&mut self) {}

    fn on_access(&mut self, _: u64, _: u64, _: &mut RegisterFile, _: &mut DeviceContext<'_>) {}

    fn on_refused(&mut self, _: u64, _: &mut RegisterFile, _: &mut DeviceContext<'_>) {}

    fn read_window(&mut self, offset: u64, width: Width, context: &mut DeviceContext<'_>) -> u64 {
        let mut link = lock(&self.link);
        link.core.set_now(context.now().0);
        let value = link.core.read(offset, width);
        link.settle(context);
        value.into()
    }

    fn write_window(
        &mut self,
        offset: u64,
        width: Width,
        value: u64,
        context: &mut DeviceContext<'_>,
    ) {
        let mut link = lock(&self.link);
        link.core.set_now(context.now().0);
        #[expect(
            clippy::cast_possible_truncation,
            reason = "the core reports accesses that are not 32 bits wide"
        )]
        link.core.write(offset, width, value as u32);
        link.settle(context);
    }
}

/// Model of the emulator's own peripheral for the core; it only receives the core's clock and reset
/// line.
#[derive(Debug)]
struct ClockAndReset<L> {
    link: Shared,
    layout: PhantomData<L>,
}

impl<L: Layout> Device for ClockAndReset<L> {
    type Register = L;

    fn on_clock(&mut self, hz: u64, _: &mut RegisterFile, _: &mut DeviceContext<'_>) {
        lock(&self.link).core.supply.kernel_hz = Some(hz);
    }

    /// Handles the core's reset bit in the clock controller, which acts on the core like a system
    /// reset.
    fn reset_line(&mut self, _: &mut RegisterFile, _: &mut DeviceContext<'_>) {
        let mut link = lock(&self.link);
        link.core.reset();
        // The host sees the reset at the next access to the core or the next stop of the emulator.
    }
}

/// The model of a microcontroller's USB core, connected to the emulator.
pub(crate) struct Otg {
    link: Shared,
    registers: Registers,
    clock_and_reset: Box<dyn ErasedDevice + Send>,
    instance: &'static Instance,
    slots: Slots,
    window: usize,
    global: usize,
}

impl std::fmt::Debug for Otg {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter
            .debug_struct("Otg")
            .field("instance", &self.instance.window)
            .finish_non_exhaustive()
    }
}

impl Otg {
    /// Adds the core `instance` to the bus of a microcontroller, with `host` at the other end of
    /// its cable. `L` is the register layout of the peripheral [`Instance::global`].
    ///
    /// # Errors
    ///
    /// The emulator's part lacks [`Instance::global`], or another device already uses an address in
    /// the core's address window.
    pub(crate) fn new<L: Layout + Send + 'static>(
        instance: &'static Instance,
        host: &UsbHost,
        bus: &mut Bus,
    ) -> Result<Self, Error> {
        let global = bus.slot(instance.global)?;
        let slots = Slots::new(bus)?;
        let size = NonZeroU64::new(instance.size).unwrap_or(NonZeroU64::MIN);
        let window = Window::new(instance.window, instance.window_base, size);
        let window = bus.add_window(window.raising(instance.interrupts))?;
        let link = Arc::new(Mutex::new(CoreAndHost {
            core: Core::new(instance),
            host: host.clone(),
            raised: false,
            scheduled: None,
        }));
        let registers = Registers {
            link: Arc::clone(&link),
            layout: bus.slots()[window].peripheral().registers,
        };
        let clock_and_reset =
            Box::new(ClockAndReset { link: Arc::clone(&link), layout: PhantomData::<L> });
        Ok(Self { link, registers, clock_and_reset, instance, slots, window, global })
    }

    /// Returns the redirection from the core's addresses to its address window in the emulator.
    pub(crate) fn redirect(&self) -> Redirect {
        Redirect {
            from: self.instance.base..self.instance.base + self.instance.size,
            to: self.instance.window_base,
        }
    }

    /// Returns the model in the slot `slot` if the slot belongs to the core. The chip's `split`
    /// must return it in place of the model of the emulator's part.
    pub(crate) fn model(&mut self, slot: usize, bus: &Bus) -> Option<&mut dyn ErasedDevice> {
        if slot == self.window {
            self.update_supply(bus);
            Some(&mut self.registers)
        } else if slot == self.global {
            Some(&mut *self.clock_and_reset)
        } else {
            None
        }
    }

    /// Lets the host do what is due; the chip's `poll` calls this at each stop of the emulator.
    pub(crate) fn poll(&mut self, now: VirtualNanos, bus: &mut Bus) {
        self.update_supply(bus);
        let (_, mut context) = bus.drive(now, self.window);
        lock(&self.link).settle(&mut context);
    }

    /// Resets the core as a system reset does, which detaches it from the bus; the chip's `reset`
    /// calls this method at its end.
    pub(crate) fn reset(&mut self) {
        let mut link = lock(&self.link);
        link.core.reset();
        link.core.supply = Supply::default();
        link.raised = false;
        link.scheduled = None;
    }

    /// Reads from the microcontroller's registers whether the core has its bus clock and its
    /// connection to the cable.
    fn update_supply(&mut self, bus: &Bus) {
        let supply = &mut lock(&self.link).core.supply;
        (supply.clocked, supply.unwired) = (self.instance.supply)(bus, &self.slots);
    }
}

#[cfg(test)]
mod tests;
