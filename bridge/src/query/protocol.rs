//! One request to a device, without the world.

use link::{Ack, AckResult, Decoder, Encoder, MAX_FRAME, ResetInto, ToDevice, ToHost};

use crate::error::BridgeError;
use crate::query::report::{DeviceSummary, SelfTestReport};

/// How long an answer may take before the command is sent again, microseconds.
const RETRY_US: i64 = 500_000;
/// How long a device may take to acknowledge a command, seconds.
const ACK_TIMEOUT_S: u32 = 5;
/// How long it may take to test its converters, or to come back after a reset, seconds.
const RESULT_TIMEOUT_S: u32 = 15;

/// What a device is requested to do once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// Try its converters with their own signals.
    SelfTest,
    /// Start anew.
    Reset(ResetInto),
}

/// What came of it.
#[derive(Clone, Debug, PartialEq)]
pub enum Answer {
    /// What it found out.
    SelfTest(Box<SelfTestReport>),
    /// It is back, and says why it started.
    Restarted(DeviceSummary),
    /// It is in its loader and says nothing more.
    InBootloader(DeviceSummary),
}

/// One request to a device: who are you, stop, do it, and what came of it. Bytes and times in,
/// bytes and an outcome out.
#[derive(Debug)]
pub struct Query {
    request: Request,
    decoder: Decoder<MAX_FRAME>,
    encoder: Encoder,
    stage: Stage,
    since_us: i64,
    pending: Option<Pending>,
    device: Option<(u32, DeviceSummary)>,
    /// ADC channels and the labels of the first ones.
    montage: Option<(usize, Vec<String>)>,
    outgoing: Vec<u8>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Identify,
    Stop,
    Request,
    Wait,
}

/// A command that has no answer yet.
#[derive(Clone, Copy, Debug)]
struct Pending {
    first_seq: u32,
    last_seq: u32,
    sent_us: i64,
}

/// How an query ends.
pub type QueryResult = Result<Answer, BridgeError>;

impl Query {
    /// Before the port is open.
    pub fn new(request: Request) -> Query {
        Query {
            request,
            decoder: Decoder::new(),
            encoder: Encoder::default(),
            stage: Stage::Identify,
            since_us: 0,
            pending: None,
            device: None,
            montage: None,
            outgoing: Vec::new(),
        }
    }

    /// A port was opened, for the first time or again.
    pub fn connected(&mut self, now_us: i64) {
        self.decoder.reset();
        self.outgoing.clear();
        self.pending = None;
        if self.stage != Stage::Wait {
            self.since_us = now_us;
        }
    }

    /// Whether the port may go and come back meanwhile: a device that starts anew leaves USB.
    pub fn expects_reconnect(&self) -> bool {
        self.stage == Stage::Wait && matches!(self.request, Request::Reset(_))
    }

