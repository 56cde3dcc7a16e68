//! A board with power, in lockstep with its user.

use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use ads1299::simulation::Simulation;
use rigless::emulator::{self, Host, Start};
use rigless::session::Session;
use rigless::time::VirtualNanos;

use crate::board::Nucleo;
use crate::chain::{CHIPS, Chain};
use crate::diagnosis::{Diagnosis, Trouble};
use crate::frames::{Frame, Inbox};
use crate::machine::clockwork::{Clockwork, Order, Reached};
use crate::port::Port;
use crate::processor::Observer;
use crate::serial::Serial;
use crate::setup::Cable;
use crate::usb::UsbHost;
use crate::{Findings, Image, Injection, Model, Setup};

mod clockwork;

/// Real time that the emulator may take to reach a stop before it is taken to be hung.
const PATIENCE: Duration = Duration::from_secs(300);

/// How often a condition is looked at, us of virtual time.
const LOOK_US: u64 = 500;

/// A board that runs an image. Its time stands still except within [`run_until_us`](Self::run_until_us)
/// and what is built on it.
#[derive(Debug)]
pub struct VirtualBoard {
    model: Model,
    image: Image,
    chain: Chain,
    port: Port,
    inbox: Inbox,
    observer: Observer,
    orders: Sender<Order>,
    reached: Receiver<Reached>,
    thread: Option<JoinHandle<Result<(), String>>>,
    now_ns: u64,
    encoder: link::Encoder,
    last: Reached,
    keep_open: bool,
}

impl VirtualBoard {
    /// Switches a board on: its core stands before its first instruction.
    ///
    /// # Errors
    /// The emulator refuses the image or the board.
    pub fn power_on(model: Model, image: &Image, setup: &Setup) -> Result<Self, Trouble> {
        let chain = Chain::new(setup);
        if !setup.converters_on {
            chain.wires().simulation().power_off();
        }
        let serial = Serial::default();
        let host = UsbHost::new();
        let observer = Observer::default();
        let board = Nucleo::new(
            model,
            setup,
            chain.clone(),
            serial.clone(),
            &host,
            observer.clone(),
        );
        let port = match setup.cable {
            Cable::Uart => Port::Uart(serial),
            Cable::Usb => {
                host.plug();
                Port::Usb(host)
            }
        };
        let (orders, taken) = channel();
        let (answers, reached) = channel();
        let clockwork = Clockwork::new(
            model.pins(),
            chain.clone(),
            observer.clone(),
            taken,
            answers,
        );
        let file = image.clone();
        let thread = thread::spawn(move || {
            let image = rigless::image::Image::new(file.path(), file.bytes().to_vec(), None);
            let images = [image.map_err(|error| error.to_string())?];
            let session = Session::new(Box::new(board), 0, VirtualNanos(0));
            let session = session.map_err(|error| error.to_string())?;
            let run = emulator::run(session, &Start::new(&images), clockwork);
            run.map(drop).map_err(|error| error.to_string())
        });
        Ok(Self {
            model,
            image: image.clone(),
            chain,
            port,
            inbox: Inbox::default(),
            observer,
            orders,
            reached,
            thread: Some(thread),
            now_ns: 0,
            encoder: link::Encoder::starting_at(0),
            last: Reached::default(),
            keep_open: true,
        })
    }

    /// The board.
    pub const fn model(&self) -> Model {
        self.model
    }

    /// The image that runs.
    pub const fn image(&self) -> &Image {
        &self.image
    }

    /// The converters.
    pub fn converters(&self) -> Simulation<CHIPS> {
        self.chain.wires().simulation().clone()
    }

    /// The host's end of its port.
    pub const fn port(&self) -> &Port {
        &self.port
    }

    /// Frames that the device has sent.
    pub const fn inbox(&self) -> &Inbox {
        &self.inbox
    }

    /// Virtual time since power on, us.
    pub const fn now_us(&self) -> u64 {
        self.now_ns / 1000
    }

    /// Instructions that the core has retired.
    pub const fn instructions(&self) -> u64 {
        self.last.instructions
    }

