//! What the host does to the device, step by step, and what has to come of it.

use link::{Decoder, Encoder, MAX_FRAME, ResetInto, ToDevice, ToHost};
use rigless::emulator::{Driver, Host, Stop};
use rigless::machine::Board;
use rigless::session::Session;
use rigless::time::VirtualNanos;
use virtual_board::usb::{State, UsbHost};

const MS: u64 = 1_000_000;
/// How often the host's state is looked at, ns.
const LOOK_NS: u64 = 5 * MS;

/// Messages received since a step began, by kind.
#[derive(Debug, Default)]
pub(crate) struct Received {
    hello: u32,
    capabilities: u32,
    ack: u32,
    bytes: usize,
}

/// One thing the host does, and what has to come of it in time.
struct Step {
    what: &'static str,
    act: fn(&UsbHost),
    holds: fn(&UsbHost, &Received) -> bool,
    /// Time it has, ms; a step without `holds` takes all of it.
    limit_ms: u64,
}

fn send(host: &UsbHost, message: &ToDevice) {
    let mut buffer = [0; MAX_FRAME];
    let frame = Encoder::starting_at(0).encode(0, message, &mut buffer);
    host.send(frame.expect("a buffer for the longest frame"));
}

fn identify(host: &UsbHost) {
    send(host, &ToDevice::Identify);
}

fn nothing(_: &UsbHost) {}

fn waits(_: &UsbHost, _: &Received) -> bool {
    false
}

fn is_configured(host: &UsbHost, _: &Received) -> bool {
    host.state() == State::Configured
}

fn is_open(host: &UsbHost, _: &Received) -> bool {
    host.state() == State::Open
}

fn is_identified(_: &UsbHost, received: &Received) -> bool {
    received.hello >= 1 && received.capabilities >= 1 && received.ack >= 1
}

const fn step(
    what: &'static str,
    act: fn(&UsbHost),
    holds: fn(&UsbHost, &Received) -> bool,
    limit_ms: u64,
) -> Step {
    Step {
        what,
        act,
        holds,
        limit_ms,
    }
}

/// Time for an answer over an open port, ms.
const ANSWER: u64 = 200;
/// Time for debouncing, two resets and an enumeration, ms.
const ENUMERATION: u64 = 400;

const STEPS: &[Step] = &[
    step("plugged in", UsbHost::plug, is_configured, ENUMERATION),
    step(
        "opened: says hello",
        UsbHost::open,
        |_, received| received.hello == 1 && received.capabilities == 1,
        ANSWER,
    ),
    step("asked who it is", identify, is_identified, ANSWER),
    step("closed", UsbHost::close, is_configured, ANSWER),
    step("opened again", UsbHost::open, is_open, ANSWER),
    step("asked again", identify, is_identified, ANSWER),
    step(
        "stalled for 3 s with data to take",
        |host| {
            host.stall(true);
            identify(host);
        },
        waits,
        3_000,
    ),
    step("goes on", |host| host.stall(false), is_identified, ANSWER),
    step("suspended", UsbHost::suspend, waits, 1_000),
    step("resumed", UsbHost::resume, waits, 40),
    step("asked after resume", identify, is_identified, ANSWER),
    step("unplugged while idle", UsbHost::unplug, waits, 500),
    step("plugged in", UsbHost::plug, is_configured, ENUMERATION),
    step("opened", UsbHost::open, is_open, ANSWER),
    step("asked after replugging", identify, is_identified, ANSWER),
    step("bus reset", UsbHost::reset_bus, waits, 10),
    step("enumerated", nothing, is_configured, ENUMERATION),
    step("opened", UsbHost::open, is_open, ANSWER),
    step("asked after the reset", identify, is_identified, ANSWER),
    step(
        "stops reading a program's data",
        |host| {
            host.stall(true);
            identify(host);
        },
        waits,
        50,
    ),
    step(
        "unplugged with a packet waiting",
        UsbHost::unplug,
        waits,
        500,
    ),
    step(
        "plugged in",
        |host| {
            host.stall(false);
            host.plug();
        },
        is_configured,
        ENUMERATION,
    ),
    step("opened", UsbHost::open, is_open, ANSWER),
    step("asked after that", identify, is_identified, ANSWER),
    step(
        "restarted by command",
        |host| send(host, &ToDevice::Reset(ResetInto::Firmware)),
        |host, _| host.state() == State::Detached,
        300,
    ),
    step("enumerated", nothing, is_configured, ENUMERATION),
    step(
        "opened: says hello",
        UsbHost::open,
        |_, received| received.hello == 1,
        ANSWER,
    ),
];

/// The run's driver: makes the steps, one after the other.
pub(crate) struct Proof {
    host: UsbHost,
    decoder: Decoder<MAX_FRAME>,
    received: Received,
    next: usize,
    /// Until when the step in progress may take, ns.
    until: u64,
    /// Frames that could not be decoded.
    pub(crate) bad_frames: u32,
    /// The step that did not come out, if one did not.
    pub(crate) failure: Option<String>,
}

impl Proof {
    /// The proof with nothing done yet.
    pub(crate) fn new(host: UsbHost) -> Self {
        Self {
            host,
            decoder: Decoder::new(),
            received: Received::default(),
            next: 0,
            until: 0,
            bad_frames: 0,
            failure: None,
        }
    }

    fn take_frames(&mut self) {
        let bytes = self.host.take_received();
        self.received.bytes += bytes.len();
        let mut rest = bytes.as_slice();
        while let Some(outcome) = self.decoder.next::<ToHost<'_>>(&mut rest) {
            match outcome.map(|frame| frame.message) {
                Ok(ToHost::Hello(_)) => self.received.hello += 1,
                Ok(ToHost::Capabilities(_)) => self.received.capabilities += 1,
                Ok(ToHost::Ack(_)) => self.received.ack += 1,
                Ok(_) => {}
                Err(_) => self.bad_frames += 1,
            }
        }
    }
}

impl<B: Board + ?Sized> Driver<B> for Proof {
    fn on_stop(
        &mut self,
        _: &mut Session<B>,
        stop: Stop,
        _: &mut dyn Host,
    ) -> Option<VirtualNanos> {
        let now = stop.at.0;
        self.take_frames();
        if let Some(step) = self.next.checked_sub(1).map(|n| &STEPS[n]) {
            let only_waits =
                std::ptr::fn_addr_eq(step.holds, waits as fn(&UsbHost, &Received) -> bool);
            if !(step.holds)(&self.host, &self.received) {
                if now < self.until {
                    return Some(VirtualNanos(now + LOOK_NS));
                }
                if !only_waits {
                    let (what, state) = (step.what, self.host.state());
                    self.failure = Some(format!("{what}: {state:?}, {:?}", self.received));
                    return None;
                }
            }
            println!("{} ms: {} ({:?})", now / MS, step.what, self.received);
        }
        let step = STEPS.get(self.next)?;
        self.next += 1;
        self.received = Received::default();
        self.until = now + step.limit_ms * MS;
        (step.act)(&self.host);
        Some(VirtualNanos(now + LOOK_NS))
    }
}
