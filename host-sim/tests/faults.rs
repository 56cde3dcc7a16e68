//! Each fault of the converters reaches the host: in the first code whose window holds it, and not
//! before.

use std::time::Duration;

use ads1299::{Error, Finding, ID};
use host_sim::{
    Fault, Faults, Identity, Outbox, VirtualBoard, WhenFull,
    synthetic::{Generator, SyntheticSpec},
};
use link::{Decoder, Flags, MAX_FRAME, Start, Stats, Streams, ToHost};
use pipeline::{Mains, Sample};

const BAD: Flags = Flags::ADC_STATUS_BAD;

/// Samples of a hop and of a window at 512 Hz; a step stands at every fourth sample, the first at the
/// first, and holds the three before it.
const HOP: usize = 32;
const WINDOW: u64 = 64;
const BEFORE: u64 = 3;

/// Flags of every code, and the counters at the end.
struct Seen {
    codes: Vec<Flags>,
    stats: Stats,
}

impl Seen {
    /// Windows with a flag.
    fn with(&self, flag: Flags) -> Vec<usize> {
        let codes = self.codes.iter().enumerate();
        codes
            .filter(|(_, flags)| flags.contains(flag))
            .map(|(window, _)| window)
            .collect()
    }
}

fn board(faults: &[&str]) -> (VirtualBoard, Outbox) {
    let faults: Vec<Fault> = faults.iter().map(|f| f.parse().expect("a fault")).collect();
    let faults = Faults::new(&faults).expect("one by one");
    let outbox = Outbox::new(WhenFull::Wait);
    let identity = Identity {
        session_id: 1,
        chip_uid: [0; 12],
    };
    let mut board = VirtualBoard::with_faults(identity, Mains::Hz50, faults, outbox.clone());
    let start = Start {
        streams: Streams::CODES,
        mains_hz: 0,
    };
    board.start(start, 0);
    (board, outbox)
}

/// Two seconds of EEG with these faults.
fn seen(faults: &[&str]) -> Seen {
    let (mut board, outbox) = board(faults);
    let spec = SyntheticSpec::new(1, model::LABELS.split(' '));
    let generator = Generator::new(&spec).expect("the default specification");
    for (index, counts) in (0..1024).zip(generator) {
        board.sample(&Sample { counts }, index * 1_000_000 / 512);
    }
    let mut codes = Vec::new();
    let mut decoder = Decoder::<MAX_FRAME>::new();
    while !outbox.drain(Duration::ZERO) {
        let frame = outbox.take().expect("a frame waits");
        outbox.written();
        let mut bytes = &frame[..];
        while let Some(outcome) = decoder.next::<ToHost<'_>>(&mut bytes) {
            if let ToHost::Code(code) = outcome.expect("a sound frame").message {
                assert_eq!(code.window as usize, codes.len());
                codes.push(code.flags);
            }
        }
    }
    let stats = board.stats();
    Seen { codes, stats }
}

/// Windows that hold any of these samples.
fn windows_of(samples: std::ops::Range<u64>) -> Vec<usize> {
    let windows = (0..31).zip((0..).step_by(HOP));
    windows
        .filter(|(_, begin)| {
            *begin < samples.end + BEFORE && samples.start + BEFORE < begin + WINDOW
        })
        .map(|(window, _)| window)
        .collect()
}

/// Sample 500 is neither the first nor the last of a hop.
const AT: &str = "0.9765625s";
const FROM: u64 = 500;

#[test]
fn without_a_fault_nothing_is_flagged() {
    let seen = seen(&[]);
    assert_eq!(seen.codes.len(), 31);
    for flag in [BAD, Flags::OVERRUN, Flags::LEAD_OFF] {
        assert_eq!(seen.with(flag), []);
    }
    assert_eq!((seen.stats.adc_status_bad, seen.stats.overruns), (0, 0));
    assert_eq!(seen.stats.samples, 1024);
}

#[test]
fn a_fault_of_a_frame_is_flagged_in_the_first_window_that_holds_it_and_not_before() {
    for kind in ["dead", "stuck", "wrong-status", "shifted-bit"] {
        for chip in [1, 4, 7] {
            let seen = seen(&[&format!("{kind}@{AT}:chip{chip}")]);
            assert_eq!(seen.with(BAD), windows_of(FROM..1024), "{kind} {chip}");
            assert_eq!(seen.with(Flags::OVERRUN), [], "{kind} {chip}");
            assert_eq!(
                u64::from(seen.stats.adc_status_bad),
                1024 - FROM,
                "{kind} {chip}"
            );
        }
    }
}

