//! Protocol of a single request to a device, as a state machine that performs no I/O itself.

pub(crate) mod report;

use link::{Ack, AckResult, Decoder, Encoder, MAX_FRAME, ResetInto, ToDevice, ToHost};
use thiserror::Error;

use crate::query::report::{DeviceSummary, SelfTestReport};
use crate::wire::commands::PendingCommand;
use crate::wire::words;

/// Timeout for the acknowledgement of a command, seconds.
const ACK_TIMEOUT_S: u32 = 5;
/// Timeout for the result of the self-test, or for the first `Hello` after a reset, seconds.
const RESULT_TIMEOUT_S: u32 = 15;

/// A single request to a device, for a subcommand such as `selftest`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// Report identity, firmware and model. The device keeps streaming.
    Identify,
    /// Test the converters with the test signals that they generate themselves.
    SelfTest,
    /// Restart the device, into its firmware or into its bootloader.
    Reset(ResetInto),
}

/// What a device answers to a [`Request`].
#[derive(Clone, Debug, PartialEq)]
pub enum Answer {
    /// Identity, firmware and model of the device.
    Identified(DeviceSummary),
    /// Results of the self-test, for each chip and channel.
    SelfTest(Box<SelfTestReport>),
    /// The device has restarted. The summary, sent after the restart, names the cause.
    Restarted(DeviceSummary),
    /// The device has agreed to start its bootloader, which does not use this protocol. The summary
    /// was therefore sent before the restart.
    InBootloader(DeviceSummary),
}

/// State machine of a single request: identifies the device, stops its streams, sends the request
/// and waits for the result. The caller passes in received bytes and times, sends the outgoing
/// bytes, and finally gets a [`QueryResult`].
#[derive(Debug)]
pub struct Query {
    request: Request,
    decoder: Decoder<MAX_FRAME>,
    encoder: Encoder,
    stage: Stage,
    since_us: i64,
    pending: Option<PendingCommand>,
    device: Option<(u32, DeviceSummary)>,
    /// Number of ADC channels, and labels of the electrodes, which are the first of these channels.
    /// `None` until the device has reported them.
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

/// Answer to a [`Query`], or the error that ended the query.
pub type QueryResult = Result<Answer, QueryError>;

/// Reason why a [`Query`] has no answer.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum QueryError {
    /// The device did not acknowledge a command, or did not send the result, before the timeout.
    #[error(
        "no answer {what} within {seconds} s; check cable, power and --baud, and that no other \
         program uses the port"
    )]
    NoAnswer {
        /// Phrase that completes the words "no answer", such as `to the reset command`.
        what: &'static str,
        /// Length of the timeout, seconds.
        seconds: u32,
    },
    /// The device refused the request: its acknowledgement states an error.
    #[error("the device refuses {what}: {why}")]
    Refused {
        /// What the device refuses to do, such as `to restart`.
        what: &'static str,
        /// Why the device refuses the request, and what the user can do next.
        why: &'static str,
    },
    /// The device restarted during its self-test, because of a reset, its watchdog or a fault.
    #[error(
        "the device restarted during its self-test, which has no result: {device}; try again, and \
         report this message if it happens again"
    )]
    RestartedDuringTest {
        /// Identity, cause of the restart, and any fault that the device reports after it.
        device: Box<DeviceSummary>,
    },
}

impl QueryError {
    /// Returns the exit status with which a program ends because of this error.
    pub fn exit_code(&self) -> u8 {
        match self {
            QueryError::RestartedDuringTest { .. } => 1,
            QueryError::NoAnswer { .. } => 3,
            QueryError::Refused { .. } => 4,
        }
    }
}

impl Query {
    /// Creates the query for a request. Call [`Query::connected`] after the port has been opened.
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

    /// Records that the port was opened or reopened at `now_us`. The query continues with the stage
    /// that it had reached.
    pub fn connected(&mut self, now_us: i64) {
        self.decoder.reset();
        self.outgoing.clear();
        self.pending = None;
        if self.stage != Stage::Wait {
            self.since_us = now_us;
        }
    }

    /// Returns whether the port may close and open again at present: a device on USB disconnects
    /// while it restarts.
    pub fn expects_reconnect(&self) -> bool {
        self.stage == Stage::Wait && matches!(self.request, Request::Reset(_))
    }

