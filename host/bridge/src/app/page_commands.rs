//! Carries out the commands of the live page, and answers each when its outcome is known.

use std::time::Duration;

use bridge_core::{Core, HostTime};
use link::{MAX_RATE, Streams};
use serde_json::json;
use tokio::sync::mpsc::{UnboundedReceiver, UnboundedSender, unbounded_channel};
use tokio::time::Instant;
use view::{Command, Decision, Reply};

use crate::app::outlets::Outlets;

/// Time limit for the device to answer a command. Until the answer, the command is sent again every
/// 0.5 s.
const TIMEOUT: Duration = Duration::from_secs(5);

/// A command, the host time at which it arrived, and the handle for replying to the page.
type Asked = (Command, HostTime, Reply);

/// Sending end of the channel of commands, for the live page.
#[derive(Clone, Debug)]
pub(crate) struct PageSender(UnboundedSender<Asked>);

impl PageSender {
    /// Sends a command to the bridge. If the bridge is shutting down, `reply` is dropped, and the
    /// page shows that the program has ended.
    pub(crate) fn send(&self, command: Command, reply: Reply) {
        let _ = self.0.send((command, HostTime::now(), reply));
    }
}

/// Commands of the live page: those not carried out yet, and those not answered yet.
pub(crate) struct PageCommands {
    asked: UnboundedReceiver<Asked>,
    /// Keeps the channel open if there is no page.
    sender: PageSender,
    pending: Vec<Pending>,
}

/// A command whose outcome is not known yet.
struct Pending {
    awaited: Awaited,
    deadline: Instant,
    reply: Reply,
}

/// What the device must do or accept before the command is answered.
enum Awaited {
    Started,
    Stopped,
    Exclusion(String),
    Rate(u8),
    SelfTest,
}

impl Default for PageCommands {
    fn default() -> PageCommands {
        let (sender, asked) = unbounded_channel();
        PageCommands { asked, sender: PageSender(sender), pending: Vec::new() }
    }
}

impl PageCommands {
    pub(crate) fn sender(&self) -> PageSender {
        self.sender.clone()
    }

    /// Waits for a command. Cancel safe.
    pub(crate) async fn next(&mut self) -> Asked {
        match self.asked.recv().await {
            Some(asked) => asked,
            // Unreachable, because `self.sender` keeps the channel open.
            None => std::future::pending().await,
        }
    }

    /// Carries out a command, and answers it if its outcome is known at once.
    pub(crate) fn perform(
        &mut self,
        (command, at, reply): Asked,
        core: &mut Core,
        outlets: &mut Outlets,
    ) {
        match command {
            Command::Start if core.is_streaming() => reply.done("the device streams already"),
            Command::Start => {
                core.set_streaming(true);
                self.wait(Awaited::Started, reply);
            }
            Command::Stop => {
                core.set_streaming(false);
                self.wait(Awaited::Stopped, reply);
            }
            Command::Record => match outlets.recording.start(at) {
                Ok(path) => reply.done(&format!("recording to {}", path.display())),
                Err(why) => reply.refuse(why),
            },
            Command::EndRecording => match outlets.recording.stop(at) {
                Ok(ended) => drop(tokio::task::spawn_blocking(move || match ended.finish() {
                    Ok(summary) => reply.done(&summary),
                    Err(why) => reply.refuse(why),
                })),
                Err(why) => reply.refuse(why),
            },
            Command::Marker(text) => mark(&text, at, core, outlets, reply),
            Command::SelfTest => match core.start_self_test() {
                Ok(()) => self.wait(Awaited::SelfTest, reply),
                Err(why) => reply.refuse(why),
            },
            Command::Exclude { label, decision } => self.exclude(&label, decision, core, reply),
            Command::Rate(rate) => self.set_rate(rate, core, reply),
        }
    }

    /// Stores a reply until the device answers. Refuses older waiting commands of the same kind.
    fn wait(&mut self, awaited: Awaited, reply: Reply) {
        let kind = awaited.kind();
        for replaced in self.pending.extract_if(.., |one| one.awaited.kind() == kind) {
            replaced.reply.refuse("a newer command has replaced this one");
        }
        // The core ends an unanswered self-test after 15 s, before this timeout.
        let timeout = match awaited {
            Awaited::SelfTest => 5 * TIMEOUT,
            _ => TIMEOUT,
        };
        self.pending.push(Pending { awaited, deadline: Instant::now() + timeout, reply });
    }

