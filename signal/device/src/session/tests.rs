//! Orders and messages that a session returns for commands from a host.

use std::{boxed::Box, vec::Vec};

use link::{
    BandPass, EventKind, Header, MAX_CHUNK_BYTES, MAX_FRAME, ModelBegin, ModelChunk, ResetCause,
    model_crc,
};

use super::*;
use crate::acquired_sample::Marks;
use crate::model_slot::tests::packed_alone;
use crate::model_slot::{ModelSlot, NoSlot};
use crate::sender::FrameRing;

/// Abilities of a board that supports every command and stream.
const EVERYTHING: Abilities = Abilities {
    streams: Streams::ALL,
    self_test: true,
    bootloader: true,
    clock: true,
    impedance: true,
};

/// Device under test: its session, and the sender whose queue holds the frames to the host.
struct Device {
    session: Session<'static>,
    sender: Sender<FrameRing<16_384>>,
    slot: Box<ModelSlot>,
}

impl Device {
    fn new(abilities: Abilities) -> Self {
        let identity = Identity {
            firmware: "0.1.0",
            board: "test",
            chip_uid: [0; 12],
            session_id: 1,
            reset_cause: ResetCause::PowerOn,
            fault: "",
        };
        Self {
            session: Session::new(identity, abilities, Mains::default()),
            sender: Sender::new(FrameRing::new()),
            slot: Box::new(ModelSlot::empty()),
        }
    }

    /// Delivers a command with the `seq` 70 at 1,000 us; returns the order that the session gives
    /// the board, if any.
    fn deliver(&mut self, command: ToDevice<'_>) -> Option<Order> {
        let mut buffer = [0; MAX_FRAME];
        let mut host = link::Encoder::starting_at(70);
        let bytes = host.encode(0, &command, &mut buffer).unwrap();
        let (mut orders, counts) = (Vec::new(), Counts::default());
        let Self { session, sender, slot } = self;
        session.receive(bytes, 1_000, counts, &mut **slot, sender, |order| {
            orders.push(order);
        });
        assert!(orders.len() < 2, "{orders:?}");
        orders.pop()
    }

    /// Delivers a command; returns the order that the session gives the board, if any, and the
    /// result in the `Ack`.
    fn execute(&mut self, command: ToDevice<'_>) -> (Option<Order>, AckResult) {
        let order = self.deliver(command);
        let acks = self.sent(|_, message| match message {
            ToHost::Ack(ack) => Some(*ack),
            _ => None,
        });
        let [Ack { of: 70, result }] = acks[..] else {
            panic!("one answer: {acks:?}");
        };
        (order, result)
    }

    /// Starts a run with these streams, and returns the run that the board is ordered to start.
    fn run(&mut self, streams: Streams) -> Run {
        match self.execute(start(streams)) {
            (Some(Order::Start(run)), AckResult::Done) => run,
            answer => panic!("{answer:?}"),
        }
    }

    /// Delivers a command and returns the names of the messages that the session sends for it.
    fn kinds_after(&mut self, command: ToDevice<'_>) -> Vec<&'static str> {
        self.deliver(command);
        self.kinds()
    }

    /// Removes all queued frames and returns the values that `select` extracts from them.
    fn sent<T>(&mut self, select: impl Fn(&Header, &ToHost<'_>) -> Option<T>) -> Vec<T> {
        let mut host = Decoder::<MAX_FRAME>::new();
        let mut found = Vec::new();
        let mut buffer = [0; MAX_FRAME];
        while let Some(mut bytes) = self.sender.queue().pop(&mut buffer) {
            while let Some(frame) = host.next::<ToHost<'_>>(&mut bytes) {
                let frame = frame.expect("a sound frame");
                found.extend(select(&frame.header, &frame.message));
            }
        }
        found
    }

    /// Removes all queued messages and returns the names of their kinds.
    fn kinds(&mut self) -> Vec<&'static str> {
        self.sent(|_, message| {
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
                ToHost::ModelReceived(_) => "received",
                _ => "other",
            })
        })
    }

    /// Sends an output and returns the names of the messages that the host receives for it.
    fn kinds_of(&mut self, run: u32, payload: Payload<'_>) -> Vec<&'static str> {
        let output = Output { run, at_us: 5, payload };
        self.session.send(&output, &mut self.sender);
        self.kinds()
    }
}

