//! A TCP port with one host at a time.

use std::{
    io::{self, Read, Write},
    net::{TcpListener, TcpStream},
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
        mpsc,
    },
    thread,
    time::{Duration, Instant},
};

use super::port::write_all;
use crate::outbox::{Outbox, WhenFull};

/// Pause before a failed operation is tried again.
pub(crate) const RETRY: Duration = Duration::from_millis(20);

/// Time limit for a host to read the last frames from a TCP port in virtual time. The kernel can
/// hold some megabytes of unread frames.
const CLOSE_TIMEOUT: Duration = Duration::from_mins(1);

/// Forwards the host's bytes to the board until the host disconnects or the board ends.
pub(crate) fn forward(mut input: impl Read, commands: &mpsc::Sender<Vec<u8>>) {
    let mut buffer = [0; 512];
    loop {
        match input.read(&mut buffer) {
            Ok(0) => return,
            Ok(count) => {
                if commands.send(buffer[..count].to_vec()).is_err() {
                    return;
                }
            }
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(_) => return,
        }
    }
}

/// A host that has connected to the TCP port.
pub(crate) struct Host {
    stream: TcpStream,
    /// Set when the host will send no more commands, because it has read all frames or is gone.
    ended: AtomicBool,
}

/// The connected host; `None` without one.
pub(crate) type CurrentHost = Arc<Mutex<Option<Arc<Host>>>>;

/// Returns whether no host is connected.
pub(crate) fn is_absent(host: &CurrentHost) -> bool {
    let current = host.lock().unwrap_or_else(PoisonError::into_inner);
    let is_connected = |host: &Arc<Host>| !host.ended.load(Ordering::Relaxed);
    !current.as_ref().is_some_and(is_connected)
}

/// Tells the host that no frame follows, and waits until the host closes the connection.
pub(crate) fn wait_until_closed(host: &CurrentHost, stop: &AtomicBool) {
    let current = host.lock().unwrap_or_else(PoisonError::into_inner).clone();
    let Some(host) = current else { return };
    // An error means that the host has already disconnected.
    let _ = host.stream.shutdown(std::net::Shutdown::Write);
    let deadline = Instant::now() + CLOSE_TIMEOUT;
    while !host.ended.load(Ordering::Relaxed)
        && !stop.load(Ordering::Relaxed)
        && Instant::now() < deadline
    {
        thread::sleep(RETRY);
    }
}

/// Serves one host at a time; a new connection replaces the old one. Without a host, frames are
/// dropped and counted in real time; in virtual time they wait.
pub(crate) fn serve(
    listener: TcpListener,
    outbox: &Outbox,
    commands: &mpsc::Sender<Vec<u8>>,
) -> CurrentHost {
    let host = CurrentHost::default();
    let served = host.clone();
    let (current, commands) = (host.clone(), commands.clone());
    thread::spawn(move || accept(&listener, &current, &commands));
    let outbox = outbox.clone();
    thread::spawn(move || write_all(|frame| send(frame, &host, &outbox), || 0, &outbox));
    served
}

fn accept(listener: &TcpListener, current: &CurrentHost, commands: &mpsc::Sender<Vec<u8>>) {
    loop {
        let Ok((stream, _)) = listener.accept() else {
            // The process is probably out of file descriptors, so an immediate retry would fail
            // too.
            thread::sleep(RETRY);
            continue;
        };
        let (Ok(()), Ok(reader)) = (stream.set_nodelay(true), stream.try_clone()) else {
            continue;
        };
        let mut current = current.lock().unwrap_or_else(PoisonError::into_inner);
        let host = Arc::new(Host { stream, ended: AtomicBool::new(false) });
        if let Some(old) = current.replace(Arc::clone(&host)) {
            // An error means that the old host has already disconnected.
            let _ = old.stream.shutdown(std::net::Shutdown::Both);
        }
        let commands = commands.clone();
        thread::spawn(move || {
            forward(reader, &commands);
            host.ended.store(true, Ordering::Relaxed);
        });
    }
}

/// Sends a frame to the current host. In virtual time, tries again until a host accepts the frame.
fn send(frame: &[u8], host: &CurrentHost, outbox: &Outbox) -> io::Result<()> {
    loop {
        let current = host.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let outcome = match current {
            Some(current) => (&current.stream).write_all(frame),
            None => Err(io::ErrorKind::NotConnected.into()),
        };
        if outcome.is_ok() || outbox.when_full() == WhenFull::DropOldest || outbox.is_closed() {
            return outcome;
        }
        thread::sleep(RETRY);
    }
}
