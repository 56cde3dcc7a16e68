//! Proptest strategies for random messages.

use link::{
    Ack, AckResult, Audit, BlockForm, ClockReading, Code, CodeValues, CompressedRaw,
    ElectrodeQuality, Event, EventKind, Exclusion, ExclusionPolicy, Features, Filtered, Flags,
    Hello, MAX_ELECTRODES, MAX_EXPONENT, MAX_NUMBERS, MAX_STAGES, ModelReceived, PackedCode,
    Quality, Raw, ResetCause, Stage, StageTiming, Stats, Streams, Substitutes, Timing, ToHost,
};
use proptest::prelude::*;

/// Random code values in a random format.
fn values() -> impl Strategy<Value = CodeValues<'static>> {
    let bytes = || {
        let bytes = prop::collection::vec(any::<u8>(), 1..=MAX_NUMBERS);
        bytes.prop_map(|bytes| &*bytes.leak())
    };
    let int8 = bytes().prop_map(CodeValues::int8);
    let exponent = (0..=MAX_EXPONENT, bytes())
        .prop_map(|(exponent, values)| CodeValues::int8_exponent(exponent, values));
    let int16 = prop::collection::vec(any::<[u8; 2]>(), 1..=MAX_NUMBERS)
        .prop_map(|values| CodeValues::int16(values.leak().as_flattened()));
    prop_oneof![int8, exponent, int16]
}

/// A random `Timing` with 0 to `MAX_STAGES` stages; a stage's number may be one that this version
/// does not name.
fn timing() -> impl Strategy<Value = ToHost<'static>> {
    let stage = (any::<u8>(), any::<[u32; 2]>(), any::<[u32; 9]>()).prop_map(
        |(stage, [deadline_ns, worst_ns], histogram)| StageTiming {
            stage: Stage::from(stage),
            deadline_ns,
            worst_ns,
            histogram,
        },
    );
    let stages = prop::collection::vec(stage, 0..=MAX_STAGES);
    (stages, any::<[u32; 2]>()).prop_map(|(stages, [stack_used, stack_size])| {
        ToHost::Timing(Timing {
            stages: stages.into_iter().collect(),
            stack_used,
            stack_size,
        })
    })
}

/// Random features of 1 to `MAX_FEATURES` levels.
fn features() -> impl Strategy<Value = ToHost<'static>> {
    let levels = prop::collection::vec(any::<u8>(), 1..=link::MAX_FEATURES);
    (any::<(u32, u32, u16, u64)>(), levels).prop_map(|((id, hop, flags, saturated), levels)| {
        ToHost::Features(Features {
            id,
            hop,
            flags: Flags::from_bits(flags),
            saturated,
            levels: levels.leak(),
        })
    })
}

