//! The virtual board: its settings at power-on, and how it implements the emulator's `Board`.

use std::num::NonZeroU64;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use ads1299::Alignment;
use clap::ValueEnum;
use rigless::chip::uart;
use rigless::machine::{Board, Target};
use rigless::mcu::Mcu;
use rigless::snapshot::Store;

use crate::chain::Chain;
use crate::chip::Chip;
use crate::chip::f4::F4;
use crate::chip::h743::H743;
use crate::converters::Converters;
use crate::core_bus::{ClearedBits, Differences};
use crate::image::{self, Image};
use crate::model::Model;
use crate::port::Serial;
use crate::processor::{Observer, wrap_core};
use crate::usb::host::UsbHost;

/// Cable between a board and its host; each firmware image supports only one of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Cable {
    /// The USB cable of the debug probe ST-LINK, or of an adapter, which forwards the bytes of the
    /// UART.
    Uart,
    /// A cable to the microcontroller's own USB port.
    Usb,
}

/// Settings of a virtual board and its surroundings at power-on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Setup {
    /// Number, rate, wiring and clock of the converters.
    pub converters: Converters,
    /// Frequency in Hz of the clock at the HSE input, from the ST-LINK or a crystal; 0 for no
    /// clock.
    pub clock_hz: u64,
    /// Frequency in Hz of the internal low-speed oscillator (LSI); `None` for the typical
    /// frequency. It can be 17 to 47 kHz in the STM32F446 and 29.4 to 33.6 kHz in the STM32H743
    /// (DS10693 and DS12110, LSI characteristics).
    pub lsi_hz: Option<u64>,
    /// Number of instructions that the core completes per second of virtual time; `None` for that
    /// of the board. A scenario in which the core only waits takes less real time on a slow core.
    pub instructions_per_second: Option<NonZeroU64>,
    /// Whether the converters send a don't-care bit between the data of two chips (`Spaced`) or not
    /// (`Packed`).
    pub alignment: Alignment,
    /// Cable that connects the host; must be the one that the image supports.
    pub cable: Cable,
    /// Whether the converters have power from the start. If not, they have none until a test calls
    /// `Simulation::power_on`.
    pub converters_on: bool,
}

impl Default for Setup {
    fn default() -> Self {
        Self {
            converters: Converters::EIGHT,
            clock_hz: 8_000_000,
            lsi_hz: None,
            instructions_per_second: None,
            alignment: Alignment::Spaced,
            cable: Cable::Uart,
            converters_on: true,
        }
    }
}

/// An emulated chip with the converters, the UART and the USB host connected to it.
#[derive(Debug)]
pub(crate) struct EmulatedBoard {
    pub(crate) chip: Box<dyn Chip>,
    model: Model,
    /// File name of the firmware image that the board runs.
    image: String,
    observer: Observer,
    cleared: Vec<ClearedBits>,
    instructions_per_second: NonZeroU64,
}

impl EmulatedBoard {
    pub(crate) fn new(
        model: Model,
        image: &Image,
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
        // Without an external clock, the bit HSERDY must read as 0, but the emulator sets it.
        let (address, bits) = chip.hse_ready_flag();
        let cleared = vec![ClearedBits {
            address,
            bits,
            holds: Arc::new(AtomicBool::new(setup.clock_hz == 0)),
        }];
        chip.attach_spi(chain);
        chip.attach_uart(Box::new(serial));
        let own = NonZeroU64::new(model.facts().instructions_per_second);
        Self {
            chip,
            model,
            image: image.path().display().to_string(),
            observer,
            cleared,
            instructions_per_second: setup
                .instructions_per_second
                .or(own)
                .expect("a speed above 0"),
        }
    }

    /// While `is_held`, makes the USB core never report that its internal bus (AHB) is idle.
    pub(crate) fn hold_usb_while(&mut self, is_held: Arc<AtomicBool>) {
        let (address, bits) = self.chip.usb_idle_flag();
        self.cleared.push(ClearedBits { address, bits, holds: is_held });
    }
}

/// Returns the board's microcontroller, with `host` at the other end of its USB cable.
fn chip(model: Model, host: &UsbHost) -> Box<dyn Chip> {
    match model {
        Model::H743 => Box::new(H743::new(host)),
        Model::F446 | Model::Ironbci => Box::new(F4::new(model, host)),
    }
}

impl Store for EmulatedBoard {}

impl Board for EmulatedBoard {
    fn name(&self) -> &'static str {
        self.model.facts().name
    }

    fn targets(&mut self) -> Vec<Target<'_>> {
        let differences =
            Differences { redirects: self.chip.redirects(), cleared: self.cleared.clone() };
        let core = self.chip.core(self.instructions_per_second);
        let mut core = wrap_core(core, &self.image, &self.observer, differences);
        core.factory_images.extend(image::loader(self.model));
        let mcu: &mut dyn Mcu = &mut *self.chip;
        vec![Target::new(self.model.facts().key, mcu, core)]
    }

    fn target_names(&self) -> Vec<&'static str> {
        vec![self.model.facts().key]
    }

    fn mcu(&mut self, target: usize) -> Option<&mut dyn Mcu> {
        (target == 0).then_some(&mut *self.chip)
    }

    fn attach_host(&mut self, _: &str, peer: Box<dyn uart::Peer>) -> bool {
        self.chip.attach_uart(peer);
        true
    }
}
