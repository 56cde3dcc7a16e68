//! Memory for the DMA, and caches.
#![expect(unsafe_code, reason = "the MPU, and memory that nothing initialises")]

use board_stm32::FRAME_BYTES;
#[cfg(feature = "uart")]
use board_stm32::PortMemory;
use cortex_m::Peripherals;
use embassy_stm32::pac::RCC;
use grounded::uninit::GroundedCell;

/// What DMA1 reads and writes.
pub(crate) struct Reachable {
    /// Frames of the converters.
    pub(crate) converters: [u8; FRAME_BYTES],
    /// Bytes from and to the host.
    #[cfg(feature = "uart")]
    pub(crate) port: PortMemory,
}

/// In the D2 domain: DMA1 does not reach the DTCM, where all other variables are.
#[unsafe(link_section = ".dma")]
static REACHABLE: GroundedCell<Reachable> = GroundedCell::uninit();

/// SRAM1 (RM0433, 2.3).
const SRAM1: u32 = 0x3000_0000;
/// A region of 2^(16 + 1) bytes, enabled: normal memory that is shared and not cached (TEX 001, C 0, B 0,
/// S 1), read and written, never executed (ARM DDI 0403, B3.5.9).
const SRAM1_UNCACHED: u32 = 1 << 28 | 0b011 << 24 | 0b001 << 19 | 1 << 18 | 16 << 1 | 1;
/// The MPU on; what has no region stays as the architecture has it.
const ON_WITH_DEFAULTS: u32 = 0b101;

/// Switches SRAM1 and the caches on; returns memory that core and DMA see alike. It takes the core's
/// peripherals, because there is one such memory.
pub(crate) fn begin(mut core: Peripherals) -> &'static mut Reachable {
    RCC.ahb2enr().modify(|enable| enable.set_sram1en(true));
    // The clock runs a little later; a read from the register waits for it (RM0433, RCC).
    let _ = RCC.ahb2enr().read();
    // SAFETY: no region is in use, and the caches are still off.
    unsafe { core.MPU.ctrl.write(0) };
    // SAFETY: as above; region 0 exists.
    unsafe { core.MPU.rnr.write(0) };
    // SAFETY: as above; the address is a multiple of the region's size.
    unsafe { core.MPU.rbar.write(SRAM1) };
    // SAFETY: as above; nothing is executed from there.
    unsafe { core.MPU.rasr.write(SRAM1_UNCACHED) };
    // SAFETY: all other memory keeps its attributes.
    unsafe { core.MPU.ctrl.write(ON_WITH_DEFAULTS) };
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
    core.SCB.enable_icache();
    core.SCB.enable_dcache(&mut core.CPUID);

    let memory = REACHABLE.get();
    // SAFETY: SRAM1 has a clock now, and nothing else refers to it.
    unsafe {
        memory.write(Reachable {
            converters: [0; FRAME_BYTES],
            #[cfg(feature = "uart")]
            port: PortMemory::EMPTY,
        });
    }
    // SAFETY: initialised above; the only reference, because `core` exists once.
    unsafe { &mut *memory }
}