/// Random messages that carry byte slices, random events, and random clock readings.
fn streamed() -> impl Strategy<Value = ToHost<'static>> {
    let bytes = || prop::collection::vec(any::<u8>(), 0..=1536).prop_map(|bytes| &*bytes.leak());
    let raw =
        (any::<(u64, u8, u16)>(), bytes()).prop_map(|((first_sample, channels, flags), counts)| {
            ToHost::Raw(Raw {
                first_sample,
                channels,
                flags: Flags::from_bits(flags),
                counts,
            })
        });
    let compressed = (any::<(u64, u8, u16, u8, u8)>(), bytes()).prop_map(
        |((first_sample, channels, flags, form, samples), bytes)| {
            ToHost::CompressedRaw(CompressedRaw {
                first_sample,
                channels,
                flags: Flags::from_bits(flags),
                form: BlockForm::from(form),
                samples,
                bytes,
            })
        },
    );
    let packed = (any::<(u32, u8, u16, u16, u64)>(), bytes()).prop_map(
        |((block, rate, flags, clipped, saturated), bytes)| {
            ToHost::PackedCode(PackedCode {
                block,
                rate,
                flags: Flags::from_bits(flags),
                clipped,
                saturated,
                bytes,
            })
        },
    );
    let filtered = (any::<(u64, u8, u8, u16)>(), bytes()).prop_map(
        |((first_step, electrodes, fraction_bits, flags), values)| {
            ToHost::Filtered(Filtered {
                first_step,
                electrodes,
                fraction_bits,
                flags: Flags::from_bits(flags),
                values,
            })
        },
    );
    let audit = (any::<([u8; 8], u32)>(), bytes(), values()).prop_map(
        |((model_id, window), planes, values)| {
            ToHost::Audit(Audit {
                model_id,
                window,
                planes,
                values,
            })
        },
    );
    let event = any::<(u8, u32, u64)>().prop_map(|(kind, number, sample)| {
        ToHost::Event(Event {
            kind: EventKind::from(kind),
            number,
            sample,
        })
    });
    let reading = any::<[u64; 2]>().prop_map(|[host_time_us, received_us]| {
        ToHost::ClockReading(ClockReading {
            host_time_us,
            received_us,
        })
    });
    let substitutes = any::<[u64; 2]>()
        .prop_map(|[interpolated, zero]| ToHost::Substitutes(Substitutes { interpolated, zero }));
    let exclusion =
        any::<([u64; 4], bool)>().prop_map(|([first_step, excluded, always, never], automatic)| {
            let policy = ExclusionPolicy {
                always,
                never,
                automatic,
            };
            ToHost::Exclusion(Exclusion {
                first_step,
                excluded,
                policy,
            })
        });
    let received = any::<[u32; 2]>()
        .prop_map(|[crc, bytes]| ToHost::ModelReceived(ModelReceived { crc, bytes }));
    prop_oneof![
        received,
        raw,
        compressed,
        packed,
        filtered,
        audit,
        event,
        reading,
        substitutes,
        exclusion,
        features()
    ]
}

pub(crate) fn message() -> impl Strategy<Value = ToHost<'static>> {
    let code = (
        any::<[u8; 8]>(),
        any::<u32>(),
        any::<u64>(),
        any::<(u16, u8)>(),
        any::<u16>(),
        any::<u64>(),
    );
    let code = (code, values()).prop_map(
        |(
            (model_id, window, first_sample, (clipped, clipped_values), flags, saturated),
            values,
        )| {
            let flags = Flags::from_bits(flags);
            ToHost::Code(Code {
                model_id,
                window,
                first_sample,
                flags,
                clipped,
                clipped_values,
                saturated,
                values,
            })
        },
    );
    let ack = (any::<u32>(), any::<u8>()).prop_map(|(of, result)| {
        ToHost::Ack(Ack {
            of,
            result: AckResult::from(result),
        })
    });
    let stats = (any::<u32>(), any::<u64>(), any::<u16>()).prop_map(|(count, samples, streams)| {
        let streams = Streams::from_bits(streams);
        ToHost::Stats(Stats {
            codes_made: count,
            samples,
            streams,
            ..Stats::default()
        })
    });
    let hello = (any::<[u8; 12]>(), any::<u32>(), any::<u8>()).prop_map(|(uid, session, cause)| {
        ToHost::Hello(Hello {
            firmware: "0.1.0 é",
            board: "board",
            chip_uid: uid,
            model_id: [0; 8],
            session_id: session,
            reset_cause: ResetCause::from(cause),
            fault: "",
        })
    });
    let electrode = (any::<[f32; 3]>(), any::<u16>(), any::<bool>()).prop_map(
        |([rms_uv, mains_uv, mains_residual_uv], samples_at_rail, flat)| ElectrodeQuality {
            rms_uv,
            mains_uv,
            mains_residual_uv,
            samples_at_rail,
            flat,
        },
    );
    let quality = (
        any::<u64>(),
        any::<bool>(),
        prop::collection::vec(electrode, 0..=MAX_ELECTRODES),
    )
        .prop_map(|(first_sample, settling, electrodes)| {
            ToHost::Quality(Quality {
                first_sample,
                settling,
                electrodes: electrodes.into_iter().collect(),
            })
        });
    prop_oneof![4 => code, 1 => ack, 1 => stats, 1 => hello, 1 => quality, 1 => timing(), 2 => streamed()]
}
