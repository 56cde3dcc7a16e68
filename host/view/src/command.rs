//! The commands of the page's users, and the replies to them.

use serde_json::Value;
use tokio::sync::oneshot;

/// Longest text of a marker, characters.
pub const MAX_MARKER: usize = 200;

/// What a user of the page can ask for. Each command is a `POST` of a path, with its parameters as
/// the text of the body.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Command {
    /// `/start`: start the streams of the device.
    Start,
    /// `/stop`: stop the streams of the device.
    Stop,
    /// `/record` with `start`: begin to record the bytes between bridge and device.
    Record,
    /// `/record` with `stop`: end the recording.
    EndRecording,
    /// `/marker` with a text of 1 to [`MAX_MARKER`] characters: an event at this moment.
    Marker(String),
    /// `/self-test`: the device tests its converters.
    SelfTest,
    /// `/exclude` with `LABEL always`, `LABEL never` or `LABEL automatic`.
    Exclude {
        /// Label of the electrode.
        label: String,
        /// Who decides whether the electrode is excluded.
        decision: Decision,
    },
    /// `/rate` with a number: the rate of the packed code.
    Rate(u8),
}

/// Who decides whether an electrode is excluded from the codes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decision {
    /// The user decides: the electrode is always excluded.
    Always,
    /// The user decides: the electrode is never excluded.
    Never,
    /// The device decides: the electrode is excluded while the device finds it bad.
    Automatic,
}

impl Command {
    /// Returns the command that a `POST` of `path` with this body asks for; `None` if no command
    /// has this path.
    ///
    /// # Errors
    ///
    /// If the body does not have this command's form. The text says which form it must have.
    pub fn parse(path: &str, body: &[u8]) -> Option<Result<Command, &'static str>> {
        let text = std::str::from_utf8(body).ok();
        let bare = |command| {
            let is_bare = body.is_empty();
            is_bare.then_some(command).ok_or("this command has no body")
        };
        Some(match path {
            "/start" => bare(Command::Start),
            "/stop" => bare(Command::Stop),
            "/self-test" => bare(Command::SelfTest),
            "/record" => match text {
                Some("start") => Ok(Command::Record),
                Some("stop") => Ok(Command::EndRecording),
                _ => Err("the body must be start or stop"),
            },
            "/marker" => text.and_then(marker).ok_or(
                "a marker has 1 to 200 characters in UTF-8, and no line breaks or control \
                 characters",
            ),
            "/exclude" => text
                .and_then(exclusion)
                .ok_or("the body must be an electrode and always, never or automatic"),
            "/rate" => text.and_then(rate).ok_or("the body must be a rate of one or two digits"),
            _ => return None,
        })
    }
}

fn marker(text: &str) -> Option<Command> {
    let text = text.trim();
    let length = text.chars().count();
    let is_marker = (1..=MAX_MARKER).contains(&length) && !text.chars().any(char::is_control);
    is_marker.then(|| Command::Marker(text.to_owned()))
}

fn exclusion(text: &str) -> Option<Command> {
    let (label, decision) = text.split_once(' ')?;
    let decision = match decision {
        "always" => Decision::Always,
        "never" => Decision::Never,
        "automatic" => Decision::Automatic,
        _ => return None,
    };
    let is_label = !label.is_empty() && label.bytes().all(|byte| byte.is_ascii_graphic());
    is_label.then(|| Command::Exclude { label: label.to_owned(), decision })
}

fn rate(text: &str) -> Option<Command> {
    let is_number = (1..=2).contains(&text.len()) && text.bytes().all(|byte| byte.is_ascii_digit());
    let rate = text.parse().ok().filter(|_| is_number)?;
    Some(Command::Rate(rate))
}

/// Reply to a user's command: a JSON object whose `message` says what has happened, or a text that
/// says what is wrong and what to do.
pub type Answer = Result<Value, String>;

/// Handle for replying to a command. If it is dropped without a reply, the user reads that the
/// program has ended.
#[derive(Debug)]
pub struct Reply(oneshot::Sender<Answer>);

impl Reply {
    /// Creates the handle, and the receiver of the answer.
    pub(crate) fn new() -> (Reply, oneshot::Receiver<Answer>) {
        let (sender, receiver) = oneshot::channel();
        (Reply(sender), receiver)
    }

    /// Answers the command. Does nothing if the user has left the page.
    pub fn send(self, answer: Answer) {
        let _ = self.0.send(answer);
    }

    /// Answers that the command was carried out, with a text for the user.
    pub fn done(self, message: &str) {
        self.send(Ok(serde_json::json!({ "message": message })));
    }

    /// Answers that the command was not carried out, with the reason for the user.
    pub fn refuse(self, why: impl Into<String>) {
        self.send(Err(why.into()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(path: &str, body: &str) -> Option<Result<Command, &'static str>> {
        Command::parse(path, body.as_bytes())
    }

    #[test]
    fn every_command_has_one_form() {
        let exclude = |decision| Command::Exclude { label: "Cz".to_owned(), decision };
        for (path, body, command) in [
            ("/start", "", Command::Start),
            ("/stop", "", Command::Stop),
            ("/record", "start", Command::Record),
            ("/record", "stop", Command::EndRecording),
            ("/marker", " Augen zu, \u{e4}h ", Command::Marker("Augen zu, \u{e4}h".to_owned())),
            ("/self-test", "", Command::SelfTest),
            ("/exclude", "Cz always", exclude(Decision::Always)),
            ("/exclude", "Cz never", exclude(Decision::Never)),
            ("/exclude", "Cz automatic", exclude(Decision::Automatic)),
            ("/rate", "0", Command::Rate(0)),
            ("/rate", "15", Command::Rate(15)),
        ] {
            assert_eq!(parse(path, body), Some(Ok(command)), "{path} {body}");
        }
        let longest = "\u{e4}".repeat(MAX_MARKER);
        assert_eq!(parse("/marker", &longest), Some(Ok(Command::Marker(longest))));
    }

    #[test]
    fn other_bodies_are_refused() {
        let too_long = "x".repeat(MAX_MARKER + 1);
        for (path, body) in [
            ("/start", "x"),
            ("/record", ""),
            ("/record", "start "),
            ("/marker", ""),
            ("/marker", " "),
            ("/marker", "a\nb"),
            ("/marker", &too_long),
            ("/exclude", "Cz"),
            ("/exclude", " always"),
            ("/exclude", "Cz  always"),
            ("/exclude", "Cz,Fz always"),
            ("/exclude", "Cz always now"),
            ("/rate", ""),
            ("/rate", "-1"),
            ("/rate", "+1"),
            ("/rate", "256"),
        ] {
            let parsed = parse(path, body).expect("a command's path");
            // The parser accepts a comma in a label; the program, which knows all labels, refuses
            // such a label.
            assert_eq!(parsed.is_err(), body != "Cz,Fz always", "{path} {body}");
        }
        assert_eq!(Command::parse("/marker", &[0xff]).map(|of| of.is_err()), Some(true));
        assert_eq!(parse("/quit", ""), None);
    }
}
