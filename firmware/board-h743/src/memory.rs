//! Sets up the memory that the DMA can access, and the caches.
#![expect(unsafe_code, reason = "the MPU, and memory that nothing initialises")]

use board_stm32::FRAME_BYTES;
#[cfg(feature = "uart")]
use board_stm32::PortMemory;
use cortex_m::Peripherals;
use device::ModelSlot;
use embassy_stm32::pac::RCC;
use grounded::uninit::GroundedCell;

/// Buffers through which DMA1 transfers data of the converters and the port.
pub(crate) struct DmaMemory {
    /// Buffer for SPI transfers to and from the converters.
    pub(crate) converters: [u8; FRAME_BYTES],
    /// Buffers for the bytes to and from the host, over the UART.
    #[cfg(feature = "uart")]
    pub(crate) port: PortMemory,
}

/// Memory for the DMA's buffers, in SRAM1 (domain D2). All other variables are in the DTCM, which
/// DMA1 cannot access.
#[unsafe(link_section = ".dma")]
static DMA_MEMORY: GroundedCell<DmaMemory> = GroundedCell::uninit();

/// Memory for a model that the host uploads, in AXI SRAM (domain D1), which always has its
/// clock. Only the core reads and writes it, through the cache.
#[unsafe(link_section = ".slot")]
static MODEL_SLOT: GroundedCell<ModelSlot> = GroundedCell::uninit();

/// Start address of SRAM1 (RM0433, section 2.3).
const SRAM1: u32 = 0x3000_0000;
/// Value of the MPU's attribute and size register (RASR) for SRAM1: an enabled region of 2^(16 + 1)
/// bytes, normal memory, shared and not cached (TEX 001, C 0, B 0, S 1), readable and writable,
/// never executed (ARM DDI 0403, B3.5.9).
const SRAM1_UNCACHED: u32 = 1 << 28 | 0b011 << 24 | 0b001 << 19 | 1 << 18 | 16 << 1 | 1;
/// Value of RASR for all memory, 4 GB: no access, never executed, strongly ordered (TEX 000, C 0, B
/// 0, S 1). The sub-regions 0, 1, 2 and 7, of 512 MB each, are excluded. The remaining addresses,
/// 0x6000_0000 to 0xDFFF_FFFF, have no memory, and the core could otherwise read them speculatively
/// (Arm DDI 0489 on the Cortex-M7; erratum 1013783; as in the examples of ST's STM32CubeH7).
const NOTHING_FITTED: u32 = 1 << 28 | 1 << 18 | 0x87 << 8 | 31 << 1 | 1;
/// Start address of the system memory, with the boot loader.
const SYSTEM_MEMORY: u32 = 0x1FF0_0000;
/// Value of RASR for the system memory, 512 KB: strongly ordered, readable and writable, never
/// executed. A speculative read there could raise an error of the flash (as in Zephyr's
/// `mpu_regions.c` for this chip).
const NOT_SPECULATIVE: u32 = 1 << 28 | 0b011 << 24 | 1 << 18 | 18 << 1 | 1;
/// Value of the MPU's control register: enabled, with the architecture's default attributes for
/// memory outside every region.
const ON_WITH_DEFAULTS: u32 = 0b101;

/// Enables SRAM1 and the caches, and returns the DMA's buffers and the empty model slot. The
/// buffers are not cached, so that core and DMA always see the same data. Taking the core's
/// peripherals by value allows only one call.
pub(crate) fn init(mut core: Peripherals) -> (&'static mut DmaMemory, &'static mut ModelSlot) {
    RCC.ahb2enr().modify(|enable| enable.set_sram1en(true));
    // The clock of SRAM1 starts with a delay; a read of the clock enable register waits until the
    // clock runs (RM0433, RCC).
    let _ = RCC.ahb2enr().read();
    // SAFETY: no MPU region is in use, and the caches are still off.
    unsafe { core.MPU.ctrl.write(0) };
    // Where two regions overlap, the region with the higher number applies.
    for (region, start, attributes) in
        [(0, 0, NOTHING_FITTED), (1, SRAM1, SRAM1_UNCACHED), (2, SYSTEM_MEMORY, NOT_SPECULATIVE)]
    {
        // SAFETY: the MPU is off; the chip has 16 regions.
        unsafe { core.MPU.rnr.write(region) };
        // SAFETY: the MPU is off; the address is a multiple of the region's size.
        unsafe { core.MPU.rbar.write(start) };
        // SAFETY: the MPU is off; the regions forbid access only where no code and no variable is,
        // and execution only where this program has no code.
        unsafe { core.MPU.rasr.write(attributes) };
    }
    // SAFETY: all regions are complete; all other memory keeps its default attributes.
    unsafe { core.MPU.ctrl.write(ON_WITH_DEFAULTS) };
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
    core.SCB.enable_icache();
    core.SCB.enable_dcache(&mut core.CPUID);

    let memory = DMA_MEMORY.get();
    // SAFETY: `memory` points to SRAM1, whose clock runs now, and no reference to this memory
    // exists yet.
    unsafe {
        memory.write(DmaMemory {
            converters: [0; FRAME_BYTES],
            #[cfg(feature = "uart")]
            port: PortMemory::EMPTY,
        });
    }
    let slot = MODEL_SLOT.get();
    // Cleared in place: a temporary slot, 258 KB, would not fit on the stack.
    // SAFETY: `slot` points to AXI SRAM, and no reference to this memory exists yet.
    unsafe { slot.write_bytes(0, 1) };
    // SAFETY: `memory` is initialised above. This is the only reference to it, because `init`
    // consumes `core`, of which only one value exists.
    let memory = unsafe { &mut *memory };
    // SAFETY: all bytes of `slot` are 0, which are a valid slot, because it implements `FromZeros`.
    // This is the only reference to it, as above.
    let slot = unsafe { &mut *slot };
    (memory, slot)
}
