//! A simulated cable to a board without converters. The cable itself answers the command for a
//! self-test, so the board seems to have converters.

use std::io::{self, Read, Write};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;

use acceptance::lossy_cable::connect;
use link::{Ack, AckResult, Decoder, Header, MAX_FRAME, SelfTest, ToDevice, ToHost, VERSION};

/// A TCP port to which one host connects.
pub(super) struct TestingBoard {
    /// Address to which the host connects, in the format of the bridge's option `--port`.
    pub(super) port: String,
}

/// State that the two transfer directions share: the host's connection, the number of frames that
/// the cable has added to the board's, and the sequence number of the board's newest frame.
struct Line {
    host: Mutex<TcpStream>,
    added: AtomicU32,
    newest: AtomicU32,
}

impl Line {
    fn send(&self, header: Header, message: &ToHost) -> io::Result<()> {
        let mut buffer = [0; MAX_FRAME];
        let bytes = link::encode(&header, message, &mut buffer).map_err(io::Error::other)?;
        let mut host = self.host.lock().map_err(|_| io::ErrorKind::Other)?;
        host.write_all(bytes)
    }

    /// Sends the host a message that the cable adds to the board's messages.
    fn add(&self, message: &ToHost) -> io::Result<()> {
        let added = self.added.fetch_add(1, Ordering::SeqCst) + 1;
        let header = Header {
            version: VERSION,
            seq: self.newest.load(Ordering::SeqCst).wrapping_add(added),
            device_time_us: 0,
        };
        self.send(header, message)
    }
}

impl TestingBoard {
    /// Connects to the board on TCP port `port` of 127.0.0.1. Every self-test returns `result`.
    pub(super) fn new(port: u16, result: SelfTest) -> io::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
        let address = listener.local_addr()?;
        let board = connect(port)?;
        thread::spawn(move || {
            let (host, _) = listener.accept()?;
            pass_on(host, board, result)
        });
        Ok(Self { port: format!("tcp:{address}") })
    }
}

fn pass_on(mut host: TcpStream, mut board: TcpStream, result: SelfTest) -> io::Result<()> {
    let line = Arc::new(Line {
        host: Mutex::new(host.try_clone()?),
        added: AtomicU32::new(0),
        newest: AtomicU32::new(0),
    });
    let (of_commands, mut to_board) = (Arc::clone(&line), board.try_clone()?);
    thread::spawn(move || -> io::Result<()> {
        let (mut decoder, mut buffer) = (Decoder::<MAX_FRAME>::new(), [0; 4096]);
        loop {
            let count = host.read(&mut buffer)?;
            if count == 0 {
                return Ok(());
            }
            // The bridge writes whole frames, and waits for the answer to each command.
            let (mut bytes, mut is_test) = (&buffer[..count], None);
            while let Some(frame) = decoder.next::<ToDevice>(&mut bytes) {
                is_test = frame
                    .ok()
                    .filter(|frame| frame.message == ToDevice::SelfTest)
                    .map(|frame| frame.header.seq);
            }
            let Some(of) = is_test else {
                to_board.write_all(&buffer[..count])?;
                continue;
            };
            of_commands.add(&ToHost::Ack(Ack { of, result: AckResult::Done }))?;
            of_commands.add(&ToHost::SelfTest(result.clone()))?;
        }
    });
    let (mut decoder, mut buffer) = (Decoder::<MAX_FRAME>::new(), [0; 4096]);
    loop {
        let count = board.read(&mut buffer)?;
        if count == 0 {
            return Ok(());
        }
        let mut bytes = &buffer[..count];
        while let Some(frame) = decoder.next::<ToHost>(&mut bytes) {
            let Ok(frame) = frame else { continue };
            line.newest.store(frame.header.seq, Ordering::SeqCst);
            let added = line.added.load(Ordering::SeqCst);
            let seq = frame.header.seq.wrapping_add(added);
            line.send(Header { seq, ..frame.header }, &frame.message)?;
        }
    }
}
