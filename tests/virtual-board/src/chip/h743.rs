//! The STM32H743: the emulator's part, with added models of the watchdog and of USB.

mod watchdog;

use std::mem;
use std::num::{NonZeroU32, NonZeroU64};

use rigless::chip::uart::{self, Rate};
use rigless::cpu::armv7m::windows;
use rigless::device::{ErasedDevice, Level, ResetCause};
use rigless::emulator::CoreSpec;
use rigless::machine::armv7m::{BranchPrediction, Caches, Config, Core, Fpu, MpuRegions, Variant};
use rigless::mcu::{Mcu, Operate};
use rigless::soc::Bus;
use rigless::soc::stm32h743::Stm32h743;
use rigless::soc::stm32h743::generated::{gpioa, otg1_hs_global, rcc, spi1, tim17};
use rigless::soc::stm32h743::peripherals::gpio::{Gpio, PORTS, Pin as PartPin};
use rigless::soc::stm32h743::peripherals::rng::{self, Rng};
use rigless::soc::stm32h743::peripherals::tim::{Channel, TIMERS, Tim};
use rigless::time::VirtualNanos;

use crate::chain::Chain;
use crate::chip::Chip;
use crate::chip::hse_timer::HseTimer;
use crate::core_bus::Redirect;
use crate::model::{Model, Pin};
use crate::usb::host::UsbHost;
use crate::usb::instance::H743_USB2;
use crate::usb::otg::Otg;

use watchdog::Watchdog;

/// Index, in the emulator's array of SPIs, of SPI1, which is connected to the converters.
const SPI: usize = 0;
/// Index, in the emulator's array of USARTs, of USART3, which is connected to the ST-LINK.
const UART: usize = 2;
/// Index, in the emulator's array of timers, of TIM2, whose channel 3 captures the trigger.
const TIMER: usize = 0;
/// Number of the alternate function that connects TIM2 to pin PB10 (DS12110, table 10).
const TIMER_FUNCTION: u8 = 1;

/// Address of RCC_CR and its bit HSERDY, set once the external clock is stable (RM0433, 8.7.2).
const RCC_CR: u64 = 0x5802_4400;
const HSERDY: u64 = 1 << 17;

/// Address of the USB core's register GRSTCTL, and its bit AHBIDL.
const GRSTCTL: u64 = 0x4008_0000 + 0x10;
const AHBIDL: u64 = 1 << 31;

/// Names of peripherals, separated by blanks, whose models are removed because the firmware does
/// not use them. The emulator polls every model for every byte of a DMA transfer, which would take
/// half of the emulation's time. [`Findings::unimplemented`](crate::findings::Findings) lists
/// accesses to these peripherals.
const REMOVED_MODELS: &str = "SPI2 SPI3 SPI4 SPI5 SPI6 I2C1 I2C2 I2C3 I2C4 ADC1 ADC2 ADC3 ADC12_COMMON ADC3_COMMON \
    SDMMC1 SDMMC2 TIM1 TIM3 TIM4 TIM5 TIM6 TIM7 TIM8 TIM12 TIM13 TIM14 TIM15 TIM16 TIM17 \
    USART1 USART2 USART6 UART4 UART5 UART7 UART8 DMA2 DMAMUX2 BDMA OTG1_HS_GLOBAL GPIOC \
    GPIOF GPIOG GPIOI GPIOJ GPIOK GPIOH LPUART1";

/// An emulated STM32H743: the emulator's model of the part, and added models of watchdog and USB.
#[derive(Debug)]
pub(crate) struct H743 {
    part: Stm32h743,
    watchdog: Watchdog,
    watchdog_slot: usize,
    uart_slot: usize,
    otg: Otg,
    hse_timer: HseTimer<tim17::Register>,
    hse_timer_slot: usize,
    /// Whether the peripheral model in each slot of the emulator has been removed.
    removed: Box<[bool]>,
}

impl H743 {
    /// Creates a powered chip without an external clock, with `host` at the other end of its USB
    /// cable.
    ///
    /// # Panics
    /// When the emulator's description of the part contradicts itself.
    pub(crate) fn new(host: &UsbHost) -> Self {
        let mut part = Stm32h743::new().expect("the emulator's own part");
        part.set_supply(3300);
        part.set_analog_supply(3300);
        let watchdog_slot = part.bus().slot("IWDG").expect("the part has a watchdog");
        let uart_slot = part.bus().slot("USART3").expect("the part has USART3");
        let removed: Vec<&str> = REMOVED_MODELS.split(' ').collect();
        let slots = part.bus().slots().iter();
        let removed = slots.map(|slot| removed.contains(&slot.peripheral().name));
        let removed = removed.collect();
        let hse_timer_slot = part.bus().slot("TIM17").expect("the part has TIM17");
        let otg = Otg::new::<otg1_hs_global::Register>(&H743_USB2, host, part.bus_mut());
        Self {
            part,
            watchdog: Watchdog::default(),
            watchdog_slot,
            uart_slot,
            otg: otg.expect("a free window"),
            hse_timer: HseTimer::new(Model::H743.facts().reset_hz),
            hse_timer_slot,
            removed,
        }
    }

