//! Memory that the DMA can access, and the caches.
#![expect(unsafe_code, reason = "the MPU, and memory that nothing initialises")]

use board_stm32::FRAME_BYTES;
#[cfg(feature = "uart")]
use board_stm32::PortMemory;
use cortex_m::Peripherals;
use embassy_stm32::pac::RCC;
use grounded::uninit::GroundedCell;

/// Buffers that DMA1 reads and writes.
pub(crate) struct DmaMemory {
    /// Buffer of the converters' SPI.
    pub(crate) converters: [u8; FRAME_BYTES],
    /// Buffers of the UART.
    #[cfg(feature = "uart")]
    pub(crate) port: PortMemory,
}

/// In SRAM1, domain D2, because DMA1 cannot access the DTCM, which holds all other variables.
#[unsafe(link_section = ".dma")]
static DMA_MEMORY: GroundedCell<DmaMemory> = GroundedCell::uninit();

/// Address of SRAM1 (RM0433, 2.3).
const SRAM1: u32 = 0x3000_0000;
/// MPU attributes of an enabled region of 2^(16 + 1) bytes: normal memory, shared and not cached (TEX 001, C 0,
/// B 0, S 1), readable and writable, never executed (ARM DDI 0403, B3.5.9).
const SRAM1_UNCACHED: u32 = 1 << 28 | 0b011 << 24 | 0b001 << 19 | 1 << 18 | 16 << 1 | 1;
/// MPU control: enabled; memory without a region keeps the architecture's default attributes.
const ON_WITH_DEFAULTS: u32 = 0b101;

/// Enables SRAM1 and the caches. Returns uncached buffers, so that core and DMA always see the same data. Takes
/// the core's peripherals by value, so that it runs only once.
pub(crate) fn init(mut core: Peripherals) -> &'static mut DmaMemory {
    RCC.ahb2enr().modify(|enable| enable.set_sram1en(true));
    // The clock starts with a delay; a read from the register waits for it (RM0433, RCC).
    let _ = RCC.ahb2enr().read();
    // SAFETY: no region is in use, and the caches are still off.
    unsafe { core.MPU.ctrl.write(0) };
    // SAFETY: as above; region 0 exists.
    unsafe { core.MPU.rnr.write(0) };
    // SAFETY: as above; the address is a multiple of the region's size.
    unsafe { core.MPU.rbar.write(SRAM1) };
    // SAFETY: as above; no code is in that region.
    unsafe { core.MPU.rasr.write(SRAM1_UNCACHED) };
    // SAFETY: all other memory keeps its attributes.
    unsafe { core.MPU.ctrl.write(ON_WITH_DEFAULTS) };
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
    core.SCB.enable_icache();
    core.SCB.enable_dcache(&mut core.CPUID);

    let memory = DMA_MEMORY.get();
    // SAFETY: SRAM1 is clocked now, and nothing else refers to it.
    unsafe {
        memory.write(DmaMemory {
            converters: [0; FRAME_BYTES],
            #[cfg(feature = "uart")]
            port: PortMemory::EMPTY,
        });
    }
    // SAFETY: initialised above; the only reference, because `core` exists once.
    unsafe { &mut *memory }
}
