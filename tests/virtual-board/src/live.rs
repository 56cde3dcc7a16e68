//! A board that runs for a host, in real time or as fast as this machine can.

use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread;
use std::time::{Duration, Instant};

use crate::diagnosis::Trouble;
use crate::machine::VirtualBoard;
use crate::tcp::TcpPort;

/// How often bytes are moved, us of virtual time.
const SLICE_US: u64 = 1_000;

/// A board that has neither clocked a byte of its converters nor sent one for so long has stopped, us of
/// virtual time: a retry of the converters' start comes more often.
const IDLE_US: u64 = 10_000_000;

/// How often the console is told, us of virtual time.
const REPORT_US: u64 = 10_000_000;

/// Runs a board for whoever connects to the port, for some seconds of virtual time or until `stop`; never
/// faster than real time.
///
/// # Errors
/// The emulator fails, or the board makes no progress any more: the diagnosis says where it stands.
pub fn run(
    board: &mut VirtualBoard,
    tcp: &mut TcpPort,
    seconds: Option<u64>,
    stop: &AtomicBool,
    mut console: impl Write,
) -> Result<(), Trouble> {
    let begin = Instant::now();
    let first_us = board.now_us();
    let (mut moved, mut bytes, mut sent) = (first_us, 0, 0_u64);
    let mut reported = first_us;
    while !stop.load(Relaxed) && seconds.is_none_or(|seconds| board.now_us() < seconds * 1_000_000)
    {
        board.pass_us(SLICE_US)?;
        let now = board.now_us();
        sent += tcp.serve(board.port()) as u64;
        let progress = board.spi_bytes() + sent;
        if progress != bytes {
            (moved, bytes) = (now, progress);
        }
        if now - moved > IDLE_US {
            return Err(board.trouble(format!(
                "no progress for {} s of virtual time",
                IDLE_US / 1_000_000
            )));
        }
        if now - reported >= REPORT_US {
            let count = board.findings()?.resets.len();
            reported = now;
            let real = begin.elapsed().as_secs_f64();
            let state = if tcp.is_connected() {
                "a host is connected"
            } else {
                "nobody is connected"
            };
            // Whoever has closed the console does not read it.
            let _ = writeln!(
                console,
                "{} s of virtual time in {real:.0} s, {sent} bytes to the host, {count} resets, {state}",
                now / 1_000_000,
            );
        }
        let ahead = Duration::from_micros(now - first_us).saturating_sub(begin.elapsed());
        // A millisecond at a time would be a thousand wake-ups a second.
        if ahead > Duration::from_millis(5) {
            thread::sleep(ahead);
        }
    }
    Ok(())
}