    /// What happens now, for a person.
    pub fn progress_text(&self) -> &'static str {
        match (self.stage, self.request) {
            (Stage::Identify, _) => "asking who is there",
            (Stage::Stop, _) => "stopping its streams",
            (_, Request::SelfTest) => "the device tests its converters",
            (_, Request::Reset(_)) => "the device starts anew",
        }
    }

    /// Bytes for the device.
    pub fn outgoing(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.outgoing)
    }

    /// Bytes came from the device.
    pub fn receive(&mut self, mut bytes: &[u8], now_us: i64) -> Option<QueryResult> {
        // The decoder lends what it decodes, so it stays outside meanwhile.
        let mut decoder = std::mem::replace(&mut self.decoder, Decoder::new());
        let mut outcome = None;
        while outcome.is_none()
            && let Some(frame) = decoder.next::<ToHost>(&mut bytes)
        {
            if let Ok(frame) = frame {
                outcome = self.handle_message(&frame.message, now_us);
            }
        }
        self.decoder = decoder;
        outcome
    }

    fn handle_message(&mut self, message: &ToHost, now_us: i64) -> Option<QueryResult> {
        match message {
            ToHost::Hello(hello) => {
                let device = DeviceSummary::new(hello);
                let before = self.device.replace((hello.session_id, device.clone()));
                let other = before.is_some_and(|(session_id, _)| session_id != hello.session_id);
                let requested = matches!(self.stage, Stage::Request | Stage::Wait);
                (requested && other).then_some(match self.request {
                    Request::Reset(_) => Ok(Answer::Restarted(device)),
                    Request::SelfTest => Err(BridgeError::RestartedDuringTest {
                        device: Box::new(device),
                    }),
                })
            }
            ToHost::Capabilities(capabilities) => {
                let labels = capabilities.labels.split_whitespace();
                let labels = labels.map(str::to_owned).collect();
                self.montage = Some((usize::from(capabilities.channels), labels));
                None
            }
            ToHost::Ack(ack) => self.handle_ack(*ack, now_us),
            ToHost::SelfTest(test) if self.request == Request::SelfTest => {
                let (_, device) = self.device.clone()?;
                let (channels, labels) = self.montage.as_ref()?;
                // One that somebody else requested for before says nothing of now.
                matches!(self.stage, Stage::Request | Stage::Wait).then(|| {
                    let report = SelfTestReport::new(device, test, *channels, labels);
                    Ok(Answer::SelfTest(Box::new(report)))
                })
            }
            _ => None,
        }
    }

    fn handle_ack(&mut self, ack: Ack, now_us: i64) -> Option<QueryResult> {
        let ours = |pending: &Pending| {
            let span = pending.last_seq.wrapping_sub(pending.first_seq);
            ack.of.wrapping_sub(pending.first_seq) <= span
        };
        let pending = self.pending.filter(ours)?;
        let repeated = pending.first_seq != pending.last_seq;
        match (self.stage, ack.result) {
            (Stage::Identify, _) => {
                if self.device.is_some() && self.montage.is_some() {
                    self.enter(Stage::Stop, now_us);
                }
            }
            (Stage::Stop, _) => self.enter(Stage::Request, now_us),
            (Stage::Request, AckResult::Done) => {
                self.enter(Stage::Wait, now_us);
                if let (Request::Reset(ResetInto::Bootloader), Some((_, device))) =
                    (self.request, &self.device)
                {
                    return Some(Ok(Answer::InBootloader(device.clone())));
                }
            }
            // The first one arrived, its acknowledgement did not.
            (Stage::Request, AckResult::Busy) if repeated => self.enter(Stage::Wait, now_us),
            (Stage::Request, refused) => {
                let (what, why) = refusal(self.request, refused);
                return Some(Err(BridgeError::Refused { what, why }));
            }
            (Stage::Wait, _) => {}
        }
        None
    }

    fn enter(&mut self, stage: Stage, now_us: i64) {
        self.stage = stage;
        self.since_us = now_us;
        self.pending = None;
    }

    /// Time passes: the command that is due goes out; who waits too long gives up.
    pub fn tick(&mut self, now_us: i64) -> Option<QueryResult> {
        let (what, seconds) = match (self.stage, self.request) {
            (Stage::Identify, _) => ("to the request who is there", ACK_TIMEOUT_S),
            (Stage::Stop, _) => ("to the command to stop", ACK_TIMEOUT_S),
            (Stage::Request, Request::SelfTest) => ("to the command to test itself", ACK_TIMEOUT_S),
            (Stage::Request, Request::Reset(_)) => ("to the command to start anew", ACK_TIMEOUT_S),
            (Stage::Wait, Request::SelfTest) => {
                ("with the result of the self-test", RESULT_TIMEOUT_S)
            }
            (Stage::Wait, Request::Reset(_)) => ("after the restart", RESULT_TIMEOUT_S),
        };
        if now_us - self.since_us > i64::from(seconds) * 1_000_000 {
            return Some(Err(BridgeError::NoAnswer { what, seconds }));
        }
        let command = match (self.stage, self.request) {
            // After a reset its Hello may have come while nobody listened.
            (Stage::Identify, _) | (Stage::Wait, Request::Reset(_)) => ToDevice::Identify,
            (Stage::Stop, _) => ToDevice::Stop,
            (Stage::Request, Request::SelfTest) => ToDevice::SelfTest,
            (Stage::Request, Request::Reset(into)) => ToDevice::Reset(into),
            (Stage::Wait, Request::SelfTest) => return None,
        };
        let waits = |pending: Pending| now_us - pending.sent_us < RETRY_US;
        if !self.pending.is_some_and(waits) {
            self.send(&command, now_us);
        }
        None
    }

    fn send(&mut self, command: &ToDevice, now_us: i64) {
        let seq = self.encoder.next_seq();
        self.pending = Some(Pending {
            first_seq: self.pending.map_or(seq, |pending| pending.first_seq),
            last_seq: seq,
            sent_us: now_us,
        });
        let mut buffer = [0; MAX_FRAME];
        match self.encoder.encode(0, command, &mut buffer) {
            Ok(frame) => self.outgoing.extend_from_slice(frame),
            Err(error) => tracing::error!(%error, ?command, "a command cannot be sent"),
        }
    }
}

/// What was refused; why, and what to do next.
fn refusal(request: Request, result: AckResult) -> (&'static str, &'static str) {
    let what = match request {
        Request::SelfTest => "to test itself",
        Request::Reset(ResetInto::Bootloader) => "to start its loader",
        Request::Reset(_) => "to start anew",
    };
    let why = match (result, request) {
        (AckResult::UnknownCommand, _) => {
            "its firmware is older than this command; update the firmware"
        }
        (AckResult::NotSupported, Request::SelfTest) => {
            "its board has no converters that can be tested; nothing can be said about them"
        }
        (AckResult::NotSupported | AckResult::BadArgument, Request::Reset(_)) => {
            "its board cannot do that by a command; use its reset button, with BOOT0 high for the \
             loader"
        }
        (AckResult::Busy, _) => {
            "it is busy: it streams for another program, or tests itself already; end that program, \
             or try again in some seconds"
        }
        (AckResult::Failed, _) => {
            "it tried and could not; start it anew (corticode-bridge reset) and try again"
        }
        _ => "it gives no reason that this bridge knows; bring firmware and bridge to one release",
    };
    (what, why)
}
