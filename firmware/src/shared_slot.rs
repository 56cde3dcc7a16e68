//! The memory for an uploaded model, which conversation and encoder use in turn.

use device::{ModelSlot, Slot};
#[cfg(any(test, feature = "model-slot"))]
use embassy_sync::signal::Signal;

#[cfg(any(test, feature = "model-slot"))]
use crate::queues::RawMutex;

/// Access to the board's model slot. A task takes the slot, uses it, and puts it back before the
/// task waits again. The slot is therefore missing only for a more urgent task that interrupts this
/// use.
///
/// Without the feature `model-slot`, there is no slot, and the image contains no code for it.
#[derive(Default)]
pub struct SharedSlot {
    #[cfg(any(test, feature = "model-slot"))]
    free: Signal<RawMutex, &'static mut ModelSlot>,
}

impl SharedSlot {
    pub(crate) const fn new() -> Self {
        Self {
            #[cfg(any(test, feature = "model-slot"))]
            free: Signal::new(),
        }
    }

    /// Provides the memory; a board calls this once, before its tasks start.
    #[cfg(any(test, feature = "model-slot"))]
    pub fn provide(&self, slot: &'static mut ModelSlot) {
        self.free.signal(slot);
    }
}

impl Slot for &SharedSlot {
    const EXISTS: bool = cfg!(any(test, feature = "model-slot"));

    #[cfg(any(test, feature = "model-slot"))]
    fn with<T>(&mut self, access: impl FnOnce(&mut ModelSlot) -> T) -> Option<T> {
        let slot = self.free.try_take()?;
        let result = access(slot);
        self.free.signal(slot);
        Some(result)
    }

    #[cfg(not(any(test, feature = "model-slot")))]
    fn with<T>(&mut self, _: impl FnOnce(&mut ModelSlot) -> T) -> Option<T> {
        None
    }
}