    fn exclude(&mut self, label: &str, decision: Decision, core: &mut Core, reply: Reply) {
        let Some(labels) = core.electrodes() else {
            return reply.refuse("no device has introduced itself; connect it and try again");
        };
        let is_named = |known: &&String| known.eq_ignore_ascii_case(label);
        let Some(label) = labels.iter().find(is_named).cloned() else {
            let known = labels.join(" ");
            return reply.refuse(format!("the device has no electrode {label}; it has {known}"));
        };
        let mut exclusions = core.exclusions().clone();
        for list in [&mut exclusions.always, &mut exclusions.never] {
            list.retain(|known| !known.eq_ignore_ascii_case(&label));
        }
        let done = match decision {
            Decision::Always => {
                exclusions.always.push(label.clone());
                format!("{label} is excluded from the codes")
            }
            Decision::Never => {
                exclusions.never.push(label.clone());
                format!("{label} is never excluded from the codes")
            }
            Decision::Automatic if exclusions.automatic => {
                format!("{label} is excluded while the device finds it bad")
            }
            Decision::Automatic => format!("{label} is included: the device looks for no bad ones"),
        };
        core.set_exclusions(exclusions);
        if core.is_streaming_wanted() {
            self.wait(Awaited::Exclusion(done), reply);
        } else {
            reply.done(&format!("{done}, once the device streams"));
        }
    }

    fn set_rate(&mut self, rate: u8, core: &mut Core, reply: Reply) {
        if rate > MAX_RATE {
            return reply.refuse(format!("{rate} is no rate; choose 0 (finest) to {MAX_RATE}"));
        }
        if !core.streams().contains(Streams::PACKED) {
            return reply.refuse(
                "the device is asked for no packed blocks, which alone have a rate; start the \
                 program with --streams packed",
            );
        }
        core.set_packed_rate(rate);
        if core.is_streaming_wanted() {
            self.wait(Awaited::Rate(rate), reply);
        } else {
            reply.done(&format!("the packed code has rate {rate}, once the device streams"));
        }
    }

    /// Replies to the commands that the device has answered, or whose deadline has passed.
    pub(crate) fn answer(&mut self, core: &mut Core) {
        if self.pending.is_empty() {
            return;
        }
        let now = Instant::now();
        for Pending { awaited, deadline, reply } in std::mem::take(&mut self.pending) {
            match awaited.outcome(core) {
                Some(Ok(value)) => reply.send(Ok(value)),
                Some(Err(why)) => reply.refuse(why),
                None if now >= deadline => reply.refuse(
                    "the device has not answered; the command stays in force, and is sent again",
                ),
                None => self.pending.push(Pending { awaited, deadline, reply }),
            }
        }
    }
}

impl Awaited {
    /// Returns the kind of command; a newer command replaces a waiting one of the same kind.
    const fn kind(&self) -> &'static str {
        match self {
            Awaited::Started | Awaited::Stopped => "streaming",
            Awaited::Exclusion(_) => "exclusion",
            Awaited::Rate(_) => "rate",
            Awaited::SelfTest => "self-test",
        }
    }

    /// Returns the answer to the user; `None` while the device has not answered.
    fn outcome(&self, core: &mut Core) -> Option<view::Answer> {
        let done = |message: &str| Ok(json!({ "message": message }));
        let if_accepted = |answer: Result<(), String>, message: &str| match answer {
            Ok(()) => done(message),
            Err(why) => Err(format!("the device refuses: {why}")),
        };
        match self {
            Awaited::Started => core.is_streaming().then(|| done("the device streams")),
            Awaited::Stopped => core.is_stopped().then(|| done("the device is stopped")),
            Awaited::Exclusion(message) => {
                core.exclusion_answer().map(|answer| if_accepted(answer, message))
            }
            Awaited::Rate(rate) => {
                let message = format!("the packed code has rate {rate}");
                let answer = core.packed_rate_answer();
                answer.map(|answer| if_accepted(answer, &message))
            }
            Awaited::SelfTest => core.take_self_test().map(|result| {
                let report = result?;
                Ok(json!({ "message": report.verdict, "report": report }))
            }),
        }
    }
}

/// Publishes and records a marker.
fn mark(text: &str, at: HostTime, core: &mut Core, outlets: &mut Outlets, reply: Reply) {
    let is_recorded = outlets.recording.marker(text, at);
    let is_published = core.mark(text, at, outlets);
    let places = match (is_recorded, is_published) {
        (Some(true), true) => "in the recording and among the events",
        (Some(true), false) => "in the recording",
        (Some(false), true) => "among the events; the recording has lost it, as its disk is slow",
        (Some(false), false) => {
            return reply.refuse("the recording has lost the marker, as its disk is slow");
        }
        (None, true) => "among the events; nothing is being recorded",
        (None, false) => {
            return reply.refuse(
                "nothing would keep the marker: events are not among the streams, and nothing is \
                 being recorded; start a recording first",
            );
        }
    };
    reply.send(Ok(json!({
        "message": format!("marked {places}"),
        "text": text,
        "wall_ms": at.wall_ns / 1_000_000,
        "published": is_published,
    })));
}
