//! User settings of the core.

use link::Streams;

/// Values of a setting, with their names and descriptions for a command line.
pub trait Choice: Copy + Send + Sync + 'static {
    /// Name, description and value of each choice. The description is a sentence or more.
    const CHOICES: &'static [(&'static str, &'static str, Self)];
}

/// Defines an enum that is a [`Choice`]: each value has its name, and its doc comment is the
/// description. The first value is the default.
macro_rules! choice {
    ($(#[$doc:meta])* $enum:ident { $first:ident = $first_name:literal: $first_text:literal,
        $($value:ident = $name:literal: $text:literal,)* }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        pub enum $enum {
            #[doc = $first_text]
            #[default]
            $first,
            $(#[doc = $text] $value,)*
        }

        impl Choice for $enum {
            const CHOICES: &'static [(&'static str, &'static str, Self)] = &[
                ($first_name, $first_text, $enum::$first),
                $(($name, $text, $enum::$value),)*
            ];
        }
    };
}

/// User settings for streams and frames; constant while the bridge runs. By default the device
/// sends codes alone, and chooses mains frequency and rate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Settings {
    /// Point of a frame that its stamp refers to: first sample, last sample or arrival.
    pub stamp: StampPoint,
    /// Mains frequency that the device's notch filter removes, Hz; 0 leaves the choice to the
    /// device.
    pub mains_hz: u8,
    /// Replacement that is published for a lost code, packed block, sample or step.
    pub filler: FillerPolicy,
    /// Whether each window's newest steps are reconstructed from that window alone, without waiting
    /// one hop for the next window, which also contains them.
    pub low_latency: bool,
    /// Stream that `/acquisition/get_info` describes.
    pub announced: AnnouncedStream,
    /// Streams that the device is asked for. The bridge adds the stream of codes if neither codes
    /// nor packed blocks are among them. With both `RAW` and `COMPRESSED_RAW`, samples are wanted
    /// in either form: the device is asked for plain ones first, and for compressed ones if it
    /// refuses those because its port is too slow.
    pub streams: Streams,
    /// Rate of the packed code that the device is asked for, 0 to 15; `None` leaves the choice to
    /// the device.
    pub packed_rate: Option<u8>,
    /// Time that the stamps of events refer to.
    pub event_stamps: EventStamps,
}

choice! {
    /// Time that the stamp of an event on `/events/bus` refers to.
    EventStamps {
        Recorder = "recorder":
            "The place of the event in a recording of the announced stream by \
             `rosneuro_recorder`.",
        Scalp = "scalp": "The event itself, on the time scale of the frames' stamps.",
    }
}

choice! {
    /// Stream that is announced to ROS-Neuro's recorder and filters, which handle exactly one
    /// stream.
    AnnouncedStream {
        Encoded = "encoded": "`/encoded`: the numbers of each code.",
        Reconstructed = "reconstructed": "`/neurodata_reconstructed`: electrodes in microvolts.",
        Raw = "raw": "`/neurodata`: every ADC sample in microvolts.",
        Filtered = "filtered":
            "`/neurodata_corticode`: the encoder's input in microvolts, before quantisation.",
    }
}

