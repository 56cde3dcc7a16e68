//! Tests of the streams with a simulated host, which opens and closes the port, reads and stalls in
//! the order that each test sets.

use core::{cell::RefCell, future::poll_fn, task::Poll};
use std::{boxed::Box, collections::VecDeque, rc::Rc, vec::Vec};

use embassy_futures::block_on;
use link::{Decoder, Encoder, Hello, MAX_FRAME, ResetCause, ToHost};

use super::*;

/// Number of reads with which a host never stalls.
const ALL: usize = usize::MAX;

/// Action that the host takes at a tick.
type Act = Box<dyn FnOnce(&mut Host)>;

/// Simulated host, with the packet buffer of the device's endpoint.
#[derive(Default)]
struct Host {
    is_open: bool,
    /// Number of packets that the host still reads before it stalls.
    reads: usize,
    /// Actions that the host takes at the next ticks, one at each tick.
    acts: VecDeque<Act>,
    /// Packet that the host has not read yet, in the endpoint's buffer.
    waiting: Option<Vec<u8>>,
    /// Packets that a program on the host has read.
    packets: Vec<Vec<u8>>,
}

impl Host {
    fn open(&mut self, reads: usize) {
        self.is_open = true;
        self.reads = reads;
        self.read();
    }

    fn read(&mut self) {
        if self.is_open && self.reads > 0 {
            self.packets.extend(self.waiting.take().inspect(|_| {
                self.reads -= 1;
            }));
        }
    }

    fn act(&mut self) {
        let act = self.acts.pop_front();
        act.expect("an action for every tick")(self);
    }

    /// Returns the sequence number of each whole frame, and the number of times that the decoder
    /// skipped bytes outside frames.
    fn decode(&self) -> (Vec<u32>, u32) {
        let mut decoder = Decoder::<MAX_FRAME>::new();
        let mut seqs = Vec::new();
        let bytes = self.packets.concat();
        let mut bytes = &bytes[..];
        while let Some(outcome) = decoder.next::<ToHost<'_>>(&mut bytes) {
            seqs.extend(outcome.ok().map(|frame| frame.header.seq));
        }
        (seqs, decoder.counters().resyncs)
    }
}

#[derive(Clone, Default)]
struct Cable(Rc<RefCell<Host>>);

impl PacketSender for Cable {
    fn is_open(&self) -> bool {
        self.0.borrow().is_open
    }

    async fn wait_configured(&mut self) {}

    async fn send(&mut self, packet: &[u8]) -> Result<(), Closed> {
        poll_fn(|_| {
            let mut host = self.0.borrow_mut();
            host.read();
            if host.waiting.is_some() {
                return Poll::Pending;
            }
            host.waiting = Some(packet.to_vec());
            host.read();
            Poll::Ready(Ok(()))
        })
        .await
    }

    fn tick(&self) -> impl Future<Output = ()> + use<> {
        let host = Rc::clone(&self.0);
        async move { host.borrow_mut().act() }
    }
}

/// Device that numbers its frames and counts the dropped frames, as the conversation task does.
struct Device {
    transmitter: Transmitter<Cable>,
    encoder: Encoder,
    dropped: u32,
}

impl Device {
    /// Returns a device and the cable to its host. `prepare` sets up the host.
    fn plugged(prepare: impl FnOnce(&mut Host)) -> (Self, Cable) {
        let cable = Cable::default();
        prepare(&mut cable.0.borrow_mut());
        let device = Self {
            transmitter: Transmitter::new(cable.clone()),
            encoder: Encoder::starting_at(0),
            dropped: 0,
        };
        (device, cable)
    }

    /// Sends a frame of three packets.
    fn send(&mut self) {
        let hello = Hello {
            firmware: "0.1.0 1234567",
            board: "a board of a test",
            chip_uid: [7; 12],
            model_id: [1; 8],
            session_id: 1,
            reset_cause: ResetCause::PowerOn,
            fault: "words enough to fill three packets, so that a host can go away between any two",
        };
        let mut buffer = [0; MAX_FRAME];
        let frame = self.encoder.encode(0, &ToHost::Hello(hello), &mut buffer);
        let frame = frame.expect("it fits");
        assert!((2 * PACKET..3 * PACKET).contains(&frame.len()));
        if block_on(self.transmitter.write_all(frame)).is_err() {
            self.dropped += 1;
        }
        // Like the conversation task, ignore the result: `flush` only sends the packet that ends a
        // transfer, which belongs to no frame.
        let _ = block_on(self.transmitter.flush());
    }
}

fn act(what: impl FnOnce(&mut Host) + 'static) -> Act {
    Box::new(what)
}

