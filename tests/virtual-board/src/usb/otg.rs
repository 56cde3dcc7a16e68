//! The USB core as a part carries it: a window with the registers and FIFOs, and a front for the instance
//! of the part's own that receives the clock and the reset line.

use std::marker::PhantomData;
use std::num::NonZeroU64;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rigless::device::{Device, DeviceContext, ErasedDevice, Level, RegisterFile, RequestChange};
use rigless::soc::{Bus, Error, Layout, RegisterSpec, Width, Window};
use rigless::time::{EventId, VirtualNanos};

use super::core::{Core, Supply};
use super::handle::UsbHost;
use super::instance::{Instance, Slots};
use crate::core_bus::Redirect;

/// The core's global interrupt among the window's interrupts.
const GLOBAL: usize = 0;

/// The core, the host at the other end of its cable, and what both have asked of the emulator.
#[derive(Debug)]
struct Link {
    core: Core,
    host: UsbHost,
    /// Level of the interrupt line.
    raised: bool,
    /// The earliest instant that an event is scheduled for.
    scheduled: Option<u64>,
}

impl Link {
    /// Lets the host do what is due at `context`'s instant, then drives the interrupt and asks for the
    /// next event.
    fn settle(&mut self, context: &mut DeviceContext<'_>) {
        let now = context.now().0;
        self.core.set_now(now);
        let host = self.host.step(now, &mut self.core);
        let wanted = host
            .into_iter()
            .chain(self.core.next_frame_interrupt())
            .min();
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

type Shared = Arc<Mutex<Link>>;

fn lock(link: &Shared) -> MutexGuard<'_, Link> {
    link.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The window's model.
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
            reason = "the width is checked by the core"
        )]
        link.core.write(offset, width, value as u32);
        link.settle(context);
    }
}

/// The front for the part's own instance, whose registers are those of the window.
#[derive(Debug)]
struct Front<L> {
    link: Shared,
    layout: PhantomData<L>,
}

impl<L: Layout> Device for Front<L> {
    type Register = L;

    fn on_clock(&mut self, hz: u64, _: &mut RegisterFile, _: &mut DeviceContext<'_>) {
        lock(&self.link).core.supply.kernel_hz = Some(hz);
    }

    /// The reset bit in the clock controller: the core is as out of a system reset.
    fn reset_line(&mut self, _: &mut RegisterFile, _: &mut DeviceContext<'_>) {
        let mut link = lock(&self.link);
        link.core.reset();
        // The host notices at the next access or stop.
    }
}

/// The USB core of a part, to be plugged into the part's dispatch.
pub(crate) struct Otg {
    link: Shared,
    registers: Registers,
    front: Box<dyn ErasedDevice + Send>,
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
    /// Adds the core `instance` to a part's `bus`, with `host` at the other end of its cable. `L` is the
    /// layout of the part's own instance [`Instance::global`].
    ///
    /// # Errors
    ///
    /// If the part has no such instance, or something is at the window's addresses.
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
        let link = Arc::new(Mutex::new(Link {
            core: Core::new(instance),
            host: host.clone(),
            raised: false,
            scheduled: None,
        }));
        let registers = Registers {
            link: Arc::clone(&link),
            layout: bus.slots()[window].peripheral().registers,
        };
        let front = Box::new(Front {
            link: Arc::clone(&link),
            layout: PhantomData::<L>,
        });
        Ok(Self {
            link,
            registers,
            front,
            instance,
            slots,
            window,
            global,
        })
    }

    /// The addresses that the processor's accesses are redirected from and to.
    pub(crate) fn redirect(&self) -> Redirect {
        Redirect {
            from: self.instance.base..self.instance.base + self.instance.size,
            to: self.instance.window_base,
        }
    }

    /// The model for `slot`, if it is one of the core's: what the part's `split` returns in place of its
    /// own. `bus` is the part's.
    pub(crate) fn model(&mut self, slot: usize, bus: &Bus) -> Option<&mut dyn ErasedDevice> {
        if slot == self.window {
            self.supply(bus);
            Some(&mut self.registers)
        } else if slot == self.global {
            Some(&mut *self.front)
        } else {
            None
        }
    }

    /// Lets the host act at `now`, a stop of the emulator: the part's `poll` calls it.
    pub(crate) fn poll(&mut self, now: VirtualNanos, bus: &mut Bus) {
        self.supply(bus);
        let (_, mut context) = bus.drive(now, self.window);
        lock(&self.link).settle(&mut context);
    }

    /// A system reset: the part's `reset` calls it after it has reset itself. The host sees the device
    /// leave the bus.
    pub(crate) fn reset(&mut self) {
        let mut link = lock(&self.link);
        link.core.reset();
        link.core.supply = Supply::default();
        link.raised = false;
        link.scheduled = None;
    }

    /// Takes what the rest of the part does for the core.
    fn supply(&mut self, bus: &Bus) {
        let supply = &mut lock(&self.link).core.supply;
        supply.clocked = (self.instance.is_clocked)(bus, &self.slots);
        supply.unwired = (self.instance.unwired)(bus, &self.slots);
    }
}

#[cfg(test)]
mod tests;
