//! Orders and messages that a session returns for commands from a host.

use std::{vec, vec::Vec};

use link::{EventKind, Header, MAX_FRAME, ResetCause, Stage, StageTiming};

use super::*;
use crate::acquired_sample::Marks;
use crate::frame_ring::FrameRing;

type Ring = Sender<FrameRing<16_384>>;

/// Abilities of a board that supports every command and stream.
const EVERYTHING: Abilities = Abilities {
    streams: Streams::ALL,
    self_test: true,
    bootloader: true,
    clock: true,
};

fn identity() -> Identity<'static> {
    Identity {
        firmware: "0.1.0",
        board: "test",
        chip_uid: [0; 12],
        session_id: 1,
        reset_cause: ResetCause::PowerOn,
        fault: "",
    }
}

fn board(abilities: Abilities) -> (Session<'static>, Ring) {
    let session = Session::new(identity(), abilities, Mains::default());
    (session, Sender::new(FrameRing::new()))
}

const fn start(streams: Streams) -> ToDevice {
    ToDevice::Start(Start {
        streams,
        mains_hz: 0,
    })
}

/// Delivers a command at 1,000 us; returns the order to the board and the result in the `Ack`.
fn execute(
    session: &mut Session<'_>,
    sender: &mut Ring,
    command: ToDevice,
) -> (Option<Order>, AckResult) {
    let mut buffer = [0; MAX_FRAME];
    let mut host = link::Encoder::starting_at(70);
    let bytes = host.encode(0, &command, &mut buffer).unwrap();
    let mut orders = Vec::new();
    session.receive(bytes, 1_000, Counts::default(), sender, |order| {
        orders.push(order);
    });
    let acks = sent(sender, |_, message| match message {
        ToHost::Ack(ack) => Some(*ack),
        _ => None,
    });
    assert_eq!(acks.len(), 1, "one answer");
    assert_eq!(acks[0].of, 70);
    assert!(orders.len() < 2, "{orders:?}");
    (orders.pop(), acks[0].result)
}

/// Removes all queued frames and returns the values that `select` extracts from them.
fn sent<T>(sender: &mut Ring, select: impl Fn(&Header, &ToHost<'_>) -> Option<T>) -> Vec<T> {
    let mut host = Decoder::<MAX_FRAME>::new();
    let mut found = Vec::new();
    let mut buffer = [0; MAX_FRAME];
    while let Some(mut bytes) = sender.queue().pop(&mut buffer) {
        while let Some(frame) = host.next::<ToHost<'_>>(&mut bytes) {
            let frame = frame.expect("a sound frame");
            found.extend(select(&frame.header, &frame.message));
        }
    }
    found
}

/// Removes all queued messages and returns the names of their kinds.
fn kinds(sender: &mut Ring) -> Vec<&'static str> {
    sent(sender, |_, message| {
        Some(match message {
            ToHost::Hello(_) => "hello",
            ToHost::Capabilities(_) => "capabilities",
            ToHost::Substitutes(_) => "substitutes",
            ToHost::Converters(_) => "converters",
            ToHost::Stats(_) => "stats",
            ToHost::ClockReading(_) => "clock",
            ToHost::SelfTest(_) => "self-test",
            ToHost::Event(_) => "event",
            ToHost::Code(_) => "code",
            ToHost::Ack(_) => "ack",
            _ => "other",
        })
    })
}

/// Executes a command and returns the kinds of the messages that the session sends for it.
fn kinds_after(
    session: &mut Session<'_>,
    sender: &mut Ring,
    command: ToDevice,
) -> Vec<&'static str> {
    let mut buffer = [0; MAX_FRAME];
    let bytes = link::Encoder::default().encode(0, &command, &mut buffer);
    session.receive(bytes.unwrap(), 1_000, Counts::default(), sender, |_| ());
    kinds(sender)
}

fn event(run: u32) -> Output<'static> {
    Output {
        run,
        at_us: 5,
        payload: Payload::Event(link::Event {
            kind: EventKind::TriggerRise,
            number: 0,
            sample: 0,
        }),
    }
}

