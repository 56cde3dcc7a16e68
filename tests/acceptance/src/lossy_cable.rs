//! A simulated cable between a board and its host, which loses frames and can be unplugged.

use std::io::{self, Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

/// Time between two attempts to connect to the board, and timeout of a read from the board.
const RETRY: Duration = Duration::from_millis(20);
/// Time limit for the board to open its port.
const START: Duration = Duration::from_secs(30);

/// A TCP port to which the host connects. It passes bytes between host and board, but loses some of
/// the board's frames. It closes when the board closes its own port.
#[derive(Debug)]
pub struct LossyCable {
    /// Address to which the host connects, in the format of the bridge's option `--port`.
    pub port: String,
    unplugged: Arc<AtomicBool>,
}

impl LossyCable {
    /// Connects to the board on TCP port `port` of 127.0.0.1. The cable loses `percent` percent of
    /// the frames that the board sends.
    ///
    /// # Errors
    /// The board does not open its port in time.
    pub fn new(port: u16, percent: u64) -> io::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
        let address = listener.local_addr()?;
        let board = connect(port)?;
        let unplugged = Arc::<AtomicBool>::default();
        let is_unplugged = Arc::clone(&unplugged);
        thread::spawn(move || pass_on(board, &listener, percent, &is_unplugged));
        Ok(Self { port: format!("tcp:{address}"), unplugged })
    }

    /// Closes the host's connection and discards the board's bytes until [`Self::plug`] is called.
    pub fn unplug(&self) {
        self.unplugged.store(true, Ordering::Relaxed);
    }

    /// Lets the host connect again.
    pub fn plug(&self) {
        self.unplugged.store(false, Ordering::Relaxed);
    }
}

/// Waits until a board has opened TCP port `port` of 127.0.0.1, and connects to it.
///
/// # Errors
/// The board does not open its port in time.
pub fn connect(port: u16) -> io::Result<TcpStream> {
    let end = Instant::now() + START;
    loop {
        match TcpStream::connect(SocketAddr::from((Ipv4Addr::LOCALHOST, port))) {
            Err(_) if Instant::now() < end => thread::sleep(RETRY),
            connected => return connected,
        }
    }
}

fn pass_on(
    mut board: TcpStream,
    listener: &TcpListener,
    percent: u64,
    unplugged: &AtomicBool,
) -> io::Result<()> {
    listener.set_nonblocking(true)?;
    let (mut host, mut random) = (None::<TcpStream>, 1_u64);
    let (mut buffer, mut frame) = ([0; 4096], Vec::new());
    board.set_read_timeout(Some(RETRY))?;
    loop {
        if unplugged.load(Ordering::Relaxed) {
            if let Some(host) = host.take() {
                host.shutdown(std::net::Shutdown::Both)?;
            }
        } else if let Ok((new, _)) = listener.accept() {
            new.set_nonblocking(false)?;
            let (mut commands, mut back) = (new.try_clone()?, board.try_clone()?);
            thread::spawn(move || io::copy(&mut commands, &mut back));
            host = Some(new);
        }
        let count = match board.read(&mut buffer) {
            Ok(0) => return Ok(()),
            Ok(count) => count,
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => continue,
            Err(error) => return Err(error),
        };
        for byte in &buffer[..count] {
            frame.push(*byte);
            if *byte != 0 {
                continue;
            }
            // A linear congruential generator with Knuth's multiplier decides by its upper bits
            // which frames are lost, because its lower bits repeat after short periods.
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let is_lost = (random >> 33) % 100 < percent;
            if let (Some(host), false) = (&mut host, is_lost) {
                // Ignore the error that occurs when the host has closed the connection.
                let _ = host.write_all(&frame);
            }
            frame.clear();
        }
    }
}
