//! Whatever happens to the bytes: no false frame, no panic, in step again by the next zero.
#![allow(missing_docs, clippy::unwrap_used, reason = "tests")]

use link::{
    Ack, AckResult, Audit, CODE_LEN, ClockReading, Code, CodeValues, Decoder, ElectrodeQuality,
    Encoder, Event, EventKind, Filtered, Flags, Hello, MAX_ELECTRODES, MAX_EXPONENT, MAX_FRAME,
    MAX_STAGES, Quality, Raw, ResetCause, Stage, StageTiming, Stats, Streams, Timing, ToDevice,
    ToHost,
};
use proptest::prelude::*;

/// A code in any format.
fn values() -> impl Strategy<Value = CodeValues> {
    let bytes = || prop::collection::vec(any::<i8>(), CODE_LEN);
    let int8 = bytes().prop_map(|values| CodeValues::Int8(values.try_into().unwrap()));
    let exponent = (0..=MAX_EXPONENT, bytes()).prop_map(|(exponent, values)| {
        let values = values.try_into().unwrap();
        CodeValues::Int8Exponent { exponent, values }
    });
    let int16 = prop::collection::vec(any::<i16>(), CODE_LEN)
        .prop_map(|values| CodeValues::Int16(values.try_into().unwrap()));
    prop_oneof![int8, exponent, int16]
}

/// Any number of stages, unknown ones too.
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

/// What carries bytes of any content, and what has numbers only.
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
    prop_oneof![raw, filtered, audit, event, reading]
}

fn message() -> impl Strategy<Value = ToHost<'static>> {
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

