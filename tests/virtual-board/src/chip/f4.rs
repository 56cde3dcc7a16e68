//! The STM32F446 and the STM32F407: the emulator's STM32F427, with added models of EXTI, USB and
//! the register RCC_DCKCFGR2.

mod exti;

use std::mem;
use std::num::{NonZeroU32, NonZeroU64};

use rigless::chip::uart::{self, Rate};
use rigless::cpu::armv7m::windows;
use rigless::device::{ErasedDevice, Level, ResetCause};
use rigless::emulator::CoreSpec;
use rigless::machine::armv7m::{Config, Core, Fpu, MpuRegions, Variant};
use rigless::mcu::{Mcu, Operate};
use rigless::soc::stm32f427::Stm32f427;
use rigless::soc::stm32f427::generated::{gpioa, otg_fs_global, rcc, spi1, syscfg, tim11};
use rigless::soc::stm32f427::peripherals::gpio::{Gpio, Pin as PartPin};
use rigless::soc::stm32f427::peripherals::tim::{Channel, Tim};
use rigless::soc::stm32f427::peripherals::{SERIAL_INTERFACES, TIMERS};
use rigless::soc::{Bus, Region};
use rigless::time::VirtualNanos;

use crate::chain::Chain;
use crate::chip::Chip;
use crate::chip::hse_timer::HseTimer;
use crate::core_bus::Redirect;
use crate::model::{Model, Pin};
use crate::usb::host::UsbHost;
use crate::usb::instance::F446_OTG_FS;
use crate::usb::otg::Otg;

use exti::Exti;

/// Index, in the emulator's array of timers, of TIM2, whose channel 3 captures the trigger.
const TIMER: usize = 0;
/// Number of the alternate function that connects TIM2 to pin PB10 (DS10693, table 11; DS8626,
/// table 9).
const TIMER_FUNCTION: u8 = 1;
/// Names of the GPIO ports in the emulator; the port index in a [`Pin`] selects one.
const PORTS: [&str; 8] = ["GPIOA", "GPIOB", "GPIOC", "GPIOD", "GPIOE", "GPIOF", "GPIOG", "GPIOH"];

/// Address of RCC_CR and its bit HSERDY, set once the external clock is stable (RM0390, 6.3.1).
const RCC_CR: u64 = 0x4002_3800;
const HSERDY: u64 = 1 << 17;

/// Address of the USB core's register GRSTCTL, and its bit AHBIDL.
const GRSTCTL: u64 = 0x5000_0000 + 0x10;
const AHBIDL: u64 = 1 << 31;

/// Address of RCC_DCKCFGR2 of the STM32F446 (RM0390, 6.3.28), which the STM32F427 lacks. The
/// emulated register only stores what is written. That suffices, because the firmware leaves the
/// clock selections at their reset values.
const DCKCFGR2: u64 = 0x4002_3894;
/// Address at which the emulator serves accesses to DCKCFGR2; the chip has nothing there.
const SPARE: u64 = 0x5700_0000;

/// An emulated STM32F446 or STM32F407: the emulator's part, with added models of EXTI and USB.
#[derive(Debug)]
pub(crate) struct F4 {
    model: Model,
    part: Stm32f427,
    exti: Exti,
    exti_slot: usize,
    otg: Otg,
    hse_timer: HseTimer<tim11::Register>,
    hse_timer_slot: usize,
}

impl F4 {
    /// Creates the powered chip of a board without an external clock, with `host` at the other end
    /// of its USB cable.
    ///
    /// # Panics
    /// When the emulator's description of the part contradicts itself.
    pub(crate) fn new(model: Model, host: &UsbHost) -> Self {
        let mut part = Stm32f427::new().expect("the emulator's own part");
        part.set_supply(3300);
        let spare = Region::ram("DCKCFGR2", SPARE, 0x1000);
        part.bus_mut().add_region(spare).expect("a free address");
        let exti_slot = part.bus().slot("EXTI").expect("the part has an EXTI");
        let hse_timer_slot = part.bus().slot("TIM11").expect("the part has TIM11");
        let otg = Otg::new::<otg_fs_global::Register>(&F446_OTG_FS, host, part.bus_mut());
        Self {
            model,
            part,
            exti: Exti::default(),
            exti_slot,
            otg: otg.expect("a free window"),
            hse_timer: HseTimer::new(model.facts().reset_hz),
            hse_timer_slot,
        }
    }

    /// Returns the index, in the emulator's array of SPIs, of the SPI to which the board connects
    /// the converters: SPI3 on an ironbci, SPI2 on a NUCLEO-F446RE.
    const fn spi(&self) -> usize {
        match self.model {
            Model::Ironbci => 2,
            _ => 1,
        }
    }

