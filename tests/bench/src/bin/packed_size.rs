//! Image with only the packed encoder. The image's size is the flash that it needs, and the fact
//! that it links proves that no path through it panics or allocates.
#![cfg_attr(target_os = "none", no_std)]
#![cfg_attr(target_os = "none", no_main)]

/// Built for a PC, the program only prints what it is for.
#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("this image is measured, not run: `cargo xtask bench packed`");
}

#[cfg(target_os = "none")]
#[expect(unsafe_code, reason = "names a function that nobody defines")]
mod image {
    use core::{hint::black_box, panic::PanicInfo};

    use cortex_m_rt::entry;
    use pipeline::{PackedEncoder, Step};

    #[entry]
    fn main() -> ! {
        let mut encoder = PackedEncoder::new();
        loop {
            let step = black_box(Step::default());
            black_box(encoder.encode_step(&step));
        }
    }

    unsafe extern "C" {
        /// Defined nowhere, so that an image with a reachable panic does not link.
        safe fn the_path_from_step_to_packed_code_can_panic() -> !;
    }

    #[panic_handler]
    fn panic(_: &PanicInfo) -> ! {
        the_path_from_step_to_packed_code_can_panic()
    }
}
