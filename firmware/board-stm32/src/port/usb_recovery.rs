//! Corrections to embassy's USB driver (embassy-usb-synopsys-otg 0.3.3) for an unplugged cable.

use embassy_stm32::pac::{USB_OTG_FS, otg::Otg};
use embassy_time::{Duration, Timer};
use embassy_usb::Handler;

const OTG: Otg = USB_OTG_FS;
/// Number of IN endpoints in use: control, notifications, data.
const IN_ENDPOINTS: usize = 3;

/// Largest number of polls of a flag. The USB core sets a flag within some cycles of the PHY's 48
/// MHz, which is within a few polls.
const MAX_POLLS: usize = 1_000;

/// Period at which the flag of a bus reset is polled. The driver handles a bus reset at once,
/// unless it waits for the rest of a control transfer.
const POLL_PERIOD: Duration = Duration::from_millis(5);

/// Disables the IN endpoints when the host resets the bus.
///
/// A bus reset leaves an endpoint enabled if the host has not read the endpoint's packet. The
/// driver then waits without a limit until the endpoint is disabled, so a device that was unplugged
/// while it streamed would never send again. Disabling an endpoint takes two steps: NAK, then
/// disable (RM0433 and RM0390, OTG, IN data transfers, IN endpoint disable).
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
            // Writing 1 clears the flag.
            interrupts.write(|interrupts| interrupts.set_epdisd(true));
        }
    }
}

fn wait_for(flag: impl Fn() -> bool) {
    // If the flag is not set within the limit, the driver waits for the endpoint, as it would
    // without this handler.
    let _ = (0..MAX_POLLS).any(|_| flag());
}

/// Waits until the driver has missed a reset of the bus.
///
/// If the cable is unplugged within a control transfer, the driver keeps waiting for the rest of
/// the transfer, and the reset by the next host stays pending. When this function returns, the
/// caller must restart the device.
pub(crate) async fn wait_missed_reset() {
    let mut was_pending = false;
    loop {
        Timer::after(POLL_PERIOD).await;
        let is_pending = OTG.gintsts().read().usbrst();
        if is_pending && was_pending {
            return;
        }
        was_pending = is_pending;
    }
}