#[test]
fn a_fault_of_one_sample_is_flagged_in_the_windows_that_hold_it_wherever_it_stands() {
    for at in 508..=516_u32 {
        let times = [at, at + 1].map(|sample| f64::from(sample) / 512.0);
        let seen = seen(&[&format!("wrong-status@{}s..{}s:chip2", times[0], times[1])]);
        let at = at.into();
        assert_eq!(seen.with(BAD), windows_of(at..at + 1), "sample {at}");
        assert_eq!(seen.stats.adc_status_bad, 1);
    }
}

#[test]
fn a_chip_that_is_mended_is_flagged_until_the_last_window_that_holds_it() {
    // 48 samples.
    let seen = seen(&[&format!("dead@{AT}..1.0703125s:chip3")]);
    assert_eq!(seen.with(BAD), windows_of(FROM..FROM + 48));
    assert_eq!(seen.stats.adc_status_bad, 48);
}

#[test]
fn chip_0_dies_and_with_it_drdy_and_the_samples_go_on_flagged() {
    let seen = seen(&[&format!("dead@{AT}:chip0")]);
    // Three samples went by before the silence was taken for one.
    assert_eq!(seen.stats.overruns, 3);
    assert_eq!(seen.stats.samples, 1024 - 3);
    assert_eq!(seen.with(BAD), windows_of(FROM..1021));
    assert_eq!(seen.with(Flags::OVERRUN), windows_of(FROM..FROM + 1));
}

#[test]
fn a_missed_edge_is_an_overrun_and_nothing_else() {
    let seen = seen(&[&format!("missed-drdy@{AT}:chip0")]);
    assert_eq!(seen.with(Flags::OVERRUN), windows_of(FROM..FROM + 1));
    assert_eq!(seen.with(BAD), []);
    assert_eq!((seen.stats.overruns, seen.stats.samples), (1, 1023));
}

#[test]
fn a_doubled_rate_is_flagged_with_its_first_early_sample() {
    let seen = seen(&[&format!("double-rate@{AT}:chip0")]);
    // A conversion had begun at the old rate. Twice as many samples make twice as many windows.
    let first = windows_of(FROM + 1..FROM + 2)[0];
    let expected: Vec<usize> = (first..seen.codes.len()).collect();
    assert_eq!(seen.with(BAD), expected);
    assert_eq!(seen.stats.samples, 1024 + (1024 - FROM - 1));
    assert_eq!(u64::from(seen.stats.adc_status_bad), 2 * (1024 - FROM - 1));
}

#[test]
fn an_electrode_that_comes_off_is_flagged_as_such() {
    let label = model::LABELS.split(' ').next_back().expect("a label");
    let seen = seen(&[&format!("lead-off@{AT}..1.0703125s:{label}")]);
    assert_eq!(seen.with(Flags::LEAD_OFF), windows_of(FROM..FROM + 48));
    assert_eq!(seen.with(BAD), []);
    // Nothing drains its current: it stands at the rail.
    assert_eq!(seen.with(Flags::SATURATED), windows_of(FROM..FROM + 48));
}

#[test]
fn a_chip_that_was_never_right_is_flagged_in_every_code() {
    for kind in ["wrong-id", "forgets", "dead"] {
        let seen = seen(&[&format!("{kind}:chip5")]);
        assert_eq!(seen.with(BAD), (0..31).collect::<Vec<_>>(), "{kind}");
        let (board, _) = board(&[&format!("{kind}:chip5")]);
        let failure = board
            .converters()
            .failure()
            .expect("a chip that is not right");
        assert_eq!(failure.chip(), Some(5), "{failure}");
        assert_eq!(board.converters().sampler().counters().errors[4], 0);
    }
}

#[test]
fn the_self_test_runs_on_the_virtual_board_and_the_codes_go_on() {
    let (mut sound, _) = board(&[]);
    let report = sound.self_test();
    assert_eq!(report.check(), Ok(()));
    assert!(report.chips.iter().all(|chip| chip.id == ID));

    let (mut broken, _) = board(&["dead@0.1s:chip6"]);
    for index in 0..100 {
        broken.sample(&Sample::default(), index * 1_953);
    }
    assert_eq!(
        broken.self_test().check(),
        Err(Finding::Chain(Error::WrongId { chip: 6, read: 0 }))
    );
    let before = broken.stats();
    for index in 100..200 {
        broken.sample(&Sample::default(), index * 1_953);
    }
    let after = broken.stats();
    assert_eq!(after.samples - before.samples, 100);
    assert_eq!(after.adc_status_bad - before.adc_status_bad, 100);
    assert_eq!(after.overruns, 0);
}