    /// Returns what the query is doing at present, as a phrase to show to the user.
    pub fn progress_text(&self) -> &'static str {
        match (self.stage, self.request) {
            (Stage::Identify, _) => "identifying the device",
            (Stage::Stop, _) => "stopping its streams",
            (_, Request::SelfTest) => "the device tests its converters",
            (_, Request::Identify | Request::Reset(_)) => "the device restarts",
        }
    }

    /// Returns the bytes that must be sent to the device now, and removes them from the query.
    pub fn outgoing(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.outgoing)
    }

    /// Handles bytes from the device, and returns the result if these bytes complete the query.
    pub fn receive(&mut self, mut bytes: &[u8], now_us: i64) -> Option<QueryResult> {
        // Frames borrow from the decoder, so the decoder is moved out of `self` while frames are
        // handled.
        let mut decoder = std::mem::take(&mut self.decoder);
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
                    Request::Identify | Request::Reset(_) => Ok(Answer::Restarted(device)),
                    Request::SelfTest => {
                        Err(QueryError::RestartedDuringTest { device: Box::new(device) })
                    }
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
                // Until this query has sent its request, a result belongs to another program's
                // request.
                matches!(self.stage, Stage::Request | Stage::Wait).then(|| {
                    let report = SelfTestReport::new(device, test, *channels, labels);
                    Ok(Answer::SelfTest(Box::new(report)))
                })
            }
            _ => None,
        }
    }

    fn handle_ack(&mut self, ack: Ack, now_us: i64) -> Option<QueryResult> {
        let pending = self.pending.filter(|pending| pending.is_acknowledged_by(ack.of))?;
        match (self.stage, ack.result) {
            (Stage::Identify, _) => {
                if let (Some((_, device)), Some(_)) = (&self.device, &self.montage) {
                    if self.request == Request::Identify {
                        return Some(Ok(Answer::Identified(device.clone())));
                    }
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
            // The request was sent twice. The device is busy with the first one, whose
            // acknowledgement was lost.
            (Stage::Request, AckResult::Busy) if pending.was_sent_again() => {
                self.enter(Stage::Wait, now_us);
            }
            (Stage::Request, refused) => {
                let (what, why) = refusal(self.request, refused);
                return Some(Err(QueryError::Refused { what, why }));
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

    /// Queues the next command if it is due at `now_us`. Returns an error if the answer that the
    /// query awaits is overdue.
    pub fn tick(&mut self, now_us: i64) -> Option<QueryResult> {
        let (what, seconds) = match (self.stage, self.request) {
            (Stage::Identify, _) => ("to the identification request", ACK_TIMEOUT_S),
            (Stage::Stop, _) => ("to the stop command", ACK_TIMEOUT_S),
            (Stage::Request, Request::SelfTest) => ("to the self-test command", ACK_TIMEOUT_S),
            (Stage::Request, _) => ("to the reset command", ACK_TIMEOUT_S),
            (Stage::Wait, Request::SelfTest) => {
                ("with the result of the self-test", RESULT_TIMEOUT_S)
            }
            (Stage::Wait, _) => ("after the restart", RESULT_TIMEOUT_S),
        };
        if now_us - self.since_us > i64::from(seconds) * 1_000_000 {
            return Some(Err(QueryError::NoAnswer { what, seconds }));
        }
        let command = match (self.stage, self.request) {
            // After a reset, ask for `Hello`: the device sends it unasked, but perhaps while the
            // port is still closed.
            (Stage::Identify, _) | (_, Request::Identify) | (Stage::Wait, Request::Reset(_)) => {
                ToDevice::Identify
            }
            (Stage::Stop, _) => ToDevice::Stop,
            (Stage::Request, Request::SelfTest) => ToDevice::SelfTest,
            (Stage::Request, Request::Reset(into)) => ToDevice::Reset(into),
            (Stage::Wait, Request::SelfTest) => return None,
        };
        if self.pending.is_none_or(|pending| pending.retry_is_due(now_us)) {
            self.send(command, now_us);
        }
        None
    }

    fn send(&mut self, command: ToDevice<'static>, now_us: i64) {
        let seq = self.encoder.next_seq();
        self.pending = Some(PendingCommand::sent(self.pending, command, seq, now_us));
        let mut buffer = [0; MAX_FRAME];
        match self.encoder.encode(0, &command, &mut buffer) {
            Ok(frame) => self.outgoing.extend_from_slice(frame),
            Err(error) => {
                let command = words::command(&command);
                tracing::error!(%error, "the command {command} cannot be sent");
            }
        }
    }
}

/// Returns why the device refuses a self-test, and what the user can do, as a sentence.
pub(crate) fn refusal_of_self_test(result: AckResult) -> String {
    let (what, why) = refusal(Request::SelfTest, result);
    QueryError::Refused { what, why }.to_string()
}

/// Returns what the device refuses to do, such as "to restart", and the reason with advice.
fn refusal(request: Request, result: AckResult) -> (&'static str, &'static str) {
    let what = match request {
        Request::SelfTest => "to test itself",
        Request::Reset(ResetInto::Bootloader) => "to start its bootloader",
        Request::Identify | Request::Reset(_) => "to restart",
    };
    let why = match (result, request) {
        (AckResult::UnknownCommand, _) => {
            "its firmware is older than this command; update the firmware"
        }
        (AckResult::NotSupported, Request::SelfTest) => {
            "its board has no converters that can be tested"
        }
        (AckResult::NotSupported | AckResult::BadArgument, Request::Reset(_)) => {
            "its board cannot do that by a command; use its reset button, with BOOT0 high for the \
             bootloader"
        }
        (AckResult::Busy, _) => {
            "it is busy: it streams for another program, or is testing itself already; end that \
             program, or try again in a few seconds"
        }
        (AckResult::Failed, _) => {
            "it tried and failed; reset it (corticode-bridge reset) and try again"
        }
        _ => "its reason is newer than this bridge; bring firmware and bridge to the same release",
    };
    (what, why)
}
