//! What embassy's USB driver (embassy-usb-synopsys-otg 0.3.3) leaves undone when a cable is unplugged.

use embassy_stm32::pac::{USB_OTG_FS, otg::Otg};
use embassy_time::{Duration, Timer};
use embassy_usb::Handler;

/// The core, and the IN endpoints in use: control, notifications, data.
const OTG: Otg = USB_OTG_FS;
const IN_ENDPOINTS: usize = 3;

/// How often a flag of the core is polled at most. The core answers within some cycles of the PHY's
/// 48 MHz, a few reads.
const READS: usize = 1_000;

/// Period at which the flag of a bus reset is polled. The driver handles one at once unless it waits for the rest
/// of a control transfer.
const LOOK: Duration = Duration::from_millis(5);

/// Disables the IN endpoints when the host resets the bus.
///
/// A reset leaves an endpoint enabled whose packet the host has not taken, and the driver waits without end
/// until it is not: the device would never send again after it was unplugged while it streamed. A core that
/// has an endpoint enabled takes it back in two steps (RM0433 and RM0390, OTG, IN data transfers, IN endpoint
/// disable): NAK, then disable.
#[derive(Debug)]
pub(crate) struct DisableEndpoints;

impl Handler for DisableEndpoints {
    fn reset(&mut self) {
        for endpoint in 0..IN_ENDPOINTS {
            let (control, interrupts) = (OTG.diepctl(endpoint), OTG.diepint(endpoint));
            if !control.read().epena() {
                continue;
            }
            control.modify(|control| control.set_snak(true));
            wait_for(|| interrupts.read().inepne());
            control.modify(|control| {
                control.set_snak(true);
                control.set_epdis(true);
            });
            wait_for(|| interrupts.read().epdisd());
            // Cleared by writing 1.
            interrupts.write(|interrupts| interrupts.set_epdisd(true));
        }
    }
}

fn wait_for(flag: impl Fn() -> bool) {
    // Where it never comes, the driver's own wait is no worse off than before.
    let _ = (0..READS).any(|_| flag());
}

/// Waits until the driver overlooks a reset of the bus.
///
/// In the middle of a control transfer it waits for the host, which is gone; the next host's reset stays
/// pending then. The caller restarts the device.
pub(crate) async fn reset_overlooked() {
    let mut was_pending = false;
    loop {
        Timer::after(LOOK).await;
        let is_pending = OTG.gintsts().read().usbrst();
        if is_pending && was_pending {
            return;
        }
        was_pending = is_pending;
    }
}
