//! What a host says at set times, from a file: the same in every run, where a pipe's bytes come when the
//! PC has time.

use embassy_time::{Instant, Timer};

use crate::{host_file::HostFile, uart};

/// The file: commands, each with when, in which run and how many bytes, all little endian, and then the
/// bytes.
pub(crate) const COMMANDS: &core::ffi::CStr = c"commands.bin";

/// Bytes in front of a command: device time in microseconds, 64 bits; boot, counted from 1, and length,
/// 32 bits each.
const HEAD: usize = 16;

/// Bytes that come at once, without a wait in between.
const PIECE: usize = 64;

/// Says what is for this boot, at its times, as if it came through the UART.
pub(crate) async fn say(mut file: HostFile, boot: u32) {
    let mut head = [0; HEAD];
    while file.read(&mut head) {
        let [at_us, rest] = head.as_chunks::<8>().0 else {
            return;
        };
        let at_us = u64::from_le_bytes(*at_us);
        let [of, length] = rest.as_chunks::<4>().0 else {
            return;
        };
        let mut length = usize::try_from(u32::from_le_bytes(*length)).unwrap_or(0);
        let is_for_now = u32::from_le_bytes(*of) == boot;
        if is_for_now {
            Timer::at(Instant::from_micros(at_us)).await;
        }
        let mut piece = [0; PIECE];
        while length > 0 {
            let count = length.min(PIECE);
            if !file.read(&mut piece[..count]) {
                return;
            }
            if is_for_now {
                uart::take_in(&piece[..count]);
            }
            length -= count;
        }
    }
}