#[test]
fn a_frame_cut_by_a_close_is_dropped_and_counted_and_the_next_one_is_whole() {
    let (mut device, cable) = Device::plugged(|host| {
        host.acts = VecDeque::from([
            act(|host| host.open(1)),
            // At this tick, the endpoint holds the second packet, and the device holds the third.
            act(|host| host.is_open = false),
            act(|_| {}),
            act(|host| host.open(ALL)),
        ]);
    });
    device.send();
    assert_eq!(device.dropped, 1);
    device.send();
    device.send();
    assert_eq!(cable.0.borrow().decode(), (Vec::from([1, 2]), 1));
    assert_eq!(device.dropped, 1);
}

#[test]
fn the_rest_of_a_frame_is_not_sent_after_the_port_opens_again() {
    let (mut device, cable) = Device::plugged(|host| host.open(ALL));
    block_on(device.transmitter.write_all(&[0, 1, 2])).expect("open");
    cable.0.borrow_mut().is_open = false;
    assert_eq!(
        block_on(device.transmitter.write_all(&[3, 0])),
        Err(Closed),
        "the write does not wait for the next opening"
    );
    let opens = act(|host| host.open(ALL));
    cable.0.borrow_mut().acts = VecDeque::from([opens]);
    device.send();
    assert_eq!(cable.0.borrow().decode(), (Vec::from([0]), 1));
}

#[test]
fn a_host_that_stalls_receives_everything_when_it_reads_again() {
    let (mut device, cable) = Device::plugged(|host| {
        host.open(0);
        host.acts.extend((0..500).map(|_| act(|_| {})));
        host.acts.push_back(act(|host| host.open(ALL)));
    });
    device.send();
    device.send();
    assert_eq!(cable.0.borrow().decode(), (Vec::from([0, 1]), 0));
    assert_eq!(device.dropped, 0);
}

#[test]
fn a_port_that_closes_and_opens_between_two_checks_loses_nothing() {
    let (mut device, cable) = Device::plugged(|host| {
        host.open(1);
        host.acts.push_back(act(|host| {
            host.is_open = false;
            host.open(ALL);
        }));
    });
    device.send();
    assert_eq!(cable.0.borrow().decode(), (Vec::from([0]), 0));
    assert_eq!(device.dropped, 0);
}

#[test]
fn every_frame_is_received_or_counted_over_a_thousand_openings() {
    let (mut device, cable) = Device::plugged(|host| {
        for opening in 0..1_000_usize {
            // At each opening, the host reads 0 to 7 packets, in the order 0, 7, 6, ... 1. A frame
            // has three packets, so the port closes at various positions within a frame.
            let reads = opening * 7919 % 8;
            host.acts.push_back(act(move |host| host.open(reads)));
            host.acts.push_back(act(|host| host.is_open = false));
        }
        host.acts.push_back(act(|host| host.open(ALL)));
    });
    let mut sent = 0;
    while !cable.0.borrow().acts.is_empty() {
        device.send();
        sent += 1;
    }
    device.send();
    sent += 1;
    let (seqs, damaged) = cable.0.borrow().decode();
    assert!(seqs.is_sorted_by(|before, after| before < after));
    let received = u32::try_from(seqs.len()).expect("thousands");
    assert_eq!(received + device.dropped, sent);
    // More frames can be dropped than are damaged: if the port closes before any byte of a frame is
    // sent, the host sees no damage.
    assert!(device.dropped > 500 && damaged <= device.dropped);
    assert!(received > 500, "{received}");
}

#[test]
fn a_flush_sends_an_empty_packet_only_after_a_full_one() {
    let lengths = |frame: &[u8]| {
        let (mut device, cable) = Device::plugged(|host| host.open(ALL));
        block_on(device.transmitter.write_all(frame)).expect("open");
        for _ in 0..2 {
            block_on(device.transmitter.flush()).expect("open");
        }
        let host = cable.0.borrow();
        host.packets.iter().map(Vec::len).collect::<Vec<_>>()
    };
    assert_eq!(lengths(&[1; PACKET - 1]), [PACKET - 1]);
    assert_eq!(lengths(&[1; PACKET]), [PACKET, 0]);
    assert_eq!(lengths(&[1; 2 * PACKET]), [PACKET, PACKET, 0]);
    assert_eq!(lengths(&[1; 2 * PACKET + 1]), [PACKET, PACKET, 1]);
}

#[test]
fn an_empty_packet_from_the_host_does_not_end_the_stream() {
    struct Packets(VecDeque<Vec<u8>>);

    impl PacketReceiver for Packets {
        async fn receive(&mut self, packet: &mut [u8]) -> Result<usize, Closed> {
            let bytes = self.0.pop_front().ok_or(Closed)?;
            packet[..bytes.len()].copy_from_slice(&bytes);
            Ok(bytes.len())
        }
    }

    let mut receiver = Receiver(Packets(VecDeque::from([Vec::new(), Vec::new(), Vec::from([5])])));
    let mut packet = [0; PACKET];
    assert_eq!(block_on(receiver.read(&mut packet)), Ok(1));
    assert_eq!(block_on(receiver.read(&mut packet)), Err(Closed));
}
