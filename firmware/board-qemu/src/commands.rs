//! Commands of a simulated host, read from a file and delivered at the same device times in every
//! emulation. Commands from a pipe would arrive at times that depend on the PC.

use embassy_time::{Instant, Timer};

use crate::{semihosting::HostFile, uart};

/// Name of the file of commands. For each command it holds a header of [`HEAD`] bytes, little
/// endian, followed by the command's bytes.
pub(crate) const COMMANDS: &core::ffi::CStr = c"commands.bin";

/// Length of a header in bytes. It holds the device time in microseconds (64 bits), the number of
/// the boot, counted from 1 (32 bits), and the length of the command in bytes (32 bits).
const HEAD: usize = 16;

/// Largest number of bytes that are read from the file and passed to the UART at once.
const PIECE: usize = 64;

/// Delivers the commands for boot number `boot` at their times, as if the UART received them.
pub(crate) async fn play(mut file: HostFile, boot: u32) {
    let mut head = [0; HEAD];
    while file.read(&mut head) {
        let [at_us, rest] = head.as_chunks::<8>().0 else {
            return;
        };
        let at_us = u64::from_le_bytes(*at_us);
        let [command_boot, length] = rest.as_chunks::<4>().0 else {
            return;
        };
        let mut length = usize::try_from(u32::from_le_bytes(*length)).unwrap_or(0);
        let is_for_this_boot = u32::from_le_bytes(*command_boot) == boot;
        if is_for_this_boot {
            Timer::at(Instant::from_micros(at_us)).await;
        }
        let mut piece = [0; PIECE];
        while length > 0 {
            let count = length.min(PIECE);
            if !file.read(&mut piece[..count]) {
                return;
            }
            if is_for_this_boot {
                uart::push_received(&piece[..count]);
            }
            length -= count;
        }
    }
}
