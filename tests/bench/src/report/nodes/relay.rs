//! Forwards all bytes of host-sim to the bridge and the codes also to the node in rospy, and notes
//! when each code is sent. Codes leave exactly one hop apart, to within some microseconds, so that
//! any jitter at a subscriber comes from the node.

use std::io::{self, Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::Context;
use link::{Decoder, ToHost};

use super::figures::{SharedTimes, Times};
use super::{run_before_others, wait_until};

/// Time from one code to the next in real time.
const HOP: Duration =
    Duration::from_micros(model::HOP as u64 * 1_000_000 / model::STEP_RATE_HZ as u64);
/// Time from sending a code to the bridge until the same code is sent to the node in rospy.
const OFFSET: Duration = HOP.checked_div(2).unwrap();
/// Delay of every code in the relay, so that even a late code of host-sim leaves on time.
const RESERVE: Duration = Duration::from_millis(15);
/// Time limit for host-sim to open its port, and for each node to connect.
const START: Duration = Duration::from_secs(20);
/// Time between two attempts to connect or to accept.
const RETRY: Duration = Duration::from_millis(20);

/// A code's values as levels (integers), and the index of its window.
struct Levels {
    window: u32,
    values: Vec<i32>,
}

/// Times at which each code was sent to the bridge and to the node in rospy. The forwarding threads
/// note them, and end when host-sim closes its connection.
#[derive(Debug)]
pub(super) struct Relay([SharedTimes; 2]);

impl Relay {
    /// Connects to host-sim on port `port` of 127.0.0.1, accepts the connections of bridge and
    /// rospy node on the listeners `bridge` and `rospy`, and starts to forward bytes.
    ///
    /// # Errors
    /// A connection fails.
    pub(super) fn start(
        port: u16,
        bridge: &TcpListener,
        rospy: Option<&TcpListener>,
    ) -> anyhow::Result<Self> {
        let source = connect(port).context("host-sim opens no port")?;
        let bridge = accept(bridge).context("corticode-bridge does not connect")?;
        let rospy = rospy.map(accept).transpose();
        let rospy = rospy.context("rospy_bridge.py does not connect")?;
        let [to_bridge, to_rospy] = <[SharedTimes; 2]>::default();
        let sent = [to_bridge.clone(), to_rospy.clone()];
        let (codes, later) = channel();
        let (mut commands, mut back) = (bridge.try_clone()?, source.try_clone()?);
        thread::spawn(move || io::copy(&mut commands, &mut back));
        thread::spawn(move || {
            run_before_others();
            forward(source, bridge, &to_bridge, &codes)
        });
        if let Some(rospy) = rospy {
            thread::spawn(move || {
                run_before_others();
                delay(&later, rospy, &to_rospy)
            });
        }
        Ok(Self(sent))
    }

    /// Returns the times at which each code was sent to the bridge and to the rospy node.
    pub(super) fn times(&self) -> [Times; 2] {
        self.0.each_ref().map(SharedTimes::so_far)
    }
}

fn connect(port: u16) -> io::Result<TcpStream> {
    let end = Instant::now() + START;
    loop {
        match TcpStream::connect(SocketAddr::from((Ipv4Addr::LOCALHOST, port))) {
            Ok(stream) => return stream.set_nodelay(true).map(|()| stream),
            Err(error) if Instant::now() >= end => return Err(error),
            Err(_) => thread::sleep(RETRY),
        }
    }
}

fn accept(listener: &TcpListener) -> io::Result<TcpStream> {
    let end = Instant::now() + START;
    listener.set_nonblocking(true)?;
    loop {
        match listener.accept() {
            Ok((stream, _)) => {
                stream.set_nonblocking(false)?;
                return stream.set_nodelay(true).map(|()| stream);
            }
            Err(error) if error.kind() != io::ErrorKind::WouldBlock => return Err(error),
            Err(error) if Instant::now() >= end => return Err(error),
            Err(_) => thread::sleep(RETRY),
        }
    }
}

/// Forwards all bytes of host-sim to the bridge, and the codes in them to `codes`. The last bytes
/// of a code wait until the code is due.
fn forward(
    mut source: TcpStream,
    mut bridge: TcpStream,
    sent: &SharedTimes,
    codes: &Sender<(Instant, Levels)>,
) -> io::Result<()> {
    let mut decoder: Decoder = Decoder::new();
    let mut buffer = [0; 4096];
    let mut first = None;
    loop {
        let count = source.read(&mut buffer)?;
        if count == 0 {
            return Ok(());
        }
        let (bytes, arrival) = (&buffer[..count], Instant::now());
        let mut unread = bytes;
        while let Some(frame) = decoder.next::<ToHost>(&mut unread) {
            let Ok(ToHost::Code(code)) = frame.map(|frame| frame.message) else {
                continue;
            };
            let (window, at) = *first.get_or_insert((code.window, arrival + RESERVE));
            wait_until(at + HOP * code.window.wrapping_sub(window));
            let now = Instant::now();
            sent.note(code.window.into(), now);
            let levels = Levels { window: code.window, values: code.values.levels().collect() };
            // An error means that no node in rospy runs.
            let _ = codes.send((now, levels));
        }
        bridge.write_all(bytes)?;
    }
}

/// Sends each code to the rospy node, [`OFFSET`] later than to the bridge. A code is sent as the
/// window's index (32 bits, little endian), then the levels as float32.
fn delay(
    codes: &Receiver<(Instant, Levels)>,
    mut rospy: TcpStream,
    sent: &SharedTimes,
) -> io::Result<()> {
    for (at, code) in codes {
        let mut bytes = Vec::with_capacity(4 + 4 * code.values.len());
        bytes.extend(code.window.to_le_bytes());
        #[expect(clippy::cast_precision_loss, reason = "a level has at most 16 bits")]
        let values = code.values.iter().map(|level| *level as f32);
        bytes.extend(values.flat_map(f32::to_le_bytes));
        wait_until(at + OFFSET);
        sent.note(code.window.into(), Instant::now());
        rospy.write_all(&bytes)?;
    }
    Ok(())
}
