//! A fault of the converters is flagged in exactly the codes whose windows contain samples with the
//! fault.

use ads1299::{Error, Finding, ID};
use host_sim::{
    Fault, Faults, Identity, Outbox, VirtualBoard, WhenFull,
    synthetic::{Generator, SyntheticSpec},
};
use link::{Flags, Start, Stats, Streams, ToHost};
use pipeline::{Mains, Sample};

use crate::program::frames;

const BAD: Flags = Flags::ADC_STATUS_BAD;

/// Samples per hop at 512 Hz.
const HOP: usize = 32;
/// Samples per window at 512 Hz.
const WINDOW: u64 = 64;
/// A step includes the flags of its own sample and of this many samples before it. At 512 Hz, every
/// fourth sample, starting with the first, makes a step.
const BEFORE: u64 = 3;

/// Flags of every code, and the board's counters at the end.
struct Observed {
    codes: Vec<Flags>,
    stats: Stats,
}

/// Returns the indices of the windows whose codes have `flag`.
fn windows_with(codes: &[Flags], flag: Flags) -> Vec<usize> {
    let flagged = codes.iter().enumerate().filter(|(_, flags)| flags.contains(flag));
    flagged.map(|(window, _)| window).collect()
}

fn board(faults: &[&str]) -> (VirtualBoard, Outbox) {
    let faults: Vec<Fault> = faults.iter().map(|f| f.parse().expect("a fault")).collect();
    let faults = Faults::new(&faults).expect("one by one");
    let outbox = Outbox::new(WhenFull::Wait);
    let identity = Identity::default();
    let mut board = VirtualBoard::with_faults(identity, Mains::Hz50, faults, outbox.clone());
    let start = Start { streams: Streams::CODES, mains_hz: 0 };
    board.start(start, 0);
    (board, outbox)
}

/// Runs a board with these faults for two seconds of EEG.
fn observe(faults: &[&str]) -> Observed {
    let (mut board, outbox) = board(faults);
    let spec = SyntheticSpec::new(1, model::LABELS.split(' '));
    let generator = Generator::new(&spec).expect("the default specification");
    for (index, counts) in (0..1024).zip(generator) {
        board.process_sample(&Sample { counts }, index * 1_000_000 / 512);
    }
    let codes = frames(&outbox.take_all().concat(), |frame| match frame.message {
        ToHost::Code(code) => Some((code.window as usize, code.flags)),
        _ => None,
    });
    assert!(codes.iter().map(|(window, _)| *window).eq(0..codes.len()));
    let codes = codes.into_iter().map(|(_, flags)| flags).collect();
    let stats = board.stats();
    Observed { codes, stats }
}

/// Returns the indices of the windows (0 to 30) whose steps include the flags of any of `samples`.
fn windows_of(samples: std::ops::Range<u64>) -> Vec<usize> {
    if samples.is_empty() {
        return Vec::new();
    }
    let windows = (0..31).zip((0..).step_by(HOP));
    windows
        .filter(|(_, start)| {
            *start < samples.end + BEFORE && samples.start + BEFORE < start + WINDOW
        })
        .map(|(window, _)| window)
        .collect()
}

/// Time of sample [`FROM`], the first faulty one: 500 / 512 s.
const AT: &str = "0.9765625s";
/// First faulty sample. It is neither the first nor the last sample of a hop.
const FROM: u64 = 500;