    /// SCLK as it is set now, Hz; 0 before the firmware has set it.
    pub fn sclk_hz(&self) -> u32 {
        self.chain.wires().sclk_hz()
    }

    /// Bytes that SPI has clocked.
    pub fn spi_bytes(&self) -> u64 {
        self.chain.wires().bytes()
    }

    /// Words on SPI that were no bytes.
    pub fn odd_words(&self) -> u64 {
        self.chain.wires().odd_words()
    }

    /// Holds DRDY at a level, or lets the converters drive it.
    pub fn hold_ready(&self, level: Option<bool>) {
        self.chain.wires().hold_ready(level);
    }

    /// Damages bytes on their way to the UART: `per_million` of them with a framing error, as many with noise.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn damage_uart(&mut self, per_million: u32) -> Result<(), Trouble> {
        self.inspect(move |session, _| session.board_mut().chip.damage_uart(per_million))
    }

    /// Lets the trigger's line change at these times, us of virtual time, in order.
    pub fn plan_trigger(&self, edges: &[(u64, bool)]) {
        let edges = edges.iter().map(|&(us, is_high)| (us * 1000, is_high));
        // A board that has ended says so when it is asked to run.
        let _ = self.orders.send(Order::Trigger(edges.collect()));
    }

    /// Whether the host opens the port whenever the device is there; at first it does.
    pub const fn keep_open(&mut self, keep_open: bool) {
        self.keep_open = keep_open;
    }

    /// Sends a command.
    ///
    /// # Panics
    /// When the command does not fit a frame: none is so long.
    pub fn send(&mut self, command: &link::ToDevice) {
        let mut buffer = [0; link::MAX_FRAME];
        let bytes = self.encoder.encode(0, command, &mut buffer);
        self.port.send(bytes.expect("commands are short"));
    }

    /// Lets a failure happen when the core next arrives at a symbol.
    ///
    /// # Errors
    /// The image has no such symbol or no code that could fail so, or the emulator has ended.
    pub fn inject_at(&mut self, symbol: &str, injection: Injection) -> Result<(), Trouble> {
        let change = injection.change(&self.image);
        let (Some(address), Some(change)) = (self.image.address(symbol), change) else {
            let what = format!("the image has no {symbol}, or nothing that could {injection:?}");
            return Err(self.trouble(what));
        };
        if self.orders.send(Order::Inject(address, change)).is_err() {
            return Err(self.ended());
        }
        Ok(())
    }

    pub(crate) const fn observer(&self) -> &Observer {
        &self.observer
    }

    /// Runs up to a time, us since power on, and takes in what the device sends.
    ///
    /// # Errors
    /// The emulator has failed or hangs.
    pub fn run_until_us(&mut self, us: u64) -> Result<(), Trouble> {
        self.advance(us * 1000)?;
        if self.keep_open {
            self.port.keep_open();
        }
        let bytes = self.port.take();
        self.inbox.push(&bytes);
        Ok(())
    }

    /// Runs for some time.
    ///
    /// # Errors
    /// As [`run_until_us`](Self::run_until_us).
    pub fn run_for_us(&mut self, us: u64) -> Result<(), Trouble> {
        self.run_until_us(self.now_us() + us)
    }

    /// Runs without taking what the device sends: whoever has the port does.
    ///
    /// # Errors
    /// As [`run_until_us`](Self::run_until_us).
    pub fn pass_us(&mut self, us: u64) -> Result<(), Trouble> {
        self.advance(self.now_ns + us * 1000)
    }

    /// Runs until a condition holds for the frames received.
    ///
    /// # Errors
    /// It does not hold within `limit_us` of virtual time; the diagnosis says where the core stands.
    pub fn run_until(
        &mut self,
        what: &str,
        limit_us: u64,
        mut holds: impl FnMut(&[Frame]) -> bool,
    ) -> Result<(), Trouble> {
        let end = self.now_us() + limit_us;
        loop {
            if holds(self.inbox.frames()) {
                return Ok(());
            }
            if self.now_us() >= end {
                let what = format!("{what}: not within {limit_us} us of virtual time");
                return Err(self.trouble(what));
            }
            self.run_until_us((self.now_us() + LOOK_US).min(end))?;
        }
    }

    /// Does something with the emulator's session while time stands still.
    ///
    /// # Errors
    /// The emulator has ended.
    pub(crate) fn inspect<T: Send + 'static>(
        &mut self,
        look: impl FnOnce(&mut Session<Nucleo>, &mut dyn Host) -> T + Send + 'static,
    ) -> Result<T, Trouble> {
        let (answer, answered) = channel();
        let order = Order::Look(Box::new(move |session, host| {
            // Nobody waits any more: nothing to tell.
            let _ = answer.send(look(session, host));
        }));
        if self.orders.send(order).is_err() {
            return Err(self.ended());
        }
        answered.recv().map_err(|_| self.ended())
    }

    /// What the emulator noticed so far.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn findings(&mut self) -> Result<Findings, Trouble> {
        let failed = self.observer.failed().into_iter();
        let failed = failed.map(|(address, pc)| match pc {
            Some(pc) => format!("{address:#010x} from {}", self.image.describe(pc)),
            None => format!("{address:#010x} by the core itself"),
        });
        let failed: Vec<String> = failed.collect();
        let mut findings = self.inspect(|session, _| Findings::of(session))?;
        findings.unmapped.extend(failed);
        Ok(findings)
    }

    /// What went wrong, with the diagnosis of now.
    pub fn trouble(&mut self, what: String) -> Trouble {
        let diagnosis = self.diagnosis();
        Trouble::new(what, diagnosis)
    }

    /// Where the core stands, what was not mapped, what has reset it.
    pub fn diagnosis(&mut self) -> Diagnosis {
        let findings = self.findings().unwrap_or_default();
        let trail = self.observer.trail();
        let places = trail.iter().map(|&pc| self.image.describe(pc)).collect();
        Diagnosis {
            now_us: self.now_us(),
            instructions: self.last.instructions,
            places,
            findings,
            frames: self.inbox.frames().len(),
            bad: self.inbox.bad().to_vec(),
        }
    }

    fn advance(&mut self, ns: u64) -> Result<(), Trouble> {
        if ns <= self.now_ns {
            return Ok(());
        }
        if self.orders.send(Order::Run(ns)).is_err() {
            return Err(self.ended());
        }
        match self.reached.recv_timeout(PATIENCE) {
            Ok(reached) => {
                self.last = reached;
                self.now_ns = ns;
                if reached.restarts {
                    let what = "it restarts again and again".to_owned();
                    return Err(self.trouble(what));
                }
                Ok(())
            }
            Err(RecvTimeoutError::Disconnected) => Err(self.ended()),
            Err(RecvTimeoutError::Timeout) => {
                // It would not end: the process leaves it behind.
                self.thread = None;
                let places = self.observer.trail();
                let places = places.iter().map(|&pc| self.image.describe(pc)).collect();
                Err(Trouble::new(
                    format!(
                        "the emulator has made no progress for {} s of real time",
                        PATIENCE.as_secs()
                    ),
                    Diagnosis {
                        now_us: self.now_us(),
                        instructions: self.last.instructions,
                        places,
                        ..Diagnosis::default()
                    },
                ))
            }
        }
    }

    /// Why the emulator has ended.
    fn ended(&mut self) -> Trouble {
        let result = self.thread.take().map(JoinHandle::join);
        let why = match result {
            Some(Ok(Err(error))) => error,
            Some(Err(_)) => "its thread has panicked".to_owned(),
            Some(Ok(Ok(()))) | None => "it has ended before".to_owned(),
        };
        let places = self.observer.trail();
        let places = places.iter().map(|&pc| self.image.describe(pc)).collect();
        Trouble::new(
            format!("the emulator has ended: {why}"),
            Diagnosis {
                now_us: self.now_us(),
                instructions: self.last.instructions,
                places,
                ..Diagnosis::default()
            },
        )
    }
}

impl Drop for VirtualBoard {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.orders.send(Order::End);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