const fn start(streams: Streams) -> ToDevice<'static> {
    ToDevice::Start(Start { streams, mains_hz: 0 })
}

const EVENT: Payload<'_> =
    Payload::Event(link::Event { kind: EventKind::TriggerRise, number: 0, sample: 0 });

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
fn a_command_is_refused_if_the_board_cannot_do_it_or_an_argument_is_out_of_range() {
    let rate = |rate| ToDevice::SetRate { rate };
    let mains = |mains_hz| ToDevice::Start(Start { streams: Streams::CODES, mains_hz });
    let unknown = Streams::from_bits(1 | 1 << 12);
    for (abilities, command, result) in [
        (EVERYTHING, start(Streams::empty()), AckResult::BadArgument),
        (EVERYTHING, start(unknown), AckResult::BadArgument),
        (EVERYTHING, mains(55), AckResult::BadArgument),
        (EVERYTHING, ToDevice::Reset(ResetInto::Newer(2)), AckResult::BadArgument),
        (EVERYTHING, rate(16), AckResult::BadArgument),
        (Abilities::CODES, start(Streams::RAW), AckResult::BadArgument),
        (Abilities::CODES, start(Streams::CODES | Streams::EVENTS), AckResult::BadArgument),
        (Abilities::CODES, ToDevice::SelfTest, AckResult::NotSupported),
        (Abilities::CODES, ToDevice::Reset(ResetInto::Bootloader), AckResult::NotSupported),
        (Abilities::CODES, ToDevice::SyncTime { host_time_us: 77 }, AckResult::NotSupported),
        (Abilities::CODES, rate(4), AckResult::NotSupported),
        (Abilities::CODES, ToDevice::SetImpedance { on: true }, AckResult::NotSupported),
    ] {
        let mut device = Device::new(abilities);
        assert_eq!(device.execute(command), (None, result), "{command:?}");
        assert!(!device.session.is_streaming(), "{command:?}");
    }
    let mut device = Device::new(EVERYTHING);
    device.session.refuse_starts();
    let refused = (None, AckResult::NotSupported);
    assert_eq!(device.execute(start(Streams::CODES)), refused, "a damaged model");
}

#[test]
fn resets_and_rates_are_ordered_also_during_a_run() {
    let mut device = Device::new(EVERYTHING);
    for _ in 0..2 {
        for into in [ResetInto::Firmware, ResetInto::Bootloader] {
            let answer = device.execute(ToDevice::Reset(into));
            assert_eq!(answer, (Some(Order::Reset(into)), AckResult::Done));
        }
        for rate in [0, 15] {
            let answer = device.execute(ToDevice::SetRate { rate });
            let order = Rate::new(rate).map(Order::SetRate);
            assert_eq!(answer, (order, AckResult::Done));
        }
        device.deliver(start(Streams::PACKED));
        device.kinds();
    }
}

/// New filters do not end the run, because each `Features` message carries the id of its filters.
#[test]
fn filters_in_range_are_taken_at_any_time_and_others_change_nothing() {
    let mut device = Device::new(EVERYTHING);
    device.run(Streams::FEATURES);
    let section = BandPass { gain: 1 << 31, ..BandPass::default() };
    let filters = |weights| {
        ToDevice::SetFeatures(link::FeatureFilters {
            id: 3,
            first: section,
            second: section,
            weights,
        })
    };
    let weights = [1; model::ELECTRODES];
    assert_eq!(device.execute(filters(&weights)), (None, AckResult::Done));
    let expected = FeatureFilters::new(3, [[1 << 31, 0, 0]; 2], &weights);
    assert_eq!(device.session.take_filters(), expected);
    for weights in [&weights[1..], &[0x80; model::ELECTRODES]] {
        assert_eq!(device.execute(filters(weights)), (None, AckResult::BadArgument));
    }
    assert_eq!(device.session.take_filters(), None);
}

#[test]
fn substitutes_come_before_the_capabilities_that_they_concern() {
    let mut device = Device::new(EVERYTHING);
    let introduced = device.kinds_after(ToDevice::Identify);
    assert_eq!(introduced, ["hello", "capabilities", "ack"]);
    device.session = device.session.with_substitutes(Substitutes { interpolated: 1, zero: 0 });
    let introduced = device.kinds_after(ToDevice::Identify);
    assert_eq!(introduced, ["hello", "substitutes", "capabilities", "ack"]);
}

