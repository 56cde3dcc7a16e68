//! Indices of a stream that ran already when its recording began, counted from the recording's
//! beginning.

use link::{
    Capabilities, Code, CompressedRaw, Event, Features, Filtered, PackedCode, Quality, Raw, Stats,
    ToHost,
};

/// Hops that are left out at the beginning, so that every stream begins with the same one: the
/// message of a code arrives one hop after the samples of its first step.
const LEFT_OUT: u32 = 2;

/// Length of a hop, in steps and in ADC samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Hop {
    steps: u64,
    samples: u64,
}

impl Hop {
    /// Returns the length of the device's hops; `None` if it is no whole number of samples.
    pub(crate) fn of(capabilities: &Capabilities) -> Option<Hop> {
        let steps = u64::from(capabilities.hop_steps);
        let samples = steps * u64::from(capabilities.adc_rate_hz);
        let rate = u64::from(capabilities.step_rate_hz);
        let is_whole = steps > 0 && samples > 0 && rate > 0 && samples.is_multiple_of(rate);
        is_whole.then(|| Hop {
            steps,
            samples: samples / rate,
        })
    }
}

/// Subtracts from all indices that count from the device's `Start` the hops before the recording.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Renumbering {
    /// The recording has the stream's `Start`.
    #[default]
    Off,
    /// The first message with an index decides.
    Joined(Hop),
    By(Hop, u32),
}

impl Renumbering {
    /// Returns the renumbering after the record `joined` of a device with such hops.
    pub(crate) fn joined(hop: Option<Hop>) -> Renumbering {
        hop.map_or(Renumbering::Off, Renumbering::Joined)
    }

    /// Returns a message with its indices counted from the recording's beginning; `None` for one
    /// from before it.
    pub(crate) fn apply<'m>(&mut self, message: &ToHost<'m>) -> Option<ToHost<'m>> {
        if let Renumbering::Joined(hop) = *self
            && let Some(present) = hop_of(message, hop)
        {
            *self = Renumbering::By(hop, present.wrapping_add(LEFT_OUT));
        }
        match *self {
            // After `joined`, nothing that has an index has come yet.
            Renumbering::Off | Renumbering::Joined(_) => Some(message.clone()),
            Renumbering::By(hop, hops) => renumber(message, hop, hops),
        }
    }
}

/// Returns the number of the hop in which a message was made, as far as its indices tell.
fn hop_of(message: &ToHost<'_>, hop: Hop) -> Option<u32> {
    let of_samples = |sample: u64| u32::try_from(sample / hop.samples).ok();
    match message {
        ToHost::Code(code) => Some(code.window),
        ToHost::PackedCode(code) => Some(code.block),
        ToHost::Features(features) => Some(features.hop),
        ToHost::Raw(raw) => of_samples(raw.first_sample),
        ToHost::CompressedRaw(raw) => of_samples(raw.first_sample),
        ToHost::Filtered(filtered) => u32::try_from(filtered.first_step / hop.steps).ok(),
        _ => None,
    }
}

fn renumber<'m>(message: &ToHost<'m>, hop: Hop, hops: u32) -> Option<ToHost<'m>> {
    // Indices of hops wrap, and a lower one than the first is from before the recording.
    let hop_index = |index: u32| {
        let since = index.wrapping_sub(hops);
        (since < 1 << 31).then_some(since)
    };
    let samples = u64::from(hops) * hop.samples;
    let steps = u64::from(hops) * hop.steps;
    Some(match message {
        ToHost::Code(code) => ToHost::Code(Code {
            window: hop_index(code.window)?,
            first_sample: code.first_sample.saturating_sub(samples),
            ..*code
        }),
        ToHost::PackedCode(code) => ToHost::PackedCode(PackedCode {
            block: hop_index(code.block)?,
            ..*code
        }),
        ToHost::Features(features) => ToHost::Features(Features {
            hop: hop_index(features.hop)?,
            ..*features
        }),
        ToHost::Raw(raw) => ToHost::Raw(Raw {
            first_sample: raw.first_sample.checked_sub(samples)?,
            ..*raw
        }),
        ToHost::CompressedRaw(raw) => ToHost::CompressedRaw(CompressedRaw {
            first_sample: raw.first_sample.checked_sub(samples)?,
            ..*raw
        }),
        ToHost::Filtered(filtered) => ToHost::Filtered(Filtered {
            first_step: filtered.first_step.checked_sub(steps)?,
            ..*filtered
        }),
        ToHost::Event(event) => ToHost::Event(Event {
            sample: event.sample.checked_sub(samples)?,
            ..*event
        }),
        ToHost::Quality(quality) => ToHost::Quality(Quality {
            first_sample: quality.first_sample.saturating_sub(samples),
            ..quality.clone()
        }),
        ToHost::Stats(stats) => ToHost::Stats(Stats {
            next_window: hop_index(stats.next_window).unwrap_or(0),
            ..*stats
        }),
        other => other.clone(),
    })
}
