//! The board as the emulator sees it.

use rigless::chip::uart;
use rigless::machine::{Board, Target};
use rigless::mcu::Mcu;
use rigless::snapshot::Store;

use crate::chain::Chain;
use crate::chip::Chip;
use crate::core_bus::{Cleared, Differences};
use crate::processor::{Observer, observed};
use crate::serial::Serial;
use crate::setup::Setup;
use crate::usb::UsbHost;
use crate::{Model, loader_stub};

/// A NUCLEO with the converters' board on its headers.
#[derive(Debug)]
pub(crate) struct Nucleo {
    pub(crate) chip: Box<dyn Chip>,
    model: Model,
    observer: Observer,
    cleared: Vec<Cleared>,
}

impl Nucleo {
    pub(crate) fn new(
        model: Model,
        setup: &Setup,
        chain: Chain,
        serial: Serial,
        host: &UsbHost,
        observer: Observer,
    ) -> Self {
        let mut chip = model.chip(host);
        chip.fit_clock(setup.clock_hz);
        if let Some(hz) = setup.lsi_hz {
            chip.set_lsi(hz);
        }
        // The emulator has HSERDY rise with nothing at the pins.
        let cleared = (setup.clock_hz == 0).then(|| chip.clock_ready());
        chip.attach_spi(chain);
        chip.attach_uart(Box::new(serial));
        Self {
            chip,
            model,
            observer,
            cleared: cleared.into_iter().collect(),
        }
    }
}

impl Store for Nucleo {}

impl Board for Nucleo {
    fn name(&self) -> &'static str {
        self.model.name()
    }

    fn targets(&mut self) -> Vec<Target<'_>> {
        let differences = Differences {
            redirects: self.chip.redirects(),
            cleared: self.cleared.clone(),
        };
        let mut core = observed(self.chip.core(), &self.observer, differences);
        core.factory_images.extend(loader_stub::image(self.model));
        let mcu: &mut dyn Mcu = &mut *self.chip;
        vec![Target::new(self.model.key(), mcu, core)]
    }

    fn target_names(&self) -> Vec<&'static str> {
        vec![self.model.key()]
    }

    fn mcu(&mut self, target: usize) -> Option<&mut dyn Mcu> {
        (target == 0).then_some(&mut *self.chip)
    }

    fn attach_host(&mut self, _: &str, peer: Box<dyn uart::Peer>) -> bool {
        self.chip.attach_uart(peer);
        true
    }
}
