//! The image: runs every vector, says on the host's standard output what came of each, and ends with an
//! exit status, all by semihosting. QEMU understands that, and `probe-rs run`.
//!
//! It starts no clock and no cache: a board runs it as it comes out of its reset.
#![cfg_attr(target_os = "none", no_std)]
#![cfg_attr(target_os = "none", no_main)]
#![forbid(unsafe_code)]

/// On a PC `cargo test --package on-target` runs the vectors.
#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("this image runs on a microcontroller: `cargo xtask hil`");
}

#[cfg(target_os = "none")]
mod clock;

#[cfg(target_os = "none")]
mod image {
    use core::panic::PanicInfo;

    use cortex_m_rt::entry;
    use cortex_m_semihosting::{debug, hprintln};
    use on_target::{Device, VECTORS};
    use static_cell::StaticCell;

    use crate::clock;

    /// Made at the start: as an initialised variable it would take 22 KB of flash, which a NUCLEO-F446RE does
    /// not have beside the model.
    static DEVICE: StaticCell<Device> = StaticCell::new();

    /// Says one line for each vector, `passed TICKS NAME` or `FAILED NAME: WHY`, and at last how many
    /// there are.
    #[entry]
    fn main() -> ! {
        let Some(mut core) = cortex_m::Peripherals::take() else {
            end(false)
        };
        clock::start(&mut core.SYST);
        let device = device();
        let mut failed = 0;
        for vector in VECTORS {
            let begin = clock::ticks();
            let outcome = (vector.check)(device);
            let ticks = clock::ticks() - begin;
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

    /// Not part of `main`, whose frame stays on the stack for ever.
    #[inline(never)]
    fn device() -> &'static mut Device {
        DEVICE.init_with(Device::new)
    }

    /// Ends the emulation, or the host's command.
    fn end(well: bool) -> ! {
        loop {
            debug::exit(if well {
                debug::EXIT_SUCCESS
            } else {
                debug::EXIT_FAILURE
            });
        }
    }

    #[panic_handler]
    fn panic(info: &PanicInfo<'_>) -> ! {
        hprintln!("{}", info);
        end(false)
    }
}