#[test]
fn outputs_of_an_earlier_run_are_dropped_also_when_run_numbers_wrap() {
    let mut device = Device::new(EVERYTHING);
    device.session.run.number = u32::MAX - 1;
    for (streams, number) in [(Streams::EVENTS, u32::MAX), (Streams::ALL, 0)] {
        assert_eq!(device.run(streams).number, number);
        assert_eq!(device.kinds_of(number, EVENT), ["event"]);
    }
    assert_eq!(device.kinds_of(u32::MAX, EVENT), [""; 0], "of the previous run");
    device.execute(ToDevice::Stop);
    assert_eq!(device.kinds_of(0, EVENT), [""; 0], "no run is active");
}

#[test]
fn a_start_with_other_streams_is_a_new_run_and_a_repeated_one_is_not() {
    let mut device = Device::new(EVERYTHING);
    let both = Streams::CODES | Streams::RAW;
    for (number, streams) in [(1, Streams::CODES), (2, both), (3, Streams::RAW)] {
        let run = device.run(streams);
        assert_eq!((run.number, run.streams), (number, streams));
        assert_eq!(device.execute(start(streams)), (None, AckResult::Done));
    }
    // A `Start` with another mains frequency starts a new run, because the filters change.
    let mains = ToDevice::Start(Start { streams: Streams::RAW, mains_hz: 60 });
    assert_eq!(device.kinds_after(mains), ["capabilities", "ack"]);
    assert_eq!(device.session.run.number, 4);
}

#[test]
fn during_a_self_test_starts_are_refused_and_a_stop_does_not_end_it() {
    let mut device = Device::new(EVERYTHING);
    let ordered = device.execute(ToDevice::SelfTest);
    assert_eq!(ordered, (Some(Order::SelfTest), AckResult::Done));
    let busy = (None, AckResult::Busy);
    for command in [ToDevice::SelfTest, start(Streams::CODES)] {
        assert_eq!(device.execute(command), busy);
    }
    assert_eq!(device.execute(ToDevice::Stop), (None, AckResult::Done));
    assert_eq!(device.execute(start(Streams::CODES)), busy);

    let sender = &mut device.sender;
    device.session.send_self_test(SelfTest::default(), 9, sender);
    assert_eq!(device.kinds(), ["self-test"]);
    device.run(Streams::CODES);
    assert_eq!(device.execute(ToDevice::SelfTest), busy);
}

#[test]
fn a_clock_reading_has_the_time_of_the_command_and_precedes_its_ack() {
    let mut device = Device::new(EVERYTHING);
    let command = ToDevice::SyncTime { host_time_us: 77 };
    assert_eq!(device.kinds_after(command), ["clock", "ack"]);
    device.deliver(command);
    let readings = device.sent(|header, message| match message {
        ToHost::ClockReading(reading) => Some((*reading, header.device_time_us)),
        _ => None,
    });
    let reading = ClockReading { host_time_us: 77, received_us: 1_000 };
    assert_eq!(readings, [(reading, 1_000)]);
}

#[test]
fn the_converters_status_is_sent_on_introduction_on_a_new_fault_and_while_streaming() {
    let mut device = Device::new(EVERYTHING);
    let none = device.kinds_after(ToDevice::Identify);
    assert_eq!(none, ["hello", "capabilities", "ack"]);
    let update = |device: &mut Device, fault: &str| {
        let converters =
            Converters { fault: crate::converters::fault_text(fault), ..Converters::default() };
        let sender = &mut device.sender;
        device.session.update_converters(converters, 5, sender);
        device.kinds().len()
    };
    let sent_counts = ["", "", "chip 3", "chip 3", ""].map(|fault| update(&mut device, fault));
    assert_eq!(sent_counts, [1, 0, 1, 0, 1]);
    let known = device.kinds_after(ToDevice::Identify);
    assert_eq!(known, ["hello", "capabilities", "converters", "ack"]);
    device.run(Streams::CODES);
    assert_eq!(update(&mut device, ""), 1);
}

#[test]
fn counters_wrap_and_windows_are_still_counted() {
    let mut device = Device::new(EVERYTHING);
    device.session.stats.codes_made = u32::MAX;
    device.session.stats.clipped_values = u32::MAX - 1;
    device.session.stats.commands = u32::MAX;
    let run = device.run(Streams::CODES).number;
    let payload = &code(u32::MAX, 3);
    assert_eq!(device.kinds_of(run, Payload::Code(payload, Marks::NONE)), ["code"]);
    let stats = device.session.stats(Counts::default(), u32::MAX);
    let expected = Stats {
        streams: Streams::CODES,
        clipped_values: 1,
        frames_dropped: u32::MAX,
        ..Stats::default()
    };
    assert_eq!(stats, expected);
}