    #[expect(clippy::unused_self, reason = "common to all chips")]
    const fn spi(&self) -> usize {
        SPI
    }

    #[expect(clippy::unused_self, reason = "common to all chips")]
    const fn uart(&self) -> usize {
        UART
    }
}

impl Mcu for H743 {
    fn bus(&self) -> &Bus {
        self.part.bus()
    }

    fn bus_mut(&mut self) -> &mut Bus {
        self.part.bus_mut()
    }

    fn reset(&mut self, at: VirtualNanos, cause: ResetCause) {
        self.part.reset(at, cause);
        // Reseed the random number generator: otherwise it would repeat its numbers after a reset,
        // and the session id, which the firmware takes from it, would be the same.
        self.part.rng = Rng::seeded(rng::RESET_AHB_HZ, rng::KERNEL_HZ, at.0);
        self.watchdog = Watchdog::default();
        self.otg.reset();
    }

    fn poll(&mut self, now: VirtualNanos) {
        // Of the emulator's models, poll only the UART, which serves the host: polling all is slow.
        let (bus, uart) = self.part.split(self.uart_slot);
        let (registers, mut context) = bus.drive(now, self.uart_slot);
        if let Some(uart) = uart {
            uart.poll(registers, &mut context);
        }
        self.otg.poll(now, self.part.bus_mut());
    }

    fn split(&mut self, slot: usize) -> (&mut Bus, Option<&mut dyn ErasedDevice>) {
        let (bus, model) = self.part.split(slot);
        if slot == self.watchdog_slot {
            return (bus, Some(&mut self.watchdog));
        }
        if slot == self.hse_timer_slot {
            let clocks = bus.registers("RCC").expect("the part has an RCC");
            self.hse_timer.divider = rcc::cfgr::RTCPRE.get(clocks.get(rcc::Register::Cfgr));
            return (bus, Some(&mut self.hse_timer));
        }
        if let Some(model) = self.otg.model(slot, bus) {
            return (bus, Some(model));
        }
        let is_removed = self.removed.get(slot).copied().unwrap_or(false);
        (bus, model.filter(|_| !is_removed))
    }
}

impl Chip for H743 {
    /// Describes a Cortex-M7 r1p1 with 16 KiB each of instruction and data cache (DS12110, 3.1;
    /// PM0253, tables 52, 77 and 81) that boots from flash (RM0433, 2.6).
    fn core(&self, instructions_per_second: NonZeroU64) -> CoreSpec {
        let facts = Model::H743.facts();
        let lines = u32::from(self.cpu().interrupt_lines);
        let core = Core {
            variant: Variant::M7,
            clock_hz: NonZeroU64::new(facts.core_hz).expect("a core clock above 0"),
            interrupt_lines: NonZeroU32::new(lines).expect("at least one interrupt"),
            priority_bits: 4,
            refclk_divider: NonZeroU32::new(8).expect("a divider above 0"),
            instructions_per_second,
            boot: "flash",
        };
        let mut config = Config::new(core, &windows(self.bus()));
        config.fpu = Fpu::FpV5Dp;
        // Leave out the MPU, because checking every access against it takes a quarter of the
        // emulator's time. The firmware uses it only to set cache attributes for the DMA's memory,
        // and caches have no effect in the emulator.
        config.mpu_regions = MpuRegions::None;
        config.cpuid = 0x411F_C271;
        config.caches = Some(Caches {
            clidr: 0x0900_0003,
            ctr: 0x8303_C003,
            ccsidr: &[0xF00F_E019, 0xF01F_E009],
        });
        config.branch_prediction = BranchPrediction::Always;
        config.vector_table = Some(0x0800_0000);
        config.spec()
    }

    common_to_all_chips!(Tim::new(TIMERS[TIMER]));

    fn redirects(&self) -> Vec<Redirect> {
        vec![self.otg.redirect()]
    }

    /// Returns the frequency of SCLK: the SPI's kernel clock over 2^(MBR + 1) (RM0433, SPI_CFG1).
    fn sclk_hz(&self) -> u32 {
        let registers = self.bus().registers("SPI1").expect("the part has SPI1");
        let divider = spi1::cfg1::MBR.get(registers.get(spi1::Register::Cfg1)) + 1;
        let hz = self.part.spi[SPI].kernel_hz() >> divider;
        u32::try_from(hz).unwrap_or(u32::MAX)
    }

    fn core_hz(&self) -> u64 {
        let registers = self.bus().registers("RCC").expect("the part has an RCC");
        self.part.rcc.cpu_clock(registers)
    }

    fn drive(&mut self, at: VirtualNanos, pin: Pin, is_high: bool) {
        self.drive_part(at, pin, is_high);
    }
}
