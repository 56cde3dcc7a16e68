//! Image that runs every golden vector, prints the results on the host's standard output, and ends
//! with an exit status, all by semihosting, which QEMU and `probe-rs run` support.
//!
//! The image configures neither clocks nor caches: on a board it runs with the reset settings.
#![cfg_attr(target_os = "none", no_std)]
#![cfg_attr(target_os = "none", no_main)]
#![forbid(unsafe_code)]

#[cfg(not(target_os = "none"))]
mod board;

/// Runs the image on a board: built for a PC, this program controls the probe.
#[cfg(not(target_os = "none"))]
fn main() -> std::process::ExitCode {
    board::run()
}

#[cfg(target_os = "none")]
mod image {
    use core::panic::PanicInfo;
    use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

    use cortex_m::peripheral::{SYST, syst::SystClkSource};
    use cortex_m_rt::{entry, exception};
    use cortex_m_semihosting::{debug, hprintln};
    use on_target::{Device, VECTORS};
    use static_cell::StaticCell;

    /// State of the pipeline, initialised at run time: a static initial value would take 22 KB of
    /// flash, which a NUCLEO-F446RE does not have besides the model.
    static DEVICE: StaticCell<Device> = StaticCell::new();

    /// Runs all vectors. Prints `passed TICKS NAME` or `FAILED NAME: WHY` for each, and a last line
    /// with the numbers of vectors and of failures.
    #[entry]
    fn main() -> ! {
        let Some(mut core) = cortex_m::Peripherals::take() else { end(false) };
        start_clock(&mut core.SYST);
        let device = device();
        let mut failed = 0;
        for vector in VECTORS {
            let start = ticks();
            let outcome = (vector.check)(device);
            let ticks = ticks() - start;
            match outcome {
                Ok(()) => hprintln!("passed {} {}", ticks, vector.name),
                Err(mismatch) => {
                    failed += 1;
                    hprintln!("FAILED {}: {}", vector.name, mismatch);
                }
            }
        }
        hprintln!("{} vectors, {} failed", VECTORS.len(), failed);
        end(failed == 0)
    }

    /// Creates the pipeline's state. Not inlined, so that its large stack frame is freed when it
    /// returns.
    #[inline(never)]
    fn device() -> &'static mut Device {
        DEVICE.init_with(Device::new)
    }

    /// Value from which SysTick, a 24-bit timer, counts down to 0 again and again (ARMv7-M
    /// Architecture Reference Manual, B3.3).
    const RELOAD: u32 = 0x00ff_ffff;

    /// Number of times that SysTick has counted down to 0.
    static ENDS: AtomicU32 = AtomicU32::new(0);

    /// Starts SysTick as the clock; QEMU does not emulate the DWT's 32-bit cycle counter.
    fn start_clock(timer: &mut SYST) {
        timer.set_clock_source(SystClkSource::Core);
        timer.set_reload(RELOAD);
        timer.clear_current();
        timer.enable_interrupt();
        timer.enable_counter();
    }

    /// Returns the number of clock ticks since [`start_clock`]: processor cycles on a board,
    /// periods of a 25 MHz clock on QEMU's MPS2 boards.
    fn ticks() -> u64 {
        loop {
            let ends = ENDS.load(Relaxed);
            let left = SYST::get_current();
            if ends == ENDS.load(Relaxed) {
                let period = u64::from(RELOAD) + 1;
                return u64::from(ends) * period + u64::from(RELOAD - left);
            }
        }
    }

    #[exception]
    fn SysTick() {
        ENDS.fetch_add(1, Relaxed);
    }

    /// Ends the emulation or `probe-rs run`, with exit status 0 only if `success` is true.
    fn end(success: bool) -> ! {
        loop {
            debug::exit(if success { debug::EXIT_SUCCESS } else { debug::EXIT_FAILURE });
        }
    }

    #[panic_handler]
    fn panic(info: &PanicInfo<'_>) -> ! {
        hprintln!("{}", info);
        end(false)
    }
}
