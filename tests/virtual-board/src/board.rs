//! The NUCLEO board, as an implementation of the emulator's `Board` trait.

use rigless::chip::uart;
use rigless::machine::{Board, Target};
use rigless::mcu::Mcu;
use rigless::snapshot::Store;

use crate::chain::Chain;
use crate::chip::Chip;
use crate::chip::f446::F446;
use crate::chip::h743::H743;
use crate::core_bus::{ClearedBits, Differences};
use crate::loader_stub;
use crate::model::Model;
use crate::processor::{Observer, wrap_core};
use crate::serial::Serial;
use crate::setup::Setup;
use crate::usb::handle::UsbHost;

/// A NUCLEO board with the converter board on its headers.
#[derive(Debug)]
pub(crate) struct Nucleo {
    pub(crate) chip: Box<dyn Chip>,
    model: Model,
    observer: Observer,
    cleared: Vec<ClearedBits>,
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
        let mut chip = chip(model, host);
        chip.set_external_clock(setup.clock_hz);
        if let Some(hz) = setup.lsi_hz {
            chip.set_lsi_hz(hz);
        }
        // Without an external clock, HSERDY must stay 0, but the emulator sets it.
        let cleared = (setup.clock_hz == 0).then(|| chip.hse_ready_flag());
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

/// Creates the microcontroller of a board, with `host` at the other end of its USB cable.
fn chip(model: Model, host: &UsbHost) -> Box<dyn Chip> {
    match model {
        Model::H743 => Box::new(H743::new(host)),
        Model::F446 => Box::new(F446::new(host)),
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
        let mut core = wrap_core(self.chip.core(), &self.observer, differences);
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
