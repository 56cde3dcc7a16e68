//! Errors of the inlet, with advice for the user.

use thiserror::Error;

use crate::inlet::InletOptions;
use crate::liblsl::CallError;

/// Reason why a stream cannot be received and encoded.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum InletError {
    /// Several streams match. Holds the name and host of each, and the option that selects it.
    #[error("{} streams match; choose one: {}", .0.len(), .0.join(", "))]
    Several(Vec<String>),
    /// The stream holds strings.
    #[error("the stream {0} holds texts; name one with signals")]
    Text(String),
    /// The nominal rate is 0 or not a whole number. Holds the stream's name and its rate.
    #[error(
        "the stream {0} has {1}, and codes need a regular one of a whole number of Hz; state it with --source-rate HZ"
    )]
    Rate(String, String),
    /// A channel has no label. Holds the stream and the channel's number, from 1.
    #[error(
        "channel {1} of the stream {0} has no label; name all channels with --source-labels Fp1,Fp2,..."
    )]
    Label(String, usize),
    /// Two channels have the same label. Holds the stream and the label.
    #[error(
        "two channels of the stream {0} have the label {1}; name all channels with --source-labels Fp1,Fp2,..."
    )]
    Twice(String, String),
    /// No channel has the type EEG.
    #[error(
        "no channel of the stream {0} has the type EEG; name all channels with --source-labels Fp1,Fp2,..."
    )]
    Nothing(String),
    /// The user states too many or too few labels. Holds the stream, and the numbers of channels
    /// and labels.
    #[error("the stream {0} has {1} channels, and --source-labels names {2}")]
    Labels(String, usize, usize),
    /// A channel's unit is missing or unknown. Holds the stream, the channel's label and the unit.
    #[error(
        "channel {1} of the stream {0} has the unit \"{2}\"; state it with --source-unit microvolts (or millivolts, volts)"
    )]
    Unit(String, String, String),
    /// The stream is found and does not answer.
    #[error(
        "the stream {0} is found and does not answer; allow TCP and UDP ports 16571 to 16604 between both machines, or \
         restart its program"
    )]
    Silent(String),
    /// The stream has ended before it described itself, or liblsl fails.
    #[error("{0}")]
    Call(String),
}

impl InletError {
    /// Returns a short name for this kind of error, such as "unit of the stream".
    pub const fn kind(&self) -> &'static str {
        match self {
            InletError::Several(_) => "several streams",
            InletError::Text(_) => "stream of texts",
            InletError::Rate(..) => "rate of the stream",
            InletError::Label(..) | InletError::Labels(..) | InletError::Twice(..) => {
                "labels of the stream"
            }
            InletError::Nothing(_) => "stream without electrodes",
            InletError::Unit(..) => "unit of the stream",
            InletError::Silent(_) => "silent stream",
            InletError::Call(_) => "stream",
        }
    }
}

impl From<CallError> for InletError {
    fn from(error: CallError) -> InletError {
        InletError::Call(error.to_string())
    }
}

/// Properties by which streams are told apart.
#[derive(Clone, Debug)]
pub(crate) struct Identity {
    pub(crate) name: String,
    pub(crate) source_id: String,
    pub(crate) host: String,
}

impl Identity {
    /// Returns queries that match the stream and possibly other streams; the easiest to type is
    /// first.
    fn queries(&self) -> Vec<String> {
        let is_plain = !self.name.contains('=');
        let queries = [
            format!("{}{}", if is_plain { "" } else { "name=" }, self.name),
            format!("source_id={}", self.source_id),
            format!("hostname={}", self.host),
        ];
        let finds = |query: &String| InletOptions::parse_query(query).is_ok();
        queries.into_iter().filter(finds).collect()
    }
}

/// Returns, for each of several streams, its name, its host, and the option that selects this
/// stream and none of the others.
pub(crate) fn choices(streams: &[Identity]) -> Vec<String> {
    let queries: Vec<Vec<String>> = streams.iter().map(Identity::queries).collect();
    let choice = |(stream, of): (&Identity, &Vec<String>)| {
        let is_unique =
            |query: &&String| queries.iter().filter(|other| other.contains(query)).count() == 1;
        let Identity { name, host, .. } = stream;
        match of.iter().find(is_unique) {
            Some(query) => format!("{name} on {host} with --source {}", quoted(query)),
            None => format!(
                "{name} on {host}, which has neither name, source id nor host of \
                 its own: rename or close it"
            ),
        }
    };
    streams.iter().zip(&queries).map(choice).collect()
}

/// Returns the value of `--source`, quoted for a shell if needed. Queries hold no quotation mark.
fn quoted(query: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "-_.:=/+@%,".contains(c);
    let mark = if query.chars().all(is_plain) { "" } else { "'" };
    format!("{mark}lsl:{query}{mark}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn typed(streams: &[[&str; 3]]) -> Vec<String> {
        let streams = streams.iter().map(|of| {
            let [name, source_id, host] = of.map(str::to_owned);
            Identity { name, source_id, host }
        });
        let choices = choices(&streams.collect::<Vec<_>>());
        let typed =
            |choice: &String| choice.split_once(" --source ").map(|(_, typed)| typed.to_owned());
        choices.iter().map(|choice| typed(choice).unwrap_or_default()).collect()
    }

    #[test]
    fn each_stream_is_chosen_by_the_first_property_that_no_other_has() {
        assert_eq!(typed(&[["a", "1", "pc"], ["b", "1", "pc"]]), ["lsl:a", "lsl:b"]);
        let same_name = [["a", "1", "pc"], ["a", "2", "pc"]];
        assert_eq!(typed(&same_name), ["lsl:source_id=1", "lsl:source_id=2"]);
        // The name of the first stream would be read as a property; the source id of the second
        // contains a space.
        let hard = [["x=a", "", "pc"], ["b", "my amp", "pc"], ["b", "", "tablet"]];
        let expected = ["lsl:name=x=a", "'lsl:source_id=my amp'", "lsl:hostname=tablet"];
        assert_eq!(typed(&hard), expected);
        assert_eq!(typed(&[["a", "1", "pc"], ["a", "1", "pc"]]), ["", ""]);
        // A quotation mark cannot be part of a query.
        assert_eq!(typed(&[["a'b", "1", "pc"], ["c", "2", "pc"]]), ["lsl:source_id=1", "lsl:c"]);
    }
}
