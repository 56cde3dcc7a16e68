//! A powered virtual board whose virtual time advances only when a test asks for it.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use ads1299::simulation::Simulation;
use rigless::emulator::{self, Host, Start};
use rigless::session::Session;
use rigless::time::VirtualNanos;

use crate::board::{Cable, EmulatedBoard, Setup};
use crate::chain::{CHIPS, Chain};
use crate::findings::{BoardError, Findings, section};
use crate::frames::{Frame, Inbox};
use crate::image::Image;
use crate::injection::Injection;
use crate::machine::driver::{BoardDriver, Progress, Request};
use crate::model::Model;
use crate::port::{Port, Serial};
use crate::processor::Observer;
use crate::usb::host::{Command, UsbHost};

mod driver;

/// Time limit in real time for the emulator to reach a requested stop; then it counts as hung.
const TIMEOUT: Duration = Duration::from_secs(300);

/// Virtual time in us between two checks whether a condition holds.
const POLL_US: u64 = 500;

/// A virtual board that runs an image. Its virtual time advances only in
/// [`run_until_us`](Self::run_until_us) and the methods that call it, and in
/// [`advance_us`](Self::advance_us).
#[derive(Debug)]
pub struct VirtualBoard {
    model: Model,
    image: Image,
    chain: Chain,
    port: Port,
    inbox: Inbox,
    observer: Observer,
    requests: Sender<Request>,
    /// Receives one message when the emulator has carried out a [`Request::Run`].
    reached: Receiver<Progress>,
    thread: Option<JoinHandle<Result<(), String>>>,
    now_ns: u64,
    encoder: link::Encoder,
    /// Progress of the emulator when it last reached a requested stop.
    progress: Progress,
    keep_open: bool,
    usb_is_held: Arc<AtomicBool>,
}

impl VirtualBoard {
    /// Powers a board on; its core executes no instruction before the first run. If the emulator
    /// refuses the image or the board, the first run returns the error.
    pub fn power_on(model: Model, image: &Image, setup: &Setup) -> Self {
        let chain = Chain::new(setup);
        if !setup.converters_on {
            chain.wires().simulation.power_off();
        }
        let serial = Serial::default();
        let host = UsbHost::default();
        let observer = Observer::default();
        let usb_is_held = Arc::new(AtomicBool::new(false));
        let mut board = EmulatedBoard::new(
            model,
            image,
            setup,
            chain.clone(),
            serial.clone(),
            &host,
            observer.clone(),
        );
        board.hold_usb_while(usb_is_held.clone());
        let port = match setup.cable {
            Cable::Uart => Port::Uart(serial),
            Cable::Usb => {
                host.command(Command::Plug);
                Port::Usb(host)
            }
        };
        let (requests, received) = channel();
        let (sender, progress) = channel();
        let driver = BoardDriver::new(
            &model.facts().pins,
            chain.clone(),
            observer.clone(),
            received,
            sender,
        );
        let file = image.clone();
        let thread = thread::spawn(move || {
            let image = rigless::image::Image::new(file.path(), file.bytes().to_vec(), None);
            let images = [image.map_err(|error| error.to_string())?];
            let session = Session::new(Box::new(board), 0, VirtualNanos(0));
            let session = session.map_err(|error| error.to_string())?;
            let run = emulator::run(session, &Start::new(&images), driver);
            run.map(drop).map_err(|error| error.to_string())
        });
        Self {
            model,
            image: image.clone(),
            chain,
            port,
            inbox: Inbox::default(),
            observer,
            requests,
            reached: progress,
            thread: Some(thread),
            now_ns: 0,
            encoder: link::Encoder::starting_at(0),
            progress: Progress::default(),
            keep_open: true,
            usb_is_held,
        }
    }

    /// Returns the type of board that was given to [`power_on`](Self::power_on).
    pub const fn model(&self) -> Model {
        self.model
    }

    /// Returns the image that was given to [`power_on`](Self::power_on).
    pub const fn image(&self) -> &Image {
        &self.image
    }

    /// Returns a handle by which tests control the simulated converters.
    pub fn converters(&self) -> Simulation<CHIPS> {
        self.chain.wires().simulation.clone()
    }

    /// Returns the host's end of the port, through which a test communicates with the device.
    pub const fn port(&self) -> &Port {
        &self.port
    }

    /// Returns all frames decoded so far from the bytes that the device has sent.
    pub const fn inbox(&self) -> &Inbox {
        &self.inbox
    }

    /// Returns the virtual time since power-on, in us.
    pub const fn now_us(&self) -> u64 {
        self.now_ns / 1000
    }

    /// Returns the number of instructions that the core has completed since power-on.
    pub const fn instructions(&self) -> u64 {
        self.progress.instructions
    }