#[test]
fn a_start_resets_the_next_window_and_a_stop_keeps_it() {
    let mut device = Device::new(EVERYTHING);
    let next = |device: &Device| device.session.stats(Counts::default(), 0).next_window;
    let run = device.run(Streams::CODES).number;
    device.kinds_of(run, Payload::Code(&code(41, 0), Marks::NONE));
    assert_eq!(device.kinds_after(ToDevice::Stop), ["stats", "ack"]);
    assert_eq!(next(&device), 42);
    device.run(Streams::CODES);
    assert_eq!(next(&device), 0);
}

#[test]
fn noise_and_echoes_are_counted_and_timing_is_sent_unchanged() {
    let mut device = Device::new(EVERYTHING);
    let mut buffer = [0; MAX_FRAME];
    let echo = link::Encoder::starting_at(1)
        .encode(0, &ToHost::SelfTest(SelfTest::default()), &mut buffer)
        .unwrap();
    for bytes in [&[7, 7, 7, 0][..], echo] {
        let Device { session, sender, .. } = &mut device;
        session.receive(bytes, 1_000, Counts::default(), &mut NoSlot, sender, |_| ());
    }
    assert_eq!(device.kinds(), [""; 0]);
    assert_eq!(device.execute(ToDevice::Stop).1, AckResult::Done);
    let stats = device.session.stats(Counts::default(), 0);
    assert_eq!((stats.input_bad, stats.commands), (2, 1));

    let timing = Timing { stack_used: 1_024, stack_size: 4_096, ..Timing::default() };
    device.session.send_timing(timing.clone(), 5, &mut device.sender);
    let sent = device.sent(|header, message| match message {
        ToHost::Timing(timing) => Some((header.device_time_us, timing.clone())),
        _ => None,
    });
    assert_eq!(sent, [(5, timing)]);
}

/// Commands that upload the model `bytes` with the id `ID`.
fn upload(bytes: &[u8]) -> impl Iterator<Item = ToDevice<'_>> {
    let begin = ToDevice::ModelBegin(ModelBegin {
        id: ID,
        bytes: u32::try_from(bytes.len()).unwrap(),
        crc: model_crc(bytes),
    });
    let chunks = (0..).step_by(MAX_CHUNK_BYTES).zip(bytes.chunks(MAX_CHUNK_BYTES));
    let chunks = chunks.map(|(offset, bytes)| ToDevice::ModelChunk(ModelChunk { offset, bytes }));
    [begin].into_iter().chain(chunks).chain([ToDevice::ModelEnd])
}

const ID: [u8; 8] = *b"personal";

/// Returns the upload of the built-in packed model; `None` if there is none.
fn packed_model() -> Option<Vec<u8>> {
    let artifact = artifact::Artifact::from_files(model::artifact_files::FILES).unwrap();
    model_gen::upload(&artifact).unwrap().map(packed_alone)
}

#[test]
fn an_uploaded_model_is_introduced_by_its_id_and_streams_what_its_host_can_decode() {
    let Some(mut bytes) = packed_model() else {
        return;
    };
    for is_of_this_network in [true, false] {
        let mut device = Device::new(EVERYTHING);
        if !is_of_this_network {
            bytes[12] ^= 1;
        }
        let answers: Vec<_> = upload(&bytes).map(|command| device.kinds_after(command)).collect();
        let (end, parts) = answers.split_last().unwrap();
        assert!(parts.iter().all(|part| part == &["received", "ack"]), "{parts:?}");
        assert_eq!(end, &["received", "hello", "capabilities", "ack"]);
        // A host announces an empty model to ask whether there is a slot; this changes nothing.
        let question = ToDevice::ModelBegin(ModelBegin::default());
        assert_eq!(device.execute(question), (None, AckResult::BadArgument));
        device.deliver(ToDevice::Identify);
        let ids = device.sent(|_, message| match message {
            ToHost::Hello(hello) => Some(hello.model_id),
            _ => None,
        });
        assert_eq!(ids, [ID]);
        let codes = if is_of_this_network { AckResult::Done } else { AckResult::BadArgument };
        for stream in [Streams::CODES, Streams::AUDIT] {
            assert_eq!(device.execute(start(stream)).1, codes);
        }
        device.execute(ToDevice::Stop);
        // Announcing another model discards this one; until the upload of the other model is
        // complete, the device uses the built-in model.
        let begin = ToDevice::ModelBegin(ModelBegin {
            id: [1; 8],
            bytes: u32::try_from(bytes.len()).unwrap(),
            crc: 0,
        });
        let replaced = device.kinds_after(begin);
        assert_eq!(replaced, ["received", "hello", "capabilities", "ack"]);
        device.run(Streams::PACKED | Streams::CODES);
    }
}

