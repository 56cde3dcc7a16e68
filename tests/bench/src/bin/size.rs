//! Image that contains only the acquisition, the substitution of bad electrodes and the encoder or,
//! with the feature `packed`, the packed encoder. Its size is the flash that they need, and it
//! links only if no path through them panics or allocates.
#![cfg_attr(target_os = "none", no_std)]
#![cfg_attr(target_os = "none", no_main)]

/// Prints what the program is for; a build for a PC does nothing else.
#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("this image is measured, not run: `cargo xtask bench encoder` and `packed`");
}

#[cfg(target_os = "none")]
#[expect(unsafe_code, reason = "names a function that nobody defines")]
mod image {
    use core::{hint::black_box, panic::PanicInfo};

    use cortex_m_rt::entry;
    #[cfg(not(feature = "packed"))]
    use pipeline::{Mains, Pipeline, Sample};
    #[cfg(feature = "packed")]
    use pipeline::{PackedEncoder, Step};

    #[cfg(not(feature = "packed"))]
    #[entry]
    fn main() -> ! {
        let mut pipeline = Pipeline::new(black_box(Mains::Hz50));
        loop {
            let sample = black_box(Sample::default());
            black_box(pipeline.encode_sample(&sample));
        }
    }

    #[cfg(feature = "packed")]
    #[entry]
    fn main() -> ! {
        let mut encoder = PackedEncoder::new();
        loop {
            let step = black_box(Step::default());
            black_box(encoder.encode_step(&step));
        }
    }

    unsafe extern "C" {
        /// Called on panic and defined nowhere, so that an image with a reachable panic does not
        /// link. Nor does an image that allocates, because there is no allocator.
        safe fn the_path_of_a_sample_can_panic() -> !;
    }

    #[panic_handler]
    fn panic(_: &PanicInfo) -> ! {
        the_path_of_a_sample_can_panic()
    }
}
