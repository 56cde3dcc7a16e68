//! Tests of the codes of a virtual board and of its responses to commands.

use link::{
    Decoder, Encoder, ExclusionPolicy, Flags, MAX_FRAME, ResetInto, Streams, ToDevice, ToHost,
};

mod compressed;
mod impedance;
mod streams;

use super::*;
use crate::outbox::WhenFull;
use crate::synthetic::{Generator, SyntheticSpec};

fn board() -> (VirtualBoard, Outbox) {
    let outbox = Outbox::new(WhenFull::DropOldest);
    let identity = Identity { session_id: 7, chip_uid: [1; 12], ..Identity::default() };
    let board = VirtualBoard::new(identity, Mains::Hz50, outbox.clone());
    (board, outbox)
}

fn send(board: &mut VirtualBoard, host: &mut Encoder, command: ToDevice<'_>) {
    let mut buffer = [0; MAX_FRAME];
    let bytes = host.encode(0, &command, &mut buffer).expect("a command fits a frame");
    board.receive(bytes, 1_000);
}

/// Removes all frames from the outbox and returns what `select` picks from their messages.
fn frames<T>(outbox: &Outbox, select: impl Fn(ToHost<'_>) -> Option<T>) -> Vec<T> {
    let mut decoder = Decoder::<MAX_FRAME>::new();
    let mut seen = Vec::new();
    for frame in outbox.take_all() {
        let mut bytes = &frame[..];
        while let Some(outcome) = decoder.next::<ToHost<'_>>(&mut bytes) {
            let frame = outcome.expect("the board sends intact frames");
            seen.extend(select(frame.message));
        }
    }
    seen
}

const fn start(streams: Streams) -> ToDevice<'static> {
    ToDevice::Start(Start { streams, mains_hz: 0 })
}

const START: ToDevice<'_> = start(Streams::CODES);

#[test]
fn a_clipped_value_in_two_windows_is_counted_once() {
    let (mut board, outbox) = board();
    let mut host = Encoder::default();
    send(&mut board, &mut host, START);
    for index in 0..512 {
        let mut sample = Sample::default();
        sample.counts[20] = if index == 200 { Sample::MAX / 2 } else { 0 };
        board.process_sample(&sample, 0);
    }
    let marked = frames(&outbox, |message| match message {
        ToHost::Code(code) if code.clipped > 0 => Some(code.clipped),
        _ => None,
    });
    let total: u32 = marked.iter().map(|&clipped| u32::from(clipped)).sum();
    let once = board.producer.clipped();
    assert!((1..64).contains(&once), "one electrode, while the impulse response lasts");
    assert_eq!(board.stats().clipped, once);
    assert!(total > board.stats().clipped, "overlapping windows count it twice");
}

/// Two electrodes and a channel without an electrode are at the rail for one sample.
#[test]
fn a_code_names_the_channels_at_the_rail_and_substitutes_the_electrodes_among_them() {
    // What the codes state in the windows that contain the sample, and in all later windows:
    // whether channels are at the rail, which channels, and whether electrodes are substituted.
    // Electrodes stay substituted for 10 s, longer than this run.
    for (automatic, at_rail, afterwards) in [
        (true, (true, 1 << 63, true), (false, 0, true)),
        (false, (true, 1 << 3 | 1 << 40 | 1 << 63, false), (false, 0, false)),
    ] {
        let (mut board, outbox) = board();
        let mut host = Encoder::default();
        let policy = ExclusionPolicy { automatic, ..ExclusionPolicy::AUTOMATIC };
        send(&mut board, &mut host, ToDevice::SetExclusion(policy));
        send(&mut board, &mut host, START);
        for index in 0..512 {
            let mut sample = Sample::default();
            if index == 200 {
                (sample.counts[3], sample.counts[40]) = (Sample::MAX, -Sample::MAX - 1);
                sample.counts[63] = Sample::MAX;
            }
            board.process_sample(&sample, 0);
        }
        let seen = frames(&outbox, |message| match message {
            ToHost::Code(code) => Some((
                code.flags.contains(Flags::SATURATED),
                code.saturated,
                code.flags.contains(Flags::SUBSTITUTED),
            )),
            _ => None,
        });
        let mut expected = vec![afterwards; seen.len()];
        expected[..5].fill((false, 0, false));
        expected[5..7].fill(at_rail);
        assert_eq!(seen, expected, "automatic: {automatic}");
        assert_eq!(board.stats().clipped == 0, automatic);
    }
}

