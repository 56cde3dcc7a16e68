//! Renumbers a stream that was already running when its recording began, so that its indices count
//! from the beginning of the recording.

use link::{
    Audit, Capabilities, Code, CompressedRaw, Event, Exclusion, Features, Filtered, PackedCode,
    Quality, Raw, Stats, ToHost,
};

/// Number of hops to leave out at the beginning. Without these hops, every stream begins with the
/// same hop, although the message of a code arrives one hop after the samples of its first step.
const LEFT_OUT: u32 = 2;

/// Length of a hop, in steps and in ADC samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Hop {
    steps: u64,
    samples: u64,
}

impl Hop {
    /// Returns the length of the device's hops; `None` if a hop is not a whole number of samples.
    pub(crate) fn of(capabilities: &Capabilities) -> Option<Hop> {
        let steps = u64::from(capabilities.hop_steps);
        let samples = steps * u64::from(capabilities.adc_rate_hz);
        let rate = u64::from(capabilities.step_rate_hz);
        let is_whole = steps > 0 && samples > 0 && rate > 0 && samples.is_multiple_of(rate);
        is_whole.then(|| Hop { steps, samples: samples / rate })
    }
}

/// Subtracts the hops before the recording from all indices that count from the device's `Start`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Renumbering {
    /// The recording has the stream's `Start`.
    #[default]
    Off,
    /// The first message with an index will determine the number of hops to subtract.
    Joined(Hop),
    By(Hop, u32),
}

impl Renumbering {
    /// Returns the state after the record `joined`. If `hop` is `None`, nothing is renumbered.
    pub(crate) fn joined(hop: Option<Hop>) -> Renumbering {
        hop.map_or(Renumbering::Off, Renumbering::Joined)
    }

    /// Returns a message with its indices counted from the recording's beginning; `None` for a
    /// message from before the recording.
    pub(crate) fn apply<'m>(&mut self, message: &ToHost<'m>) -> Option<ToHost<'m>> {
        if let Renumbering::Joined(hop) = *self
            && let Some(present) = hop_of(message, hop)
        {
            *self = Renumbering::By(hop, present.wrapping_add(LEFT_OUT));
        }
        match *self {
            // `Joined`: no message with an index has come yet.
            Renumbering::Off | Renumbering::Joined(_) => Some(message.clone()),
            Renumbering::By(hop, hops) => renumber(message, hop, hops),
        }
    }
}

/// Returns the index of the hop in which a message was made; `None` if the message does not contain
/// it.
fn hop_of(message: &ToHost<'_>, hop: Hop) -> Option<u32> {
    let of_samples = |sample: u64| u32::try_from(sample / hop.samples).ok();
    match message {
        ToHost::Code(code) => Some(code.window),
        ToHost::PackedCode(code) => Some(code.block),
        ToHost::Features(features) => Some(features.hop),
        ToHost::Audit(audit) => Some(audit.window),
        ToHost::Raw(raw) => of_samples(raw.first_sample),
        ToHost::CompressedRaw(raw) => of_samples(raw.first_sample),
        ToHost::Filtered(filtered) => u32::try_from(filtered.first_step / hop.steps).ok(),
        _ => None,
    }
}

fn renumber<'m>(message: &ToHost<'m>, hop: Hop, hops: u32) -> Option<ToHost<'m>> {
    // An index of a hop wraps at 2^32. A lower index than the first is from before the recording.
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
        ToHost::PackedCode(code) => {
            ToHost::PackedCode(PackedCode { block: hop_index(code.block)?, ..*code })
        }
        ToHost::Features(features) => {
            ToHost::Features(Features { hop: hop_index(features.hop)?, ..*features })
        }
        ToHost::Audit(audit) => ToHost::Audit(Audit { window: hop_index(audit.window)?, ..*audit }),
        ToHost::Raw(raw) => {
            ToHost::Raw(Raw { first_sample: raw.first_sample.checked_sub(samples)?, ..*raw })
        }
        ToHost::CompressedRaw(raw) => ToHost::CompressedRaw(CompressedRaw {
            first_sample: raw.first_sample.checked_sub(samples)?,
            ..*raw
        }),
        ToHost::Filtered(filtered) => ToHost::Filtered(Filtered {
            first_step: filtered.first_step.checked_sub(steps)?,
            ..*filtered
        }),
        ToHost::Event(event) => {
            ToHost::Event(Event { sample: event.sample.checked_sub(samples)?, ..*event })
        }
        ToHost::Quality(quality) => ToHost::Quality(Quality {
            first_sample: quality.first_sample.saturating_sub(samples),
            ..quality.clone()
        }),
        ToHost::Exclusion(exclusion) => ToHost::Exclusion(Exclusion {
            first_step: exclusion.first_step.saturating_sub(steps),
            ..*exclusion
        }),
        ToHost::Stats(stats) => ToHost::Stats(Stats {
            next_window: hop_index(stats.next_window).unwrap_or(0),
            ..*stats
        }),
        other => other.clone(),
    })
}

