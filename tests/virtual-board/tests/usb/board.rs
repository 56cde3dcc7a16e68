//! A NUCLEO-H743ZI2 with nothing but its USB connector.

use std::num::{NonZeroU32, NonZeroU64};

use rigless::device::{ErasedDevice, ResetCause};
use rigless::machine::{Board, Target, armv7m};
use rigless::mcu::{Mcu, Operate};
use rigless::soc::stm32h743::Stm32h743;
use rigless::soc::stm32h743::generated::otg1_hs_global;
use rigless::soc::{Bus, Error};
use rigless::time::VirtualNanos;
use virtual_board::usb::{H743_USB2, Otg, UsbHost, redirect};

/// The ST-LINK's clock output, Hz.
const HSE_HZ: u64 = 8_000_000;
/// Instructions per second of virtual time.
const RATE: NonZeroU64 = NonZeroU64::new(250_000_000).unwrap();
/// Core clock, Hz.
const CORE_HZ: NonZeroU64 = NonZeroU64::new(480_000_000).unwrap();

/// The microcontroller with the USB core in it.
#[derive(Debug)]
struct Microcontroller {
    part: Stm32h743,
    otg: Otg,
}

impl Mcu for Microcontroller {
    fn bus(&self) -> &Bus {
        self.part.bus()
    }

    fn bus_mut(&mut self) -> &mut Bus {
        self.part.bus_mut()
    }

    fn reset(&mut self, at: VirtualNanos, cause: ResetCause) {
        self.part.reset(at, cause);
        self.otg.reset();
    }

    fn poll(&mut self, now: VirtualNanos) {
        self.part.poll(now);
        self.otg.poll(now, self.part.bus_mut());
    }

    fn split(&mut self, slot: usize) -> (&mut Bus, Option<&mut dyn ErasedDevice>) {
        let (bus, model) = self.part.split(slot);
        match self.otg.model(slot, bus) {
            Some(own) => (bus, Some(own)),
            None => (bus, model),
        }
    }
}

/// The board.
#[derive(Debug)]
pub(crate) struct Nucleo(Microcontroller);

impl rigless::snapshot::Store for Nucleo {}

impl Nucleo {
    /// The board with `host` at its USB connector.
    pub(crate) fn new(host: &UsbHost) -> Result<Self, Error> {
        let mut part = Stm32h743::new()?;
        part.rcc.attach_crystals(HSE_HZ, 0);
        part.set_supply(3_300);
        part.set_analog_supply(3_300);
        let otg = Otg::new::<otg1_hs_global::Register>(&H743_USB2, host, part.bus_mut())?;
        Ok(Self(Microcontroller { part, otg }))
    }
}

impl Board for Nucleo {
    fn name(&self) -> &'static str {
        "nucleo-h743zi2"
    }

    fn target_names(&self) -> Vec<&'static str> {
        vec!["stm32h743"]
    }

    fn mcu(&mut self, target: usize) -> Option<&mut dyn Mcu> {
        (target == 0).then_some(&mut self.0)
    }

    fn targets(&mut self) -> Vec<Target<'_>> {
        let core = armv7m::Core {
            variant: armv7m::Variant::M7,
            clock_hz: CORE_HZ,
            interrupt_lines: NonZeroU32::new(self.0.cpu().interrupt_lines.into())
                .unwrap_or(NonZeroU32::MIN),
            priority_bits: 4,
            refclk_divider: const { NonZeroU32::new(8).unwrap() },
            instructions_per_second: RATE,
            boot: "flash",
        };
        let windows = rigless::cpu::armv7m::windows(self.0.bus());
        let mut config = armv7m::Config::new(core, &windows);
        config.fpu = armv7m::Fpu::FpV5Dp;
        config.mpu_regions = armv7m::MpuRegions::Sixteen;
        config.cpuid = 0x411F_C271;
        config.caches = Some(armv7m::Caches {
            clidr: 0x0900_0003,
            ctr: 0x8303_C003,
            ccsidr: &[0xF00F_E019, 0xF01F_E009],
        });
        config.branch_prediction = armv7m::BranchPrediction::Always;
        config.vector_table = Some(0x0800_0000);
        let mut spec = config.spec();
        redirect(&mut spec, vec![self.0.otg.redirect()]);
        vec![Target::new("stm32h743", &mut self.0, spec)]
    }
}