    /// Returns the frequency of SCLK in Hz; 0 before the firmware has configured it.
    pub fn sclk_hz(&self) -> u32 {
        self.chain.wires().sclk_hz
    }

    /// Returns the number of words that the SPI has transferred since power-on.
    pub fn spi_words(&self) -> u64 {
        self.chain.wires().words
    }

    /// Returns how many SPI words since power-on were not 8 bits wide; the converters need 8 bits.
    pub fn non_byte_words(&self) -> u64 {
        self.chain.wires().non_byte_words
    }

    /// Holds DRDY at a level (`true` is high); with `None`, the converters drive it again.
    pub fn hold_drdy(&self, level: Option<bool>) {
        self.chain.wires().stuck = level;
    }

    /// If `is_held`, makes the USB core never report that its internal bus (AHB) is idle, for which
    /// the firmware waits when it sets the core up.
    pub fn hold_usb(&self, is_held: bool) {
        self.usb_is_held.store(is_held, Ordering::Relaxed);
    }

    /// Corrupts bytes that the UART receives: of each million, `per_million` get a framing error
    /// and as many others a noise error.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn damage_uart(&mut self, per_million: u32) -> Result<(), BoardError> {
        self.inspect(move |session, _| session.board_mut().chip.damage_uart(per_million))
    }

    /// Schedules edges of the trigger input: each has a time in us since power-on and the level
    /// after it (`true` is high), and the times ascend.
    pub fn plan_trigger(&self, edges: &[(u64, bool)]) {
        let edges = edges.iter().map(|&(us, is_high)| (us * 1000, is_high));
        // Ignore the error that occurs if the emulator has ended: the next run reports it.
        let _ = self.requests.send(Request::Trigger(edges.collect()));
    }

    /// Sets whether the host opens the USB port after each run if the device is configured; by
    /// default it does.
    pub const fn keep_open(&mut self, keep_open: bool) {
        self.keep_open = keep_open;
    }

    /// Sends a command from the host to the device.
    ///
    /// # Panics
    /// Never: every command fits into a frame.
    pub fn send(&mut self, command: &link::ToDevice) {
        let mut buffer = [0; link::MAX_FRAME];
        let bytes = self.encoder.encode(0, command, &mut buffer);
        self.port.send(bytes.expect("commands are short"));
    }

    /// Causes a failure when the core next reaches the address of `symbol`.
    ///
    /// # Errors
    /// The image lacks the symbol or code that the failure needs, or the emulator has ended.
    pub fn inject_at(&mut self, symbol: &str, injection: Injection) -> Result<(), BoardError> {
        let change = injection.change(&self.image);
        let (Some(address), Some(change)) = (self.image.address(symbol), change) else {
            let what = format!("the image has no symbol {symbol}, or no code for {injection:?}");
            return Err(self.error(what));
        };
        if self.requests.send(Request::Inject(address, change)).is_err() {
            return Err(self.ended());
        }
        Ok(())
    }

    pub(crate) const fn observer(&self) -> &Observer {
        &self.observer
    }

    /// Runs until virtual time reaches `us` microseconds since power-on, and decodes the frames
    /// received from the device.
    ///
    /// # Errors
    /// The emulator fails or hangs, or the board resets in a loop.
    pub fn run_until_us(&mut self, us: u64) -> Result<(), BoardError> {
        self.advance(us * 1000)?;
        if self.keep_open {
            self.port.keep_open();
        }
        let bytes = self.port.take_received();
        self.inbox.decode(&bytes);
        Ok(())
    }

    /// Runs for `us` microseconds of virtual time, and decodes the frames received from the device.
    ///
    /// # Errors
    /// Those of [`run_until_us`](Self::run_until_us).
    pub fn run_for_us(&mut self, us: u64) -> Result<(), BoardError> {
        self.run_until_us(self.now_us() + us)
    }

    /// Runs for `us` microseconds of virtual time, but leaves the bytes from the device in the port
    /// for the caller to read.
    ///
    /// # Errors
    /// Those of [`run_until_us`](Self::run_until_us).
    pub fn advance_us(&mut self, us: u64) -> Result<(), BoardError> {
        self.advance(self.now_ns + us * 1000)
    }

    /// Runs until `holds` returns true for the frames received so far; `what` names this condition
    /// in the error.
    ///
    /// # Errors
    /// The condition does not hold within `limit_us` of virtual time, or the emulator fails.
    pub fn run_until(
        &mut self,
        what: &str,
        limit_us: u64,
        mut holds: impl FnMut(&[Frame]) -> bool,
    ) -> Result<(), BoardError> {
        let end = self.now_us() + limit_us;
        loop {
            if holds(self.inbox.frames()) {
                return Ok(());
            }
            if self.now_us() >= end {
                let what = format!("{what}: not within {limit_us} us of virtual time");
                return Err(self.error(what));
            }
            self.run_until_us((self.now_us() + POLL_US).min(end))?;
        }
    }

    /// Runs a closure on the emulator's session while virtual time is stopped; returns its result.
    ///
    /// # Errors
    /// The emulator has ended.
    pub(crate) fn inspect<T: Send + 'static>(
        &mut self,
        inspection: impl FnOnce(&mut Session<EmulatedBoard>, &mut dyn Host) -> T + Send + 'static,
    ) -> Result<T, BoardError> {
        let (sender, receiver) = channel();
        let request = Request::Inspect(Box::new(move |session, host| {
            // Ignore the error that occurs if the caller no longer waits for the result.
            let _ = sender.send(inspection(session, host));
        }));
        if self.requests.send(request).is_err() {
            return Err(self.ended());
        }
        receiver.recv().map_err(|_| self.ended())
    }

    /// Returns all problems that the emulator has detected since power-on.
    ///
    /// # Errors
    /// The emulator has ended.
    pub fn findings(&mut self) -> Result<Findings, BoardError> {
        let failed = self.observer.failed_accesses().into_iter();
        let failed = failed.map(|(address, pc)| match pc {
            Some(pc) => format!("{address:#010x} from {}", self.image.describe(pc)),
            None => format!("{address:#010x} from the core itself"),
        });
        let failed: Vec<String> = failed.collect();
        let mut findings = self.inspect(|session, _| Findings::from_session(session))?;
        findings.unmapped.extend(failed);
        Ok(findings)
    }

    /// Returns the error `what` with a diagnosis of the board's current state.
    pub fn error(&mut self, what: String) -> BoardError {
        let diagnosis = self.diagnosis();
        BoardError::new(what, diagnosis)
    }

    /// Returns a description of the board's current state for error messages.
    pub fn diagnosis(&mut self) -> String {
        let findings = self.findings().unwrap_or_default();
        let resets = findings.resets.iter();
        let resets: Vec<_> = resets.map(|(us, why)| format!("{us} us: {why}")).collect();
        let sections = [
            section("resets", &resets),
            section("unmapped", &findings.unmapped),
            section("refused", &findings.refused),
            section("violations of the reference manual", &findings.manual_violations),
        ];
        self.position() + &sections.concat()
    }

    /// Returns the part of the diagnosis that needs no reply from the emulator's thread.
    fn position(&self) -> String {
        let (now, instructions) = (self.now_us(), self.progress.instructions);
        let (frames, errors) = (self.inbox.frames().len(), self.inbox.decode_errors());
        let counters = self.observer.recent_program_counters();
        let counters = counters.iter().map(|&address| self.image.describe(address));
        let counters = section("program counters, the newest last", &counters.collect::<Vec<_>>());
        let not_decoded = section("frames that could not be decoded", errors);
        format!(
            "  at {now} us, {instructions} instructions, {frames} frames, {} not decoded\n\
             {counters}{not_decoded}",
            errors.len()
        )
    }

    fn advance(&mut self, ns: u64) -> Result<(), BoardError> {
        if ns <= self.now_ns {
            return Ok(());
        }
        if self.requests.send(Request::Run(ns)).is_err() {
            return Err(self.ended());
        }
        match self.reached.recv_timeout(TIMEOUT) {
            Ok(progress) => {
                self.progress = progress;
                self.now_ns = ns;
                if progress.is_reset_loop {
                    let what = "the board restarts again and again".to_owned();
                    return Err(self.error(what));
                }
                Ok(())
            }
            Err(RecvTimeoutError::Disconnected) => Err(self.ended()),
            Err(RecvTimeoutError::Timeout) => {
                // Do not join the hung thread, which would block; it ends with the process.
                self.thread = None;
                Err(BoardError::new(
                    format!(
                        "the emulator has made no progress for {} s of real time",
                        TIMEOUT.as_secs()
                    ),
                    self.position(),
                ))
            }
        }
    }

    /// Returns an error that says why the emulator has ended.
    fn ended(&mut self) -> BoardError {
        let result = self.thread.take().map(JoinHandle::join);
        let why = match result {
            Some(Ok(Err(error))) => error,
            Some(Err(_)) => "its thread has panicked".to_owned(),
            Some(Ok(Ok(()))) | None => "it had already ended".to_owned(),
        };
        BoardError::new(format!("the emulator has ended: {why}"), self.position())
    }
}

impl Drop for VirtualBoard {
    fn drop(&mut self) {
        // Ignore the error that occurs if the emulator has already ended.
        let _ = self.requests.send(Request::PowerOff);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
