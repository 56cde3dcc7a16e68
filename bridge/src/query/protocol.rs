//! One question to a device, without the world.

use link::{Ack, AckResult, Decoder, Encoder, MAX_FRAME, ResetInto, ToDevice, ToHost};

use crate::error::BridgeError;
use crate::query::report::{DeviceLine, SelfTestReport};

/// How long an answer may take before the command is sent again, microseconds.
const RETRY_US: i64 = 500_000;
/// How long a device may take to acknowledge a command, seconds.
const ACK_S: u32 = 5;
/// How long it may take to test its converters, or to come back after a reset, seconds.
const RESULT_S: u32 = 15;

/// What a device is asked to do once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Question {
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
    Back(DeviceLine),
    /// It is in its loader and says nothing more.
    InLoader(DeviceLine),
}

/// One question to a device: who are you, stop, do it, and what came of it. Bytes and times in,
/// bytes and an outcome out.
#[derive(Debug)]
pub struct Inquiry {
    question: Question,
    decoder: Decoder<MAX_FRAME>,
    encoder: Encoder,
    stage: Stage,
    since_us: i64,
    pending: Option<Pending>,
    device: Option<(u32, DeviceLine)>,
    /// ADC channels and the labels of the first ones.
    montage: Option<(usize, Vec<String>)>,
    outgoing: Vec<u8>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Identify,
    Stop,
    Ask,
    Wait,
}

/// A command that has no answer yet.
#[derive(Clone, Copy, Debug)]
struct Pending {
    first_seq: u32,
    last_seq: u32,
    sent_us: i64,
}

/// How an inquiry ends.
pub type Outcome = Result<Answer, BridgeError>;

impl Inquiry {
    /// Before the port is open.
    pub fn new(question: Question) -> Inquiry {
        Inquiry {
            question,
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
    pub fn may_lose_port(&self) -> bool {
        self.stage == Stage::Wait && matches!(self.question, Question::Reset(_))
    }

    /// What happens now, for a person.
    pub fn words(&self) -> &'static str {
        match (self.stage, self.question) {
            (Stage::Identify, _) => "asking who is there",
            (Stage::Stop, _) => "stopping its streams",
            (_, Question::SelfTest) => "the device tests its converters",
            (_, Question::Reset(_)) => "the device starts anew",
        }
    }

    /// Bytes for the device.
    pub fn outgoing(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.outgoing)
    }

    /// Bytes came from the device.
    pub fn receive(&mut self, mut bytes: &[u8], now_us: i64) -> Option<Outcome> {
        // The decoder lends what it decodes, so it stays outside meanwhile.
        let mut decoder = std::mem::replace(&mut self.decoder, Decoder::new());
        let mut outcome = None;
        while outcome.is_none()
            && let Some(frame) = decoder.next::<ToHost>(&mut bytes)
        {
            if let Ok(frame) = frame {
                outcome = self.message(&frame.message, now_us);
            }
        }
        self.decoder = decoder;
        outcome
    }

    fn message(&mut self, message: &ToHost, now_us: i64) -> Option<Outcome> {
        match message {
            ToHost::Hello(hello) => {
                let device = DeviceLine::new(hello);
                let before = self.device.replace((hello.session_id, device.clone()));
                let other = before.is_some_and(|(session_id, _)| session_id != hello.session_id);
                let asked = matches!(self.stage, Stage::Ask | Stage::Wait);
                (asked && other).then_some(match self.question {
                    Question::Reset(_) => Ok(Answer::Back(device)),
                    Question::SelfTest => Err(BridgeError::Restarted {
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
            ToHost::Ack(ack) => self.acknowledged(*ack, now_us),
            ToHost::SelfTest(test) if self.question == Question::SelfTest => {
                let (_, device) = self.device.clone()?;
                let (channels, labels) = self.montage.as_ref()?;
                // One that somebody else asked for before says nothing of now.
                matches!(self.stage, Stage::Ask | Stage::Wait).then(|| {
                    let report = SelfTestReport::new(device, test, *channels, labels);
                    Ok(Answer::SelfTest(Box::new(report)))
                })
            }
            _ => None,
        }
    }

    fn acknowledged(&mut self, ack: Ack, now_us: i64) -> Option<Outcome> {
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
            (Stage::Stop, _) => self.enter(Stage::Ask, now_us),
            (Stage::Ask, AckResult::Done) => {
                self.enter(Stage::Wait, now_us);
                if let (Question::Reset(ResetInto::Bootloader), Some((_, device))) =
                    (self.question, &self.device)
                {
                    return Some(Ok(Answer::InLoader(device.clone())));
                }
            }
            // The first one arrived, its acknowledgement did not.
            (Stage::Ask, AckResult::Busy) if repeated => self.enter(Stage::Wait, now_us),
            (Stage::Ask, refused) => {
                let (what, why) = refusal(self.question, refused);
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
    pub fn tick(&mut self, now_us: i64) -> Option<Outcome> {
        let (what, seconds) = match (self.stage, self.question) {
            (Stage::Identify, _) => ("to the question who is there", ACK_S),
            (Stage::Stop, _) => ("to the command to stop", ACK_S),
            (Stage::Ask, Question::SelfTest) => ("to the command to test itself", ACK_S),
            (Stage::Ask, Question::Reset(_)) => ("to the command to start anew", ACK_S),
            (Stage::Wait, Question::SelfTest) => ("with the result of the self-test", RESULT_S),
            (Stage::Wait, Question::Reset(_)) => ("after the restart", RESULT_S),
        };
        if now_us - self.since_us > i64::from(seconds) * 1_000_000 {
            return Some(Err(BridgeError::Silent { what, seconds }));
        }
        let command = match (self.stage, self.question) {
            // After a reset its Hello may have come while nobody listened.
            (Stage::Identify, _) | (Stage::Wait, Question::Reset(_)) => ToDevice::Identify,
            (Stage::Stop, _) => ToDevice::Stop,
            (Stage::Ask, Question::SelfTest) => ToDevice::SelfTest,
            (Stage::Ask, Question::Reset(into)) => ToDevice::Reset(into),
            (Stage::Wait, Question::SelfTest) => return None,
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
fn refusal(question: Question, result: AckResult) -> (&'static str, &'static str) {
    let what = match question {
        Question::SelfTest => "to test itself",
        Question::Reset(ResetInto::Bootloader) => "to start its loader",
        Question::Reset(_) => "to start anew",
    };
    let why = match (result, question) {
        (AckResult::UnknownCommand, _) => {
            "its firmware is older than this command; update the firmware"
        }
        (AckResult::NotSupported, Question::SelfTest) => {
            "its board has no converters that can be tested; nothing can be said about them"
        }
        (AckResult::NotSupported | AckResult::BadArgument, Question::Reset(_)) => {
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