#[test]
fn a_fault_is_flagged_in_exactly_the_windows_that_contain_it() {
    let (none, first) = (0..0, FROM..FROM + 1);
    let mut cases = vec![
        // Each case has four parts: the fault, the range of samples with a bad status, the range of
        // samples that follow missed ones, and the number of samples.
        (String::new(), none.clone(), none.clone(), 1024),
        // 1.0703125 s is the time of sample 548, at which the chip is repaired.
        (format!("dead@{AT}..1.0703125s:chip3"), FROM..FROM + 48, none.clone(), 1024),
        // The driver misses three samples before it detects that there are no DRDY edges.
        (format!("dead@{AT}:chip0"), FROM..1024 - 3, first.clone(), 1024 - 3),
        (format!("missed-drdy@{AT}:chip0"), none.clone(), first, 1024 - 1),
    ];
    for kind in ["dead", "stuck", "wrong-status", "shifted-bit"] {
        for chip in [1, 4, 7] {
            let fault = format!("{kind}@{AT}:chip{chip}");
            cases.push((fault, FROM..1024, none.clone(), 1024));
        }
    }
    for sample in 508..=516_u32 {
        let [from, to] = [sample, sample + 1].map(|sample| f64::from(sample) / 512.0);
        let fault = format!("wrong-status@{from}s..{to}s:chip2");
        let sample = u64::from(sample);
        cases.push((fault, sample..sample + 1, none.clone(), 1024));
    }
    for (fault, bad, overrun, samples) in cases {
        let faults = Some(&fault[..]).filter(|fault| !fault.is_empty());
        let Observed { codes, stats } = &observe(faults.as_slice());
        for (flag, flagged) in
            [(BAD, bad.clone()), (Flags::OVERRUN, overrun), (Flags::LEAD_OFF, none.clone())]
        {
            assert_eq!(windows_with(codes, flag), windows_of(flagged), "{fault}");
        }
        let counts = (stats.samples, stats.overruns, stats.adc_status_bad);
        let missed = u32::try_from(1024 - samples).expect("few");
        let bad = u32::try_from(bad.count()).expect("few");
        assert_eq!(counts, (samples, missed, bad), "{fault}");
    }
}

#[test]
fn a_doubled_rate_is_flagged_with_its_first_early_sample() {
    let observed = observe(&[&format!("double-rate@{AT}:chip0")]);
    // The conversion in progress ends at the old rate, so the first early sample is FROM + 1. From
    // there on, twice as many samples make twice as many windows.
    let first = windows_of(FROM + 1..FROM + 2)[0];
    let expected: Vec<usize> = (first..observed.codes.len()).collect();
    assert_eq!(windows_with(&observed.codes, BAD), expected);
    assert_eq!(observed.stats.samples, 1024 + (1024 - FROM - 1));
    assert_eq!(u64::from(observed.stats.adc_status_bad), 2 * (1024 - FROM - 1));
}

#[test]
fn an_electrode_that_is_off_is_flagged_and_substituted() {
    let label = model::LABELS.split(' ').next_back().expect("a label");
    let observed = observe(&[&format!("lead-off@{AT}..1.0703125s:{label}")]);
    assert_eq!(windows_with(&observed.codes, Flags::LEAD_OFF), windows_of(FROM..FROM + 48));
    assert_eq!(windows_with(&observed.codes, BAD), [0; 0]);
    // The lead-off current has no path through the electrode, so the input goes to the rail. The
    // electrode stays interpolated from the others until it has been good for 10 s, and the run
    // ends before that.
    assert_eq!(windows_with(&observed.codes, Flags::SUBSTITUTED), windows_of(FROM..1024));
    assert_eq!(windows_with(&observed.codes, Flags::SATURATED), [0; 0]);
}

#[test]
fn a_chip_with_a_fault_from_power_on_is_flagged_in_every_code() {
    for kind in ["wrong-id", "forgets", "dead"] {
        let observed = observe(&[&format!("{kind}:chip5")]);
        assert_eq!(windows_with(&observed.codes, BAD), (0..31).collect::<Vec<_>>(), "{kind}");
        let (board, _) = board(&[&format!("{kind}:chip5")]);
        let failure = board.converters().failure().expect("a chip with a fault");
        assert_eq!(failure.chip(), Some(5), "{failure}");
        assert_eq!(board.converters().sampler().counters().errors[4], 0);
    }
}

#[test]
fn the_virtual_board_runs_the_self_test_and_then_continues() {
    let (mut sound, _) = board(&[]);
    let report = sound.run_self_test();
    assert_eq!(report.check(), Ok(()));
    assert!(report.chips.iter().all(|chip| chip.id == ID));

    let (mut broken, _) = board(&["dead@0.1s:chip6"]);
    for index in 0..100 {
        broken.process_sample(&Sample::default(), index * 1_953);
    }
    assert_eq!(
        broken.run_self_test().check(),
        Err(Finding::Chain(Error::WrongId { chip: 6, read: 0 }))
    );
    let before = broken.stats();
    for index in 100..200 {
        broken.process_sample(&Sample::default(), index * 1_953);
    }
    let after = broken.stats();
    assert_eq!(after.samples - before.samples, 100);
    assert_eq!(after.adc_status_bad - before.adc_status_bad, 100);
    assert_eq!(after.overruns, 0);
}