impl AnnouncedStream {
    /// All streams that can be announced, with their topics.
    pub const TOPICS: [(&'static str, AnnouncedStream); 4] = [
        ("/encoded", AnnouncedStream::Encoded),
        ("/neurodata_reconstructed", AnnouncedStream::Reconstructed),
        ("/neurodata", AnnouncedStream::Raw),
        ("/neurodata_corticode", AnnouncedStream::Filtered),
    ];

    /// Returns whether this stream can be published from `streams`.
    pub fn is_in(self, streams: Streams) -> bool {
        match self {
            AnnouncedStream::Encoded => streams.contains(Streams::CODES),
            AnnouncedStream::Reconstructed => {
                streams.contains(Streams::CODES) || streams.contains(Streams::PACKED)
            }
            AnnouncedStream::Raw => RawForm::any_in(streams),
            AnnouncedStream::Filtered => streams.contains(Streams::FILTERED),
        }
    }
}

choice! {
    /// A stream of the device, as named in `--streams`.
    StreamKind {
        Codes = "codes":
            "`/encoded`, and without packed `/neurodata_reconstructed`; on unless packed is \
             named.",
        Packed = "packed":
            "`/neurodata_reconstructed` from packed blocks: 0.8 kB/s at rate 4, where codes take \
             2.7. Reports take another 1 kB/s with either.",
        Raw = "raw": "`/neurodata`: every ADC sample, 101 kB/s, or 47 kB/s compressed.",
        Filtered = "filtered":
            "`/neurodata_corticode`: every filtered step that the encoder reads, 33 kB/s.",
        Audit = "audit":
            "A window every 10 s, with its code; the bridge computes the code again, compares \
             packed blocks with the window, and reports the differences on /diagnostics.",
        Events = "events": "`/events/bus`: edges of the trigger input.",
    }
}

impl StreamKind {
    /// Returns the stream's bit in `Start` and `Stats`.
    pub fn bit(self) -> Streams {
        match self {
            StreamKind::Codes => Streams::CODES,
            StreamKind::Packed => Streams::PACKED,
            StreamKind::Raw => Streams::RAW,
            StreamKind::Filtered => Streams::FILTERED,
            StreamKind::Audit => Streams::AUDIT,
            StreamKind::Events => Streams::EVENTS,
        }
    }

    /// Returns the names of all streams in `streams`, separated by spaces. Compressed samples alone
    /// are `compressed-raw`.
    pub fn names(streams: Streams) -> String {
        let named = StreamKind::CHOICES.iter().filter_map(|(name, _, kind)| {
            let (name, is_named) = match kind {
                StreamKind::Raw if !streams.contains(Streams::RAW) => {
                    ("compressed-raw", RawForm::any_in(streams))
                }
                kind => (*name, streams.contains(kind.bit())),
            };
            is_named.then_some(name)
        });
        let named: Vec<&str> = named.collect();
        named.join(" ")
    }
}

choice! {
    /// Form in which the device sends ADC samples. Both yield the same frames.
    RawForm {
        Any = "any":
            "Not compressed; compressed without loss if the device refuses that, because its port \
             is too slow. A lost frame costs 8 samples, of compressed ones up to 0.25 s.",
        Compressed = "compressed": "Compressed without loss only.",
        Plain = "plain": "Not compressed only: 101 kB/s, which a UART cannot carry.",
    }
}

impl RawForm {
    /// Returns the streams of the device that have this form.
    pub fn streams(self) -> Streams {
        match self {
            RawForm::Any => Streams::RAW | Streams::COMPRESSED_RAW,
            RawForm::Compressed => Streams::COMPRESSED_RAW,
            RawForm::Plain => Streams::RAW,
        }
    }

    /// Returns whether `streams` has samples in any form.
    pub fn any_in(streams: Streams) -> bool {
        streams.bits() & RawForm::Any.streams().bits() != 0
    }
}

/// Returns `streams` with the stream of codes added, unless packed blocks are among them.
pub fn with_codes(streams: Streams) -> Streams {
    if streams.contains(Streams::PACKED) {
        streams
    } else {
        streams | Streams::CODES
    }
}

choice! {
    /// Point of a frame that its stamp refers to.
    StampPoint {
        First = "first":
            "Time at which the frame's first sample was at the electrodes (filter delay removed).",
        Last = "last":
            "Time at which the frame's last sample was at the electrodes (filter delay removed).",
        Arrival = "arrival": "Time at which the host read the frame, by the wall clock alone.",
    }
}

choice! {
    /// Replacement for lost codes, packed blocks, samples and steps.
    FillerPolicy {
        Last = "last":
            "The last code, sample or step that was received; for a packed block, what the model \
             predicts.",
        Zeros = "zeros": "A code, sample or step of zeros.",
        Off = "off":
            "Nothing. In a recording, the gap shifts later samples relative to events. A frame \
             that would contain a filler is not published.",
    }
}
