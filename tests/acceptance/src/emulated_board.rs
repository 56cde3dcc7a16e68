//! The firmware on a microcontroller that QEMU emulates in real time, with a TCP port for its host.

use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use emulator::{Image, MACHINES, Qemu, Uart, pipes};
use pipeline::CHANNELS;

use crate::process::Process;

/// Name of both the package that contains the firmware image and the image itself.
const IMAGE: &str = "board-qemu";

/// Name of the file in the emulation's folder from which the image reads its samples as 32-bit ADC
/// counts, little endian.
const SAMPLES: &str = "samples.i32";

/// Sampling rate of the emulated converter, Hz.
const RATE_HZ: u32 = 512;

/// Value of QEMU's option `-icount shift`: each instruction takes 2^4 ns of virtual time.
const INSTRUCTION_SHIFT: u8 = 4;

/// Builds the image for a Cortex-M4F with the build profile that real boards use.
///
/// # Panics
/// When the image does not build.
pub fn image() -> Image {
    let [cortex_m4f, _] = MACHINES;
    Image::build(IMAGE, IMAGE, cortex_m4f.features).unwrap_or_else(|error| panic!("{error}"))
}

/// Starts the image on an emulated Cortex-M4F. Its UART is connected to TCP port `port` of
/// 127.0.0.1, and its converter reads `samples`.
///
/// Virtual time counts instructions, but each sample arrives when it is due by the wall clock. If
/// the PC is too slow for real time, the emulated board waits for the samples, and its virtual time
/// does not show the delay.
///
/// # Panics
/// When the folder cannot be written, or QEMU does not start.
pub fn start(
    image: &Image,
    port: u16,
    folder: &Path,
    samples: impl Iterator<Item = [i32; CHANNELS]> + Send + 'static,
) -> Process {
    pipes::feed(&folder.join(SAMPLES), paced(samples)).expect("a named pipe");
    let [cortex_m4f, _] = MACHINES;
    let mut qemu = Qemu::new(image, cortex_m4f, folder, &[IMAGE]);
    qemu.instruction_time(INSTRUCTION_SHIFT).uart(Uart::Tcp(port));
    Process::start("qemu", &mut qemu.into_command(), folder).expect("QEMU starts")
}

/// Returns an iterator that gives each sample as bytes, and sleeps until the sample is due.
fn paced(samples: impl Iterator<Item = [i32; CHANNELS]>) -> impl Iterator<Item = Vec<u8>> {
    let mut start = None;
    (1..).zip(samples).map(move |(index, counts)| {
        let start = *start.get_or_insert_with(Instant::now);
        let due = start + Duration::from_secs(1) * index / RATE_HZ;
        thread::sleep(due.saturating_duration_since(Instant::now()));
        counts.map(i32::to_le_bytes).as_flattened().to_vec()
    })
}