fn code(window: u32, clipped_values: u8) -> Code {
    Code {
        window,
        first_sample: 0,
        offset_us: 0,
        clipped: 0,
        clipped_values,
        saturated: 0,
        settling: false,
        values: pipeline::CodeValues::Int8([0; model::CODE]),
    }
}

#[test]
fn a_device_with_a_damaged_model_answers_and_refuses_starts() {
    let (mut session, mut sender) = board(EVERYTHING);
    session.refuse_starts();
    let answer = execute(&mut session, &mut sender, start(Streams::CODES));
    assert_eq!(answer, (None, AckResult::NotSupported));
    assert!(!session.is_streaming());
}

#[test]
fn substitutes_come_before_the_capabilities_that_they_concern() {
    let (mut session, mut sender) = board(EVERYTHING);
    let introduced = kinds_after(&mut session, &mut sender, ToDevice::Identify);
    assert_eq!(introduced, ["hello", "capabilities", "ack"]);
    let substitutes = link::Substitutes {
        interpolated: 1,
        zero: 0,
    };
    let mut session = session.with_substitutes(substitutes);
    let introduced = kinds_after(&mut session, &mut sender, ToDevice::Identify);
    assert_eq!(introduced, ["hello", "substitutes", "capabilities", "ack"]);
}

#[test]
fn outputs_of_an_earlier_run_are_dropped_also_when_run_numbers_wrap() {
    let (mut session, mut sender) = board(EVERYTHING);
    session.run.number = u32::MAX - 1;
    let mut runs = Vec::new();
    for streams in [Streams::EVENTS, Streams::ALL] {
        let (order, _) = execute(&mut session, &mut sender, start(streams));
        let Some(Order::Start(run)) = order else {
            panic!("{order:?}");
        };
        runs.push(run.number);
        session.send(&event(run.number), &mut sender);
        assert_eq!(kinds(&mut sender), ["event"]);
    }
    assert_eq!(runs, [u32::MAX, 0]);
    session.send(&event(u32::MAX), &mut sender);
    assert_eq!(kinds(&mut sender), [""; 0], "of the previous run");
    execute(&mut session, &mut sender, ToDevice::Stop);
    session.send(&event(0), &mut sender);
    assert_eq!(kinds(&mut sender), [""; 0], "no run is active");
}

#[test]
fn a_start_with_other_streams_is_a_new_run_and_a_repeated_one_is_not() {
    let (mut session, mut sender) = board(EVERYTHING);
    let mut numbers = Vec::new();
    for streams in [
        Streams::CODES,
        Streams::CODES,
        Streams::CODES | Streams::RAW,
        Streams::CODES | Streams::RAW,
        Streams::RAW,
    ] {
        let (order, result) = execute(&mut session, &mut sender, start(streams));
        assert_eq!(result, AckResult::Done);
        numbers.push(match order {
            Some(Order::Start(run)) => {
                assert_eq!(run.streams, streams);
                Some(run.number)
            }
            _ => None,
        });
    }
    assert_eq!(numbers, [Some(1), None, Some(2), None, Some(3)]);
    // A `Start` with another mains frequency starts a new run, because the filters change.
    let mains = ToDevice::Start(Start {
        streams: Streams::RAW,
        mains_hz: 60,
    });
    let kinds = kinds_after(&mut session, &mut sender, mains);
    assert_eq!(kinds, ["capabilities", "ack"]);
    assert_eq!(session.run.number, 4);
}

#[test]
fn missing_empty_and_unknown_streams_are_refused() {
    let (mut session, mut sender) = board(Abilities::CODES);
    for streams in [
        Streams::empty(),
        Streams::RAW,
        Streams::CODES | Streams::EVENTS,
        Streams::from_bits(1 | 1 << 12),
    ] {
        let answer = execute(&mut session, &mut sender, start(streams));
        assert_eq!(answer, (None, AckResult::BadArgument), "{streams:?}");
    }
    assert!(!session.is_streaming());
}