/// The frames of `messages` back to back, and where each begins.
fn stream(messages: &[ToHost<'static>], first_seq: u32) -> (Vec<u8>, Vec<usize>) {
    let mut encoder = Encoder::starting_at(first_seq);
    let mut bytes = Vec::new();
    let mut starts = Vec::new();
    for message in messages {
        starts.push(bytes.len());
        let mut buffer = [0; MAX_FRAME];
        bytes.extend_from_slice(
            encoder
                .encode(u64::from(first_seq), message, &mut buffer)
                .unwrap(),
        );
    }
    (bytes, starts)
}

/// Messages that come out, with their place in the stream, and the number of bad frames.
fn decode(bytes: &[u8], chunk: usize, first_seq: u32) -> (Vec<(u32, ToHost<'static>)>, usize) {
    let mut decoder = Decoder::<MAX_FRAME>::new();
    let (mut good, mut bad) = (Vec::new(), 0);
    for mut input in bytes.chunks(chunk.max(1)) {
        while let Some(outcome) = decoder.next::<ToHost>(&mut input) {
            match outcome {
                Ok(frame) => {
                    good.push((
                        frame.header.seq.wrapping_sub(first_seq),
                        owned(&frame.message),
                    ));
                }
                Err(_) => bad += 1,
            }
        }
    }
    let counters = decoder.counters();
    assert_eq!(counters.frames as usize, good.len());
    assert_eq!(counters.bytes, bytes.len() as u64);
    let counted = counters.crc
        + counters.cobs
        + counters.oversize
        + counters.version
        + counters.unknown
        + counters.malformed;
    assert_eq!(counted as usize, bad);
    assert!(counters.resyncs as usize <= bad);
    (good, bad)
}

/// The same message with texts that live for ever (there are only two).
fn owned(message: &ToHost<'_>) -> ToHost<'static> {
    match message {
        ToHost::Hello(hello) => {
            assert_eq!(
                (hello.firmware, hello.board, hello.fault),
                ("0.1.0 é", "board", "")
            );
            ToHost::Hello(Hello {
                firmware: "0.1.0 é",
                board: "board",
                fault: "",
                ..*hello
            })
        }
        ToHost::Code(code) => ToHost::Code(*code),
        ToHost::Stats(stats) => ToHost::Stats(*stats),
        ToHost::Ack(ack) => ToHost::Ack(*ack),
        ToHost::Quality(quality) => ToHost::Quality(quality.clone()),
        ToHost::Timing(timing) => ToHost::Timing(timing.clone()),
        ToHost::Raw(raw) => ToHost::Raw(Raw {
            counts: raw.counts.to_vec().leak(),
            ..*raw
        }),
        ToHost::Filtered(filtered) => ToHost::Filtered(Filtered {
            values: filtered.values.to_vec().leak(),
            ..*filtered
        }),
        ToHost::Audit(audit) => ToHost::Audit(Audit {
            planes: audit.planes.to_vec().leak(),
            ..*audit
        }),
        ToHost::Event(event) => ToHost::Event(*event),
        ToHost::ClockReading(reading) => ToHost::ClockReading(*reading),
        ToHost::Capabilities(_) | ToHost::Converters(_) | ToHost::SelfTest(_) => {
            panic!("none was sent")
        }
    }
}

/// One thing that happens to bytes on a line.
#[derive(Clone, Debug)]
enum Damage {
    Flip { bits: Vec<usize> },
    Drop { count: usize },
    Insert { bytes: Vec<u8> },
    Duplicate { count: usize },
    Swap { distance: usize },
    Overwrite { bytes: Vec<u8> },
}

fn damage() -> impl Strategy<Value = Damage> {
    prop_oneof![
        prop::collection::vec(0usize..512, 1..9).prop_map(|bits| Damage::Flip { bits }),
        (1usize..40).prop_map(|count| Damage::Drop { count }),
        prop::collection::vec(any::<u8>(), 1..40).prop_map(|bytes| Damage::Insert { bytes }),
        (1usize..40).prop_map(|count| Damage::Duplicate { count }),
        (1usize..20).prop_map(|distance| Damage::Swap { distance }),
        prop::collection::vec(any::<u8>(), 1..40).prop_map(|bytes| Damage::Overwrite { bytes }),
    ]
}

/// Damage `bytes` at `at`; returns where the damage ends in the original.
fn apply(damage: &Damage, bytes: &mut Vec<u8>, at: usize) -> usize {
    match damage {
        Damage::Flip { bits } => {
            let mut end = at;
            for bit in bits {
                let place = (at + bit / 8).min(bytes.len() - 1);
                bytes[place] ^= 1 << (bit % 8);
                end = end.max(place);
            }
            end
        }
        Damage::Drop { count } => {
            let end = (at + count).min(bytes.len());
            bytes.drain(at..end);
            end
        }
        Damage::Insert { bytes: inserted } => {
            bytes.splice(at..at, inserted.iter().copied());
            at
        }
        Damage::Duplicate { count } => {
            let end = (at + count).min(bytes.len());
            let copy = bytes[at..end].to_vec();
            bytes.splice(at..at, copy);
            end
        }
        Damage::Swap { distance } => {
            let other = (at + distance).min(bytes.len() - 1);
            bytes.swap(at, other);
            other
        }
        Damage::Overwrite { bytes: new } => {
            let end = (at + new.len()).min(bytes.len());
            bytes[at..end].copy_from_slice(&new[..end - at]);
            end
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, ..ProptestConfig::default() })]

    #[test]
    fn what_went_in_comes_out(
        messages in prop::collection::vec(message(), 1..6),
        first_seq in any::<u32>(),
        chunk in 1usize..300,
    ) {
        let (bytes, _) = stream(&messages, first_seq);
        let (good, bad) = decode(&bytes, chunk, first_seq);
        prop_assert_eq!(bad, 0);
        let good: Vec<_> = good.into_iter().map(|(_, message)| message).collect();
        prop_assert_eq!(good, messages);
    }

    #[test]
    fn damage_yields_no_false_frame_and_spares_the_frames_it_does_not_touch(
        messages in prop::collection::vec(message(), 1..6),
        first_seq in any::<u32>(),
        damage in damage(),
        at in any::<prop::sample::Index>(),
        chunk in 1usize..300,
    ) {
        let (mut bytes, starts) = stream(&messages, first_seq);
        let length = bytes.len();
        let at = at.index(length);
        let end = apply(&damage, &mut bytes, at);
        let (good, _) = decode(&bytes, chunk, first_seq);
        for (place, message) in &good {
            // A frame that came out is one that was sent, whole (a duplicate of it is another).
            prop_assert_eq!(Some(message), messages.get(*place as usize), "false frame");
        }
        for (place, start) in starts.iter().enumerate() {
            let next = starts.get(place + 1).copied().unwrap_or(length);
            // Whole bytes of this frame before the damage, or after it with its leading zero.
            if next <= at || *start > end {
                let arrived = good.iter().any(|(seen, _)| *seen as usize == place);
                prop_assert!(arrived, "frame {} at {}..{} lost, damage {}..{}", place, start, next, at, end);
            }
        }
    }

    #[test]
    fn any_byte_soup_is_survived_and_the_next_frame_comes_out(
        soup in prop::collection::vec(prop_oneof![1 => Just(0u8), 3 => any::<u8>()], 0..6000),
        chunk in 1usize..300,
        message in message(),
    ) {
        let mut decoder = Decoder::<MAX_FRAME>::new();
        for mut input in soup.chunks(chunk) {
            while let Some(outcome) = decoder.next::<ToHost>(&mut input) {
                prop_assert!(outcome.is_err());
            }
        }
        let (bytes, _) = stream(&[message], 0);
        let mut input = bytes.as_slice();
        let mut frames = 0;
        while let Some(outcome) = decoder.next::<ToHost>(&mut input) {
            frames += usize::from(outcome.is_ok());
        }
        prop_assert_eq!(frames, 1);
        let mut commands = Decoder::<64>::new();
        let mut input = soup.as_slice();
        while let Some(outcome) = commands.next::<ToDevice>(&mut input) {
            prop_assert!(outcome.is_err());
        }
    }
}

#[test]
fn every_single_bit_and_byte_of_a_code_is_guarded() {
    let values = core::array::from_fn(|index| i8::try_from(index).unwrap());
    let exponent = 3;
    assert_guarded(&CodeValues::Int8(values));
    assert_guarded(&CodeValues::Int8Exponent { exponent, values });
    assert_guarded(&CodeValues::Int16(
        values.map(|value| 257 * i16::from(value)),
    ));
}

fn assert_guarded(values: &CodeValues) {
    let code = ToHost::Code(Code {
        model_id: *b"\x01\x02\x03\x04\x05\x06\x07\x08",
        window: 70_000,
        first_sample: 2_240_000,
        flags: Flags::empty(),
        clipped: 0,
        clipped_values: 0,
        saturated: 0,
        values: *values,
    });
    let (bytes, starts) = stream(&[code.clone(), code.clone(), code.clone()], 0);
    for at in starts[1]..starts[2] {
        let mut variants = Vec::new();
        for bit in 0..8 {
            let mut flipped = bytes.clone();
            flipped[at] ^= 1 << bit;
            variants.push(flipped);
        }
        let mut dropped = bytes.clone();
        dropped.remove(at);
        variants.push(dropped);
        let mut swapped = bytes.clone();
        swapped.swap(at, at + 1);
        variants.push(swapped);
        let mut doubled = bytes.clone();
        doubled.insert(at, bytes[at]);
        variants.push(doubled);
        for variant in variants {
            let (good, _) = decode(&variant, 7, 0);
            assert!(
                good.iter()
                    .all(|(place, message)| *place < 3 && *message == code)
            );
            assert!(good.iter().any(|(place, _)| *place == 0), "byte {at}");
            // A changed zero between two frames may cost one neighbour, never more.
            assert!(good.len() >= 2, "byte {at}");
            assert!(good.iter().any(|(place, _)| *place == 2), "byte {at}");
        }
    }
}
