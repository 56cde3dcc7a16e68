//! Runs a board for a host at a TCP port, in real time or slower.

use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread;
use std::time::{Duration, Instant};

use crate::diagnosis::BoardError;
use crate::machine::VirtualBoard;
use crate::tcp::TcpPort;

/// Interval at which bytes are transferred between board and host, in us of virtual time.
const SLICE_US: u64 = 1_000;

/// Time without SPI or port traffic after which a board counts as stopped, in us of virtual time. The
/// firmware retries a failed start of the converters at shorter intervals, so such a board does not count
/// as stopped.
const IDLE_US: u64 = 10_000_000;

/// Interval between two status lines on the console, in us of virtual time.
const REPORT_US: u64 = 10_000_000;

/// Runs a board for a host that connects to the TCP port, never faster than real time, until `stop` is true
/// or `seconds` of virtual time since power-on have passed.
///
/// # Errors
/// The emulator fails, or the board has had no SPI or port traffic for 10 s of virtual time. The error
/// contains a diagnosis.
pub fn run(
    board: &mut VirtualBoard,
    tcp: &mut TcpPort,
    seconds: Option<u64>,
    stop: &AtomicBool,
    mut console: impl Write,
) -> Result<(), BoardError> {
    let start = Instant::now();
    let first_us = board.now_us();
    let (mut progressed_us, mut traffic, mut sent) = (first_us, 0, 0_u64);
    let mut reported = first_us;
    while !stop.load(Relaxed) && seconds.is_none_or(|seconds| board.now_us() < seconds * 1_000_000)
    {
        board.advance_us(SLICE_US)?;
        let now = board.now_us();
        sent += tcp.serve(board.port()) as u64;
        let total = board.spi_words() + sent;
        if total != traffic {
            (progressed_us, traffic) = (now, total);
        }
        if now - progressed_us > IDLE_US {
            return Err(board.error(format!(
                "no progress for {} s of virtual time",
                IDLE_US / 1_000_000
            )));
        }
        if now - reported >= REPORT_US {
            let count = board.findings()?.resets.len();
            reported = now;
            let real = start.elapsed().as_secs_f64();
            let state = if tcp.is_connected() {
                "a host is connected"
            } else {
                "no host is connected"
            };
            // The board keeps running even if the console is closed.
            let _ = writeln!(
                console,
                "{} s of virtual time in {real:.0} s, {sent} bytes to the host, {count} resets, {state}",
                now / 1_000_000,
            );
        }
        let ahead = Duration::from_micros(now - first_us).saturating_sub(start.elapsed());
        // Sleeps only when more than 5 ms ahead of real time, to avoid a thousand wake-ups per second.
        if ahead > Duration::from_millis(5) {
            thread::sleep(ahead);
        }
    }
    Ok(())
}