#[test]
fn during_a_self_test_starts_are_refused_and_a_stop_does_not_end_it() {
    let (mut session, mut sender) = board(EVERYTHING);
    let ordered = execute(&mut session, &mut sender, ToDevice::SelfTest);
    assert_eq!(ordered, (Some(Order::SelfTest), AckResult::Done));
    let busy = (None, AckResult::Busy);
    for command in [ToDevice::SelfTest, start(Streams::CODES)] {
        assert_eq!(execute(&mut session, &mut sender, command), busy);
    }
    let stopped = execute(&mut session, &mut sender, ToDevice::Stop);
    assert_eq!(stopped, (None, AckResult::Done));
    assert_eq!(
        execute(&mut session, &mut sender, start(Streams::CODES)),
        busy
    );

    session.send_self_test(SelfTest::default(), 9, &mut sender);
    assert_eq!(kinds(&mut sender), ["self-test"]);
    let (order, result) = execute(&mut session, &mut sender, start(Streams::CODES));
    assert!(matches!(order, Some(Order::Start(_))), "{order:?}");
    assert_eq!(result, AckResult::Done);
    assert_eq!(execute(&mut session, &mut sender, ToDevice::SelfTest), busy);
}

#[test]
fn commands_beyond_a_boards_abilities_are_not_supported() {
    let (mut session, mut sender) = board(Abilities::CODES);
    for command in [ToDevice::SelfTest, ToDevice::Reset(ResetInto::Bootloader)] {
        let answer = execute(&mut session, &mut sender, command);
        assert_eq!(answer, (None, AckResult::NotSupported));
    }
}

#[test]
fn only_resets_into_known_programs_are_ordered() {
    let (mut session, mut sender) = board(EVERYTHING);
    for into in [ResetInto::Firmware, ResetInto::Bootloader] {
        let answer = execute(&mut session, &mut sender, ToDevice::Reset(into));
        assert_eq!(answer, (Some(Order::Reset(into)), AckResult::Done));
    }
    let newer = ToDevice::Reset(ResetInto::Newer(2));
    let answer = execute(&mut session, &mut sender, newer);
    assert_eq!(answer, (None, AckResult::BadArgument));
}

#[test]
fn a_device_without_a_clock_refuses_to_read_it() {
    let (mut session, mut sender) = board(Abilities::CODES);
    let command = ToDevice::SyncTime { host_time_us: 77 };
    let answer = execute(&mut session, &mut sender, command);
    assert_eq!(answer, (None, AckResult::NotSupported));
}

#[test]
fn a_clock_reading_precedes_its_ack() {
    let (mut session, mut sender) = board(EVERYTHING);
    let command = ToDevice::SyncTime { host_time_us: 77 };
    assert_eq!(
        kinds_after(&mut session, &mut sender, command),
        ["clock", "ack"]
    );
    let mut buffer = [0; MAX_FRAME];
    let bytes = link::Encoder::default().encode(0, &command, &mut buffer);
    session.receive(
        bytes.unwrap(),
        1_234,
        Counts::default(),
        &mut sender,
        |_| (),
    );
    let readings = sent(&mut sender, |header, message| match message {
        ToHost::ClockReading(reading) => Some((
            reading.host_time_us,
            reading.received_us,
            header.device_time_us,
        )),
        _ => None,
    });
    assert_eq!(readings, [(77, 1_234, 1_234)]);
}

#[test]
fn the_converters_status_is_sent_on_introduction_on_a_new_fault_and_while_streaming() {
    let (mut session, mut sender) = board(EVERYTHING);
    let introduced = |session: &mut Session<'_>, sender: &mut Ring| {
        kinds_after(session, sender, ToDevice::Identify)
    };
    let none = introduced(&mut session, &mut sender);
    assert_eq!(none, ["hello", "capabilities", "ack"]);
    let update = |session: &mut Session<'_>, sender: &mut Ring, fault: &str| {
        let converters = Converters {
            fault: crate::converters::fault_text(fault),
            ..Converters::default()
        };
        session.update_converters(converters, 5, sender);
        kinds(sender).len()
    };
    let sent_counts =
        ["", "", "chip 3", "chip 3", ""].map(|fault| update(&mut session, &mut sender, fault));
    assert_eq!(sent_counts, [1, 0, 1, 0, 1]);
    let known = introduced(&mut session, &mut sender);
    assert_eq!(known, ["hello", "capabilities", "converters", "ack"]);
    execute(&mut session, &mut sender, start(Streams::CODES));
    assert_eq!(update(&mut session, &mut sender, ""), 1);
}