#[test]
fn no_electrode_of_synthetic_eeg_is_substituted() {
    for seed in [1, 2] {
        let (mut board, outbox) = board();
        send(&mut board, &mut Encoder::default(), START);
        let spec = SyntheticSpec::new(seed, model::LABELS.split(' '));
        let mut eeg = Generator::new(&spec).expect("a generator");
        let mut substituted = Vec::new();
        // The filters settle for 10 s, in which no electrode is evaluated.
        for _second in 0..40 {
            for counts in eeg.by_ref().take(model::ADC_RATE_HZ.into()) {
                board.process_sample(&Sample { counts }, 0);
            }
            substituted.extend(frames(&outbox, |message| match message {
                ToHost::Code(code) => Some(code.flags.contains(Flags::SUBSTITUTED)),
                _ => None,
            }));
        }
        assert_eq!(substituted, [false; 40 * 16 - 1], "seed {seed}");
    }
}

#[test]
fn every_second_of_a_stream_the_quality_of_each_electrode_is_sent() {
    let (mut board, outbox) = board();
    let mut host = Encoder::default();
    for command in [START, ToDevice::Stop, START] {
        send(&mut board, &mut host, command);
        // Process 1.5 s of samples. Only the complete second has a quality report.
        for index in 0..3 * model::ADC_RATE_HZ / 2 {
            let mut sample = Sample::default();
            sample.counts[3] = if index < 100 { Sample::MAX } else { 0 };
            board.process_sample(&sample, 0);
        }
    }
    let reports = frames(&outbox, |message| match message {
        ToHost::Quality(quality) => Some(quality),
        _ => None,
    });
    assert_eq!(reports.len(), 2);
    for report in reports {
        assert_eq!((report.first_sample, report.settling), (0, true));
        assert_eq!(report.electrodes.len(), pipeline::ELECTRODES);
        for (index, electrode) in report.electrodes.iter().enumerate() {
            let of_third = index == 3;
            assert_eq!(electrode.samples_at_rail, if of_third { 100 } else { 0 });
            assert_eq!(electrode.flat, !of_third);
            assert_eq!(electrode.rms_uv > 1.0, of_third);
        }
    }
}

const START_PACKED: ToDevice<'_> = start(Streams::PACKED);

/// Processes one second of samples, and returns the quantiser rates of their packed blocks.
fn rates(board: &mut VirtualBoard, outbox: &Outbox) -> Vec<u8> {
    for _ in 0..model::ADC_RATE_HZ {
        board.process_sample(&Sample::default(), 0);
    }
    frames(outbox, |message| match message {
        ToHost::PackedCode(block) => Some(block.rate),
        _ => None,
    })
}

#[test]
fn every_command_of_one_read_is_executed() {
    let (mut board, outbox) = board();
    let mut host = Encoder::default();
    let mut bytes = Vec::new();
    for command in [START_PACKED, ToDevice::SetRate { rate: 9 }] {
        let mut buffer = [0; MAX_FRAME];
        bytes.extend_from_slice(host.encode(0, &command, &mut buffer).expect("a frame"));
    }
    board.receive(&bytes, 1_000);
    assert_eq!(rates(&mut board, &outbox), [9; 16]);
}

#[test]
fn the_rate_outlives_a_run_and_not_a_reset() {
    let (mut board, outbox) = board();
    let mut host = Encoder::default();
    send(&mut board, &mut host, ToDevice::SetRate { rate: 9 });
    for expected in [9, 9] {
        send(&mut board, &mut host, START_PACKED);
        assert_eq!(rates(&mut board, &outbox)[0], expected);
        send(&mut board, &mut host, ToDevice::Stop);
    }
    send(&mut board, &mut host, ToDevice::Reset(ResetInto::Firmware));
    send(&mut board, &mut Encoder::default(), START_PACKED);
    let of_model = pipeline::PackedEncoder::DEFAULT_RATE.index();
    assert_eq!(rates(&mut board, &outbox)[0], of_model);
}