#[test]
fn capabilities_have_the_scales_of_an_uploaded_linear_code_until_it_is_replaced() {
    let artifact = artifact::Artifact::from_files(model::artifact_files::FILES).unwrap();
    if !model::HAS_SHORTCUT || artifact.packed.is_none() {
        return;
    }
    let linear = any_model::any_linear_for(4, &artifact).unwrap();
    let bytes = model_gen::upload(&linear).unwrap().unwrap();
    let own = model_gen::quantise(&linear).unwrap().code_scale;
    let mut device = Device::new(EVERYTHING);
    let mut reported = |command| {
        device.deliver(command);
        let reports = device.sent(|_, message| match message {
            ToHost::Capabilities(capabilities) => Some(capabilities.code_scale.to_vec()),
            _ => None,
        });
        reports.into_iter().next()
    };
    assert_eq!(upload(&bytes).find_map(&mut reported), Some(own.clone()));
    assert_eq!(reported(ToDevice::Identify), Some(own.clone()));
    let start = Start { streams: Streams::CODES | Streams::AUDIT, mains_hz: 60 };
    assert_eq!(reported(ToDevice::Start(start)), Some(own));
    assert_eq!(reported(ToDevice::Stop), None);
    let other = ModelBegin { id: [1; 8], bytes: u32::try_from(bytes.len()).unwrap(), crc: 0 };
    let built_in = Some(model::CODE_SCALE.to_vec());
    assert_eq!(reported(ToDevice::ModelBegin(other)), built_in);
}

#[test]
fn a_model_is_refused_while_streaming_without_a_slot_and_where_it_changes_no_stream() {
    let Some(bytes) = packed_model() else {
        return;
    };
    let mut device = Device::new(EVERYTHING);
    device.run(Streams::PACKED);
    for command in upload(&bytes) {
        assert_eq!(device.execute(command), (None, AckResult::Busy));
    }
    let mut without_packed = Device::new(Abilities::CODES);
    let begin = upload(&bytes).next().unwrap();
    let refused = (None, AckResult::NotSupported);
    assert_eq!(without_packed.execute(begin), refused);

    let mut device = Device::new(EVERYTHING);
    let mut buffer = [0; MAX_FRAME];
    for command in upload(&bytes) {
        let frame = link::Encoder::starting_at(70).encode(0, &command, &mut buffer);
        let Device { session, sender, .. } = &mut device;
        let (counts, slot) = (Counts::default(), &mut NoSlot);
        session.receive(frame.unwrap(), 1_000, counts, slot, sender, |_| ());
    }
    let results = device.sent(|_, message| match message {
        ToHost::Ack(ack) => Some(ack.result),
        _ => panic!("{message:?}"),
    });
    assert!(results.iter().all(|result| *result == AckResult::NotSupported));
}

#[test]
fn a_measurement_of_impedances_lasts_until_stop() {
    let measure = |on| ToDevice::SetImpedance { on };
    let mut device = Device::new(EVERYTHING);
    let done = |order| (Some(order), AckResult::Done);
    assert_eq!(device.execute(measure(true)), done(Order::SetImpedance(true)));
    // Without a run, `Stop` ends the measurement by a separate order, and only once.
    assert_eq!(device.execute(ToDevice::Stop), done(Order::SetImpedance(false)));
    assert_eq!(device.execute(ToDevice::Stop), (None, AckResult::Done));
    device.execute(start(Streams::CODES));
    assert_eq!(device.execute(measure(true)), done(Order::SetImpedance(true)));
    assert_eq!(device.execute(measure(false)), done(Order::SetImpedance(false)));
    assert_eq!(device.execute(ToDevice::Stop), done(Order::Stop));
}