#[cfg(test)]
mod tests {
    use link::{
        Audit, BlockForm, Code, CodeValues, CompressedRaw, Exclusion, ExclusionPolicy, Features,
        Filtered, Flags, PackedCode, Raw, ToHost,
    };

    use super::{Hop, Renumbering, hop_of};

    const HOP: Hop = Hop { steps: 8, samples: 32 };

    /// Returns, for the hop `hop`, one message of each kind that contains the index of a hop.
    fn numbered(hop: u32) -> [ToHost<'static>; 4] {
        let flags = Flags::empty();
        [
            ToHost::Code(Code {
                model_id: [1; 8],
                window: hop,
                first_sample: u64::from(hop) * HOP.samples,
                flags,
                clipped: 0,
                clipped_values: 0,
                saturated: 0,
                values: CodeValues::int8(&[0]),
            }),
            ToHost::PackedCode(PackedCode {
                block: hop,
                rate: 4,
                flags,
                clipped: 0,
                saturated: 0,
                bytes: &[],
            }),
            ToHost::Features(Features { id: 1, hop, flags, saturated: 0, levels: &[0] }),
            ToHost::Audit(Audit {
                model_id: [1; 8],
                window: hop,
                planes: &[0],
                values: CodeValues::int8(&[0]),
            }),
        ]
    }

    /// Returns, for the hop `hop`, one message of each kind that contains the index of a sample or
    /// step.
    fn indexed(hop: u32) -> [ToHost<'static>; 3] {
        let flags = Flags::empty();
        [
            ToHost::Raw(Raw {
                first_sample: u64::from(hop) * HOP.samples,
                channels: 1,
                flags,
                counts: &[0; 3],
            }),
            ToHost::CompressedRaw(CompressedRaw {
                first_sample: u64::from(hop) * HOP.samples,
                channels: 1,
                flags,
                form: BlockForm::Key,
                samples: 1,
                bytes: &[0],
            }),
            ToHost::Filtered(Filtered {
                first_step: u64::from(hop) * HOP.steps,
                electrodes: 1,
                fraction_bits: 5,
                flags,
                values: &[0; 4],
            }),
        ]
    }

    fn messages(hop: u32) -> Vec<ToHost<'static>> {
        numbered(hop).into_iter().chain(indexed(hop)).collect()
    }

    fn exclusion(first_step: u64) -> ToHost<'static> {
        ToHost::Exclusion(Exclusion { first_step, excluded: 1, policy: ExclusionPolicy::AUTOMATIC })
    }

    #[test]
    fn the_first_message_of_any_kind_decides_for_all() {
        for first in messages(1000) {
            let mut renumbering = Renumbering::joined(Some(HOP));
            assert_eq!(renumbering.apply(&first), None, "{first:?}");
            for early in messages(1001) {
                assert_eq!(renumbering.apply(&early), None, "{first:?} {early:?}");
            }
            for (message, expected) in messages(1009).iter().zip(messages(7)) {
                assert_eq!(renumbering.apply(message), Some(expected), "{first:?}");
            }
            for (step, expected) in [(1003 * HOP.steps, HOP.steps), (3, 0)] {
                let renumbered = renumbering.apply(&exclusion(step));
                assert_eq!(renumbered, Some(exclusion(expected)), "{first:?}");
            }
        }
    }

    #[test]
    fn the_number_of_a_hop_can_wrap() {
        for first in numbered(u32::MAX) {
            let mut renumbering = Renumbering::joined(Some(HOP));
            assert_eq!(renumbering.apply(&first), None, "{first:?}");
            let mut hops_of = |hop| {
                numbered(hop).map(|message| {
                    let renumbered = renumbering.apply(&message);
                    renumbered.and_then(|message| hop_of(&message, HOP))
                })
            };
            assert_eq!(hops_of(u32::MAX), [None; 4], "{first:?}");
            assert_eq!(hops_of(0), [None; 4], "{first:?}");
            assert_eq!(hops_of(1), [Some(0); 4], "{first:?}");
            assert_eq!(hops_of(3), [Some(2); 4], "{first:?}");
        }
    }
}
