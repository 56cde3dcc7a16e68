//! What a host commands, and what becomes of it.

use std::{vec, vec::Vec};

use link::{EventKind, Header, MAX_FRAME, ResetCause, Stage, StageTiming};

use super::*;
use crate::FrameRing;

type Ring = Sender<FrameRing<16_384>>;

/// A board that can do everything.
const EVERYTHING: Abilities = Abilities {
    streams: Streams::ALL,
    self_test: true,
    bootloader: true,
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

/// Gives a command that arrives at 1,000 us; gives what the acquisition is to do, and the answer.
fn give(
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

/// What `look` finds in the frames that wait; they are taken out.
fn sent<T>(sender: &mut Ring, look: impl Fn(&Header, &ToHost<'_>) -> Option<T>) -> Vec<T> {
    let mut host = Decoder::<MAX_FRAME>::new();
    let mut found = Vec::new();
    let mut buffer = [0; MAX_FRAME];
    while let Some(mut bytes) = sender.queue().take(&mut buffer) {
        while let Some(frame) = host.next::<ToHost<'_>>(&mut bytes) {
            let frame = frame.expect("a sound frame");
            found.extend(look(&frame.header, &frame.message));
        }
    }
    found
}

/// Numbers of the messages that wait, in their enum.
fn kinds(sender: &mut Ring) -> Vec<&'static str> {
    sent(sender, |_, message| {
        Some(match message {
            ToHost::Hello(_) => "hello",
            ToHost::Capabilities(_) => "capabilities",
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

/// Gives a command and lists everything that is sent of it.
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

fn event(run: u32) -> Made {
    Made {
        run,
        at_us: 5,
        what: What::Event(link::Event {
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
fn a_device_with_a_damaged_model_answers_and_starts_nothing() {
    let (mut session, mut sender) = board(EVERYTHING);
    session.refuse_starts();
    let answer = give(&mut session, &mut sender, start(Streams::CODES));
    assert_eq!(answer, (None, AckResult::NotSupported));
    assert!(!session.is_streaming());
}

#[test]
fn what_was_made_in_an_old_run_is_dropped_also_when_their_numbers_wrap() {
    let (mut session, mut sender) = board(EVERYTHING);
    session.run.number = u32::MAX - 1;
    let mut runs = Vec::new();
    for streams in [Streams::EVENTS, Streams::ALL] {
        let (order, _) = give(&mut session, &mut sender, start(streams));
        let Some(Order::Start(run)) = order else {
            panic!("{order:?}");
        };
        runs.push(run.number);
        session.send(&event(run.number), &mut sender);
        assert_eq!(kinds(&mut sender), ["event"]);
    }
    assert_eq!(runs, [u32::MAX, 0]);
    session.send(&event(u32::MAX), &mut sender);
    assert_eq!(kinds(&mut sender), [""; 0], "of the run before");
    give(&mut session, &mut sender, ToDevice::Stop);
    session.send(&event(0), &mut sender);
    assert_eq!(kinds(&mut sender), [""; 0], "nothing runs");
}

#[test]
fn other_streams_are_a_new_run_and_the_same_ones_are_none() {
    let (mut session, mut sender) = board(EVERYTHING);
    let mut numbers = Vec::new();
    for streams in [
        Streams::CODES,
        Streams::CODES,
        Streams::CODES | Streams::RAW,
        Streams::CODES | Streams::RAW,
        Streams::RAW,
    ] {
        let (order, result) = give(&mut session, &mut sender, start(streams));
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
    // Other mains are another run, and the host learns of the filters.
    let mains = ToDevice::Start(Start {
        streams: Streams::RAW,
        mains_hz: 60,
    });
    let kinds = kinds_after(&mut session, &mut sender, mains);
    assert_eq!(kinds, ["capabilities", "ack"]);
    assert_eq!(session.run.number, 4);
}

#[test]
fn streams_that_a_board_has_not_none_and_unknown_ones_are_refused() {
    let (mut session, mut sender) = board(Abilities::CODES);
    for streams in [
        Streams::empty(),
        Streams::RAW,
        Streams::CODES | Streams::EVENTS,
        Streams::from_bits(1 | 1 << 12),
    ] {
        let answer = give(&mut session, &mut sender, start(streams));
        assert_eq!(answer, (None, AckResult::BadArgument), "{streams:?}");
    }
    assert!(!session.is_streaming());
}

#[test]
fn while_the_converters_are_tried_nothing_starts_and_a_stop_does_not_end_the_test() {
    let (mut session, mut sender) = board(EVERYTHING);
    let ordered = give(&mut session, &mut sender, ToDevice::SelfTest);
    assert_eq!(ordered, (Some(Order::SelfTest), AckResult::Done));
    let busy = (None, AckResult::Busy);
    for command in [ToDevice::SelfTest, start(Streams::CODES)] {
        assert_eq!(give(&mut session, &mut sender, command), busy);
    }
    let stopped = give(&mut session, &mut sender, ToDevice::Stop);
    assert_eq!(stopped, (None, AckResult::Done));
    assert_eq!(give(&mut session, &mut sender, start(Streams::CODES)), busy);

    session.self_test(&SelfTest::default(), 9, &mut sender);
    assert_eq!(kinds(&mut sender), ["self-test"]);
    let (order, result) = give(&mut session, &mut sender, start(Streams::CODES));
    assert!(matches!(order, Some(Order::Start(_))), "{order:?}");
    assert_eq!(result, AckResult::Done);
    assert_eq!(give(&mut session, &mut sender, ToDevice::SelfTest), busy);
}

#[test]
fn what_a_board_cannot_is_not_supported() {
    let (mut session, mut sender) = board(Abilities::CODES);
    for command in [ToDevice::SelfTest, ToDevice::Reset(ResetInto::Bootloader)] {
        let answer = give(&mut session, &mut sender, command);
        assert_eq!(answer, (None, AckResult::NotSupported));
    }
}

#[test]
fn a_reset_is_ordered_into_what_is_known_and_nothing_else() {
    let (mut session, mut sender) = board(EVERYTHING);
    for into in [ResetInto::Firmware, ResetInto::Bootloader] {
        let answer = give(&mut session, &mut sender, ToDevice::Reset(into));
        assert_eq!(answer, (Some(Order::Reset(into)), AckResult::Done));
    }
    let newer = ToDevice::Reset(ResetInto::Newer(2));
    let answer = give(&mut session, &mut sender, newer);
    assert_eq!(answer, (None, AckResult::BadArgument));
}

#[test]
fn a_clock_is_read_before_the_answer_goes_out() {
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
fn converters_are_told_of_with_the_introduction_when_their_fault_changes_and_while_streaming() {
    let (mut session, mut sender) = board(EVERYTHING);
    let introduced = |session: &mut Session<'_>, sender: &mut Ring| {
        kinds_after(session, sender, ToDevice::Identify)
    };
    let none = introduced(&mut session, &mut sender);
    assert_eq!(none, ["hello", "capabilities", "ack"]);
    let tell = |session: &mut Session<'_>, sender: &mut Ring, fault: &str| {
        let converters = Converters {
            fault: crate::fault_text(fault),
            ..Converters::default()
        };
        session.converters(converters, 5, sender);
        kinds(sender).len()
    };
    let told = ["", "", "chip 3", "chip 3", ""].map(|fault| tell(&mut session, &mut sender, fault));
    assert_eq!(told, [1, 0, 1, 0, 1]);
    let known = introduced(&mut session, &mut sender);
    assert_eq!(known, ["hello", "capabilities", "converters", "ack"]);
    give(&mut session, &mut sender, start(Streams::CODES));
    assert_eq!(tell(&mut session, &mut sender, ""), 1);
}

#[test]
fn counters_wrap_and_the_ledger_goes_on() {
    let (mut session, mut sender) = board(EVERYTHING);
    session.stats.codes_made = u32::MAX;
    session.stats.clipped_values = u32::MAX - 1;
    session.stats.commands = u32::MAX;
    let (order, _) = give(&mut session, &mut sender, start(Streams::CODES));
    let Some(Order::Start(run)) = order else {
        panic!("{order:?}");
    };
    let made = Made {
        run: run.number,
        at_us: u64::MAX,
        what: What::Code(code(u32::MAX, 3), Marks::NONE),
    };
    session.send(&made, &mut sender);
    let stats = session.stats(Counts::default(), u32::MAX);
    assert_eq!(stats.codes_made, 0);
    assert_eq!(stats.clipped_values, 1);
    assert_eq!(stats.commands, 0);
    assert_eq!(stats.next_window, 0);
    assert_eq!(stats.frames_dropped, u32::MAX);
    assert_eq!(kinds(&mut sender), ["code"]);
}

#[test]
fn a_start_counts_windows_from_0_and_a_stop_keeps_the_end() {
    let (mut session, mut sender) = board(EVERYTHING);
    let next = |session: &Session<'_>| session.stats(Counts::default(), 0).next_window;
    give(&mut session, &mut sender, start(Streams::CODES));
    let made = Made {
        run: session.run.number,
        at_us: 0,
        what: What::Code(code(41, 0), Marks::NONE),
    };
    session.send(&made, &mut sender);
    let stopped = kinds_after(&mut session, &mut sender, ToDevice::Stop);
    assert_eq!(stopped, ["code", "stats", "ack"]);
    assert_eq!(next(&session), 42);
    give(&mut session, &mut sender, start(Streams::CODES));
    assert_eq!(next(&session), 0);
}

#[test]
fn timing_goes_out_as_it_was_measured() {
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
    session.timing(&timing, 5, &mut sender);
    let found = sent(&mut sender, |header, message| match message {
        ToHost::Timing(timing) => Some((header.device_time_us, timing.clone())),
        _ => None,
    });
    assert_eq!(found, vec![(5, timing)]);
}