    /// Returns the index, in the emulator's array of serial ports, of the port to the host: UART5
    /// on an ironbci, USART2 on a NUCLEO-F446RE.
    const fn uart(&self) -> usize {
        match self.model {
            Model::Ironbci => 7,
            _ => 1,
        }
    }

    /// Returns the index of the GPIO port that SYSCFG connects to the EXTI line `line` (RM0390,
    /// SYSCFG_EXTICR1 to 4).
    fn routed_port(&self, line: u8) -> u64 {
        let registers = self.bus().registers("SYSCFG").expect("the part has SYSCFG");
        let register = match line / 4 {
            0 => syscfg::Register::Exticr1,
            1 => syscfg::Register::Exticr2,
            2 => syscfg::Register::Exticr3,
            _ => syscfg::Register::Exticr4,
        };
        registers.get(register) >> (4 * u32::from(line % 4)) & 0xF
    }
}

impl Mcu for F4 {
    fn bus(&self) -> &Bus {
        self.part.bus()
    }

    fn bus_mut(&mut self) -> &mut Bus {
        self.part.bus_mut()
    }

    fn reset(&mut self, at: VirtualNanos, cause: ResetCause) {
        self.part.reset(at, cause);
        // Change the temperature, because the firmware derives the session id from readings of the
        // temperature: if they were the same, every start would have the same id.
        let warmer = i32::try_from(at.0 / 1_000_000 % 1_000).unwrap_or_default();
        self.part.adc[0].set_temperature(2_500 + warmer);
        self.exti.reset_registers();
        self.otg.reset();
    }

    fn poll(&mut self, now: VirtualNanos) {
        self.part.poll(now);
        self.otg.poll(now, self.part.bus_mut());
    }

    fn split(&mut self, slot: usize) -> (&mut Bus, Option<&mut dyn ErasedDevice>) {
        let (bus, model) = self.part.split(slot);
        if slot == self.exti_slot {
            return (bus, Some(&mut self.exti));
        }
        if slot == self.hse_timer_slot {
            let clocks = bus.registers("RCC").expect("the part has an RCC");
            self.hse_timer.divider = rcc::cfgr::RTCPRE.get(clocks.get(rcc::Register::Cfgr));
            return (bus, Some(&mut self.hse_timer));
        }
        if let Some(model) = self.otg.model(slot, bus) {
            return (bus, Some(model));
        }
        (bus, model)
    }
}

impl Chip for F4 {
    /// Describes a Cortex-M4F (DS10693, 3.1) that boots from flash (RM0390, 2.4).
    fn core(&self, instructions_per_second: NonZeroU64) -> CoreSpec {
        let facts = self.model.facts();
        let lines = u32::from(self.cpu().interrupt_lines);
        let core = Core {
            variant: Variant::M4,
            clock_hz: NonZeroU64::new(facts.core_hz).expect("a core clock above 0"),
            interrupt_lines: NonZeroU32::new(lines).expect("at least one interrupt"),
            priority_bits: 4,
            refclk_divider: NonZeroU32::new(8).expect("a divider above 0"),
            instructions_per_second,
            boot: "flash",
        };
        let mut config = Config::new(core, &windows(self.bus()));
        config.fpu = Fpu::FpV4Sp;
        config.mpu_regions = MpuRegions::Eight;
        config.spec()
    }

    common_to_all_chips!(Tim::with_clock(1, TIMERS[TIMER].counter));

    fn redirects(&self) -> Vec<Redirect> {
        let spare = Redirect { from: DCKCFGR2..DCKCFGR2 + 4, to: SPARE };
        vec![spare, self.otg.redirect()]
    }

    /// Returns the frequency of SCLK: PCLK1 divided by 2^(BR + 1) (RM0390, register SPI_CR1).
    fn sclk_hz(&self) -> u32 {
        let spi = SERIAL_INTERFACES[self.spi()];
        let spi = self.bus().registers(spi).expect("the part has the SPI");
        let rcc = self.bus().registers("RCC").expect("the part has an RCC");
        let divider = spi1::cr1::BR.get(spi.get(spi1::Register::Cr1)) + 1;
        let hz = self.part.rcc.pclk1(rcc) >> divider;
        u32::try_from(hz).unwrap_or(u32::MAX)
    }

    fn core_hz(&self) -> u64 {
        let registers = self.bus().registers("RCC").expect("the part has an RCC");
        self.part.rcc.hclk(registers)
    }

    fn drive(&mut self, at: VirtualNanos, pin: Pin, is_high: bool) {
        self.drive_part(at, pin, is_high);
        let is_routed = self.routed_port(pin.1) == u64::from(pin.0);
        let (registers, mut context) = self.part.bus_mut().drive(at, self.exti_slot);
        self.exti.set_level(pin, is_high, is_routed, registers, &mut context);
    }
}
