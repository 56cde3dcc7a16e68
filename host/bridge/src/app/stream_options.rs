//! Options that state what the device is asked for.

use bridge_core::{RawForm, StreamKind, with_codes};
use clap::Args;

use crate::app::choices::choice;
use link::{MAX_RATE, Streams};

/// What the device is asked for; options of the bridge and of `record`.
#[derive(Clone, Debug, Args)]
pub(crate) struct StreamOptions {
    /// Mains frequency that the device shall remove, Hz; the device chooses by default
    #[arg(long, env = "CORTICODE_MAINS", value_parser = mains)]
    pub(crate) mains: Option<u8>,
    /// Streams of the device, comma-separated; codes are included unless packed is named. A device
    /// that refuses some is asked for fewer
    #[arg(
        long,
        env = "CORTICODE_STREAMS",
        value_parser = choice::<StreamKind>(),
        value_delimiter = ',',
        default_value = "codes,audit,events"
    )]
    pub(crate) streams: Vec<StreamKind>,
    /// Rate of the packed code, 0 to 15: one more is 3 dB coarser; the model's by default
    #[arg(long, env = "CORTICODE_PACKED_RATE", value_parser = clap::value_parser!(u8).range(0..=i64::from(MAX_RATE)))]
    pub(crate) packed_rate: Option<u8>,
    /// Form in which the device sends the samples of the stream raw; both yield the same frames
    #[arg(long, env = "CORTICODE_RAW_FORM", default_value = "any", value_parser = choice::<RawForm>())]
    pub(crate) raw_form: RawForm,
}

impl StreamOptions {
    /// Returns the mains frequency to remove, Hz; 0 leaves the choice to the device.
    pub(crate) fn mains_hz(&self) -> u8 {
        self.mains.unwrap_or(0)
    }

    /// Logs a warning about options that have no effect on the chosen streams.
    pub(crate) fn warn_about_unused(&self) {
        if self.packed_rate.is_some() && !self.streams.contains(&StreamKind::Packed) {
            tracing::warn!(
                "--packed-rate has no effect, because packed is not among the streams; add it with --streams packed"
            );
        }
    }

    /// Returns the streams to ask for, codes included unless packed blocks are.
    pub(crate) fn streams(&self) -> Streams {
        let asked = self.streams.iter();
        with_codes(asked.fold(Streams::empty(), |streams, kind| match kind {
            StreamKind::Raw => streams | self.raw_form.streams(),
            kind => streams | kind.bit(),
        }))
    }
}

fn mains(text: &str) -> Result<u8, String> {
    match text {
        "50" => Ok(50),
        "60" => Ok(60),
        _ => Err("the mains frequency is 50 or 60 Hz".to_owned()),
    }
}