#[test]
fn counters_wrap_and_windows_are_still_counted() {
    let (mut session, mut sender) = board(EVERYTHING);
    session.stats.codes_made = u32::MAX;
    session.stats.clipped_values = u32::MAX - 1;
    session.stats.commands = u32::MAX;
    let (order, _) = execute(&mut session, &mut sender, start(Streams::CODES));
    let Some(Order::Start(run)) = order else {
        panic!("{order:?}");
    };
    let output = Output {
        run: run.number,
        at_us: u64::MAX,
        payload: Payload::Code(&code(u32::MAX, 3), Marks::NONE),
    };
    session.send(&output, &mut sender);
    let stats = session.stats(Counts::default(), u32::MAX);
    assert_eq!(stats.codes_made, 0);
    assert_eq!(stats.clipped_values, 1);
    assert_eq!(stats.commands, 0);
    assert_eq!(stats.next_window, 0);
    assert_eq!(stats.frames_dropped, u32::MAX);
    assert_eq!(kinds(&mut sender), ["code"]);
}

#[test]
fn a_start_resets_the_next_window_and_a_stop_keeps_it() {
    let (mut session, mut sender) = board(EVERYTHING);
    let next = |session: &Session<'_>| session.stats(Counts::default(), 0).next_window;
    execute(&mut session, &mut sender, start(Streams::CODES));
    let output = Output {
        run: session.run.number,
        at_us: 0,
        payload: Payload::Code(&code(41, 0), Marks::NONE),
    };
    session.send(&output, &mut sender);
    let stopped = kinds_after(&mut session, &mut sender, ToDevice::Stop);
    assert_eq!(stopped, ["code", "stats", "ack"]);
    assert_eq!(next(&session), 42);
    execute(&mut session, &mut sender, start(Streams::CODES));
    assert_eq!(next(&session), 0);
}

#[test]
fn timing_is_sent_unchanged() {
    let (session, mut sender) = board(EVERYTHING);
    let send = StageTiming {
        stage: Stage::Send,
        deadline_ns: 62_500_000,
        worst_ns: 40_000,
        histogram: [16, 0, 0, 0, 0, 0, 0, 0, 0],
    };
    let timing = Timing {
        stages: [send].into_iter().collect(),
        stack_used: 1_024,
        stack_size: 4_096,
    };
    session.send_timing(timing.clone(), 5, &mut sender);
    let found = sent(&mut sender, |header, message| match message {
        ToHost::Timing(timing) => Some((header.device_time_us, timing.clone())),
        _ => None,
    });
    assert_eq!(found, vec![(5, timing)]);
}

#[test]
fn a_rate_is_ordered_at_any_time_if_it_exists_and_the_device_has_packed_codes() {
    let (mut session, mut sender) = board(EVERYTHING);
    let mut answer = |rate| execute(&mut session, &mut sender, ToDevice::SetRate { rate });
    let order = |rate| Rate::new(rate).map(Order::SetRate);
    assert_eq!(answer(0), (order(0), AckResult::Done));
    assert_eq!(answer(15), (order(15), AckResult::Done));
    assert_eq!(answer(16), (None, AckResult::BadArgument));
    execute(&mut session, &mut sender, start(Streams::PACKED));
    let running = execute(&mut session, &mut sender, ToDevice::SetRate { rate: 2 });
    assert_eq!(running, (order(2), AckResult::Done));
    let (mut session, mut sender) = board(Abilities::CODES);
    let answer = execute(&mut session, &mut sender, ToDevice::SetRate { rate: 4 });
    assert_eq!(answer, (None, AckResult::NotSupported));
}
