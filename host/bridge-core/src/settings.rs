//! User settings of the bridge's core.

use link::Streams;

/// A setting with several values, each of which has a name and a description for the command line.
pub trait Choice: Copy + Send + Sync + 'static {
    /// Name, description and value of each choice. A description is at least one sentence.
    const CHOICES: &'static [(&'static str, &'static str, Self)];
}

/// Defines an enum that is a [`Choice`]. Each value has a name and a description, which is also its
/// doc comment. The first value is the default.
#[macro_export]
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

        impl $crate::Choice for $enum {
            const CHOICES: &'static [(&'static str, &'static str, Self)] = &[
                ($first_name, $first_text, $enum::$first),
                $(($name, $text, $enum::$value),)*
            ];
        }
    };
}

/// User settings for streams and frames; constant while the bridge runs. By default the device
/// sends only codes, and itself chooses the mains frequency and the packed code's rate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Settings {
    /// What the stamp of a frame refers to: its first sample, its last sample or its arrival.
    pub stamp: StampPoint,
    /// Mains frequency that the device's notch filter removes, Hz; 0 leaves the choice to the
    /// device.
    pub mains_hz: u8,
    /// What is published in place of a lost code, packed block, sample or step.
    pub filler: FillerPolicy,
    /// Whether the newest steps of a window are decoded from that window alone, instead of waiting
    /// one hop for the next window, which also contains them.
    pub low_latency: bool,
    /// Stream that `/acquisition/get_info` describes, and so the stream that a recorder records.
    pub announced: AnnouncedStream,
    /// Streams that the bridge asks the device for. The bridge adds codes unless packed blocks or
    /// features are among them. With both `RAW` and `COMPRESSED_RAW`, it asks for plain samples
    /// first, and for compressed ones if the device refuses plain ones because its port is too
    /// slow.
    pub streams: Streams,
    /// Rate of the packed code, 0 (finest) to 15 (coarsest); `None` leaves the choice to the
    /// device.
    pub packed_rate: Option<u8>,
    /// Whether the stamp of an event refers to the event itself or to its place in a recording.
    pub event_stamps: EventStamps,
}

choice! {
    /// Moment that the stamp of an event on `/events/bus` refers to.
    EventStamps {
        Recorder = "recorder":
            "For a node that has called `get_info`, such as `rosneuro_recorder`: the place of the \
             event in a recording that it starts then. For others: the event, plus the delay of \
             the announced stream.",
        Scalp = "scalp": "The event itself, on the time scale of the frames' stamps.",
    }
}

choice! {
    /// Stream announced to ROS-Neuro's recorder and filters, which handle exactly one.
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

    /// Returns whether this stream can be published if the device sends `streams`.
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
    /// A stream that the device can send, by its name in the option `--streams`.
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
        Features = "features":
            "Band powers for `--classifier`, which asks for them by itself: 0.5 kB/s. Named \
             without codes, they stream alone.",
    }
}

impl StreamKind {
    /// Returns the bit that stands for this stream in the messages `Start` and `Stats`.
    pub fn bit(self) -> Streams {
        match self {
            StreamKind::Codes => Streams::CODES,
            StreamKind::Packed => Streams::PACKED,
            StreamKind::Raw => Streams::RAW,
            StreamKind::Filtered => Streams::FILTERED,
            StreamKind::Audit => Streams::AUDIT,
            StreamKind::Events => Streams::EVENTS,
            StreamKind::Features => Streams::FEATURES,
        }
    }

    /// Returns the names of all streams in `streams`, separated by spaces. Samples are named
    /// `compressed-raw` if they are asked for in compressed form only.
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
    /// Form in which the device sends ADC samples. All forms yield the same frames.
    RawForm {
        Any = "any":
            "Not compressed; compressed without loss if the device refuses that, because its port \
             is too slow. A lost frame costs 8 samples, of compressed ones up to 0.25 s.",
        Compressed = "compressed": "Compressed without loss only.",
        Plain = "plain": "Not compressed only: 101 kB/s, which a UART cannot carry.",
    }
}

impl RawForm {
    /// Returns the streams to ask the device for, to receive samples in this form.
    pub fn streams(self) -> Streams {
        match self {
            RawForm::Any => Streams::RAW | Streams::COMPRESSED_RAW,
            RawForm::Compressed => Streams::COMPRESSED_RAW,
            RawForm::Plain => Streams::RAW,
        }
    }

    /// Returns whether `streams` contains ADC samples, plain or compressed.
    pub fn any_in(streams: Streams) -> bool {
        streams.bits() & RawForm::Any.streams().bits() != 0
    }
}

/// Returns `streams` with the stream of codes added, unless packed blocks or features are among
/// them.
pub fn with_codes(streams: Streams) -> Streams {
    if streams.contains(Streams::PACKED) || streams.contains(Streams::FEATURES) {
        streams
    } else {
        streams | Streams::CODES
    }
}

choice! {
    /// Point in time to which a frame's stamp refers.
    StampPoint {
        First = "first":
            "Time at which the frame's first sample was at the electrodes (filter delay removed).",
        Last = "last":
            "Time at which the frame's last sample was at the electrodes (filter delay removed).",
        Arrival = "arrival": "Time at which the host read the frame, by the wall clock alone.",
    }
}

choice! {
    /// What is published in place of lost codes, packed blocks, samples and steps.
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
