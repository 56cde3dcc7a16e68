//! Finds and opens DfuSe loaders on USB.

use std::time::Duration;
use std::{io, thread};

use dfuse::{PRODUCT, VENDOR};
use nusb::descriptors::language_id::US_ENGLISH;
use nusb::transfer::{ControlIn, ControlOut, ControlType, Recipient};
use nusb::{DeviceId, DeviceInfo, Interface, MaybeFuture as _};

use crate::update::programmer::Loader;

/// Time limit for one request. A loader that programs its flash answers late.
const REQUEST_TIMEOUT: Duration = Duration::from_secs(5);
/// Type of the functional descriptor of DFU (DFU 1.1, section 4.1.3).
const FUNCTIONAL: u8 = 0x21;
/// Start of the name of the alternate setting with the flash.
const FLASH: &str = "@Internal Flash";

/// A loader on USB, whose interface this program has claimed.
pub(crate) struct UsbLoader {
    interface: Interface,
    layout: String,
    transfer_size: u16,
}

/// Returns the ids of the loaders on USB. A loader that is plugged in again has another id.
///
/// # Errors
///
/// The operating system's error, such as on a machine without USB.
pub(crate) fn loaders() -> io::Result<Vec<DeviceId>> {
    Ok(devices()?.map(|device| device.id()).collect())
}

fn devices() -> io::Result<impl Iterator<Item = DeviceInfo>> {
    let devices = nusb::list_devices().wait()?;
    Ok(devices.filter(|device| (device.vendor_id(), device.product_id()) == (VENDOR, PRODUCT)))
}

impl UsbLoader {
    /// Opens the loader with this id, and claims the interface through which the flash is
    /// programmed.
    ///
    /// # Errors
    ///
    /// The operating system's error; `NotFound` if the loader is gone, `InvalidData` if it is not
    /// the loader of an STM32.
    pub(crate) fn open(id: DeviceId) -> io::Result<UsbLoader> {
        let found = devices()?.find(|device| device.id() == id);
        let device = found.ok_or(io::ErrorKind::NotFound)?.open().wait()?;
        let configuration = device.active_configuration()?;
        let mut descriptors = configuration.descriptors();
        let functional = descriptors.find(|one| one.descriptor_type() == FUNCTIONAL);
        let transfer_size = functional.as_deref().and_then(|bytes| bytes.get(5..7));
        let name = |setting: &nusb::descriptors::InterfaceDescriptor| {
            let index = setting.string_index()?;
            let name = device.get_string_descriptor(index, US_ENGLISH, REQUEST_TIMEOUT);
            name.wait().ok()
        };
        let settings = configuration.interface_alt_settings();
        let mut named = settings.filter_map(|setting| Some((name(&setting)?, setting)));
        let flash = named.find(|(name, _)| name.starts_with(FLASH));
        let (Some(&[low, high]), Some((layout, setting))) = (transfer_size, flash) else {
            return Err(io::Error::new(
                io::ErrorKind::InvalidData,
                "it has no alternate setting with a flash",
            ));
        };
        let interface = device.claim_interface(setting.interface_number()).wait()?;
        let alternate = setting.alternate_setting();
        interface.set_alt_setting(alternate).wait()?;
        Ok(UsbLoader { interface, layout, transfer_size: u16::from_le_bytes([low, high]) })
    }
}

impl Loader for UsbLoader {
    fn send(&mut self, request: u8, value: u16, data: &[u8]) -> io::Result<()> {
        let request = ControlOut {
            control_type: ControlType::Class,
            recipient: Recipient::Interface,
            request,
            value,
            index: self.interface.interface_number().into(),
            data,
        };
        let sent = self.interface.control_out(request, REQUEST_TIMEOUT);
        Ok(sent.wait()?)
    }

    fn receive(&mut self, request: u8, value: u16, length: u16) -> io::Result<Vec<u8>> {
        let request = ControlIn {
            control_type: ControlType::Class,
            recipient: Recipient::Interface,
            request,
            value,
            index: self.interface.interface_number().into(),
            length,
        };
        let received = self.interface.control_in(request, REQUEST_TIMEOUT);
        Ok(received.wait()?)
    }

    fn sleep(&mut self, time: Duration) {
        thread::sleep(time);
    }

    fn layout(&self) -> &str {
        &self.layout
    }

    fn transfer_size(&self) -> u16 {
        self.transfer_size
    }
}
