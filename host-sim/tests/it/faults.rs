//! Each fault of the converters is flagged in the first code whose window contains the fault, and
//! in no earlier code.

use ads1299::{Error, Finding, ID};
use host_sim::{
    Fault, Faults, Identity, Outbox, VirtualBoard, WhenFull,
    synthetic::{Generator, SyntheticSpec},
};
use link::{Flags, Start, Stats, Streams, ToHost};
use pipeline::{Mains, Sample};

use crate::host::frames;

const BAD: Flags = Flags::ADC_STATUS_BAD;

const NO_WINDOW: [usize; 0] = [];

/// Samples per hop at 512 Hz.
const HOP: usize = 32;
/// Samples per window at 512 Hz.
const WINDOW: u64 = 64;
/// Number of samples before a step's own sample whose flags the step includes. At 512 Hz, every
/// fourth sample, starting with the first, makes a step.
const BEFORE: u64 = 3;

/// Flags of every code, and the board's counters at the end.
struct Observed {
    codes: Vec<Flags>,
    stats: Stats,
}

impl Observed {
    /// Returns the indices of the windows whose codes have `flag`.
    fn windows_with(&self, flag: Flags) -> Vec<usize> {
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
    let identity = Identity::default();
    let mut board = VirtualBoard::with_faults(identity, Mains::Hz50, faults, outbox.clone());
    let start = Start {
        streams: Streams::CODES,
        mains_hz: 0,
    };
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
    let windows = (0..31).zip((0..).step_by(HOP));
    windows
        .filter(|(_, start)| {
            *start < samples.end + BEFORE && samples.start + BEFORE < start + WINDOW
        })
        .map(|(window, _)| window)
        .collect()
}

/// Time of sample [`FROM`]: 500 / 512 s.
const AT: &str = "0.9765625s";
/// First faulty sample. It is neither the first nor the last sample of a hop.
const FROM: u64 = 500;

#[test]
fn without_a_fault_nothing_is_flagged() {
    let observed = observe(&[]);
    assert_eq!(observed.codes.len(), 31);
    for flag in [BAD, Flags::OVERRUN, Flags::LEAD_OFF] {
        assert_eq!(observed.windows_with(flag), NO_WINDOW);
    }
    assert_eq!(
        (observed.stats.adc_status_bad, observed.stats.overruns),
        (0, 0)
    );
    assert_eq!(observed.stats.samples, 1024);
}

#[test]
fn a_lasting_fault_is_flagged_from_the_first_window_that_contains_it() {
    for kind in ["dead", "stuck", "wrong-status", "shifted-bit"] {
        for chip in [1, 4, 7] {
            let observed = observe(&[&format!("{kind}@{AT}:chip{chip}")]);
            assert_eq!(
                observed.windows_with(BAD),
                windows_of(FROM..1024),
                "{kind} {chip}"
            );
            assert_eq!(
                observed.windows_with(Flags::OVERRUN),
                NO_WINDOW,
                "{kind} {chip}"
            );
            assert_eq!(
                u64::from(observed.stats.adc_status_bad),
                1024 - FROM,
                "{kind} {chip}"
            );
        }
    }
}

#[test]
fn a_fault_of_one_sample_is_flagged_in_exactly_the_windows_that_contain_it() {
    for at in 508..=516_u32 {
        let times = [at, at + 1].map(|sample| f64::from(sample) / 512.0);
        let observed = observe(&[&format!("wrong-status@{}s..{}s:chip2", times[0], times[1])]);
        let at = at.into();
        assert_eq!(
            observed.windows_with(BAD),
            windows_of(at..at + 1),
            "sample {at}"
        );
        assert_eq!(observed.stats.adc_status_bad, 1);
    }
}

#[test]
fn a_repaired_chip_is_flagged_up_to_the_last_window_that_contains_the_fault() {
    // 1.0703125 s is the time of sample 548, so the fault lasts 48 samples.
    let observed = observe(&[&format!("dead@{AT}..1.0703125s:chip3")]);
    assert_eq!(observed.windows_with(BAD), windows_of(FROM..FROM + 48));
    assert_eq!(observed.stats.adc_status_bad, 48);
}

#[test]
fn without_chip_0_and_its_drdy_the_samples_continue_with_flags() {
    let observed = observe(&[&format!("dead@{AT}:chip0")]);
    // The driver misses three samples before it detects that DRDY is silent.
    assert_eq!(observed.stats.overruns, 3);
    assert_eq!(observed.stats.samples, 1024 - 3);
    assert_eq!(observed.windows_with(BAD), windows_of(FROM..1021));
    assert_eq!(
        observed.windows_with(Flags::OVERRUN),
        windows_of(FROM..FROM + 1)
    );
}

#[test]
fn a_missed_edge_is_an_overrun_and_nothing_else() {
    let observed = observe(&[&format!("missed-drdy@{AT}:chip0")]);
    assert_eq!(
        observed.windows_with(Flags::OVERRUN),
        windows_of(FROM..FROM + 1)
    );
    assert_eq!(observed.windows_with(BAD), NO_WINDOW);
    assert_eq!((observed.stats.overruns, observed.stats.samples), (1, 1023));
}

#[test]
fn a_doubled_rate_is_flagged_with_its_first_early_sample() {
    let observed = observe(&[&format!("double-rate@{AT}:chip0")]);
    // The conversion in progress ends at the old rate, so the first early sample is FROM + 1. From
    // there on, twice as many samples make twice as many windows.
    let first = windows_of(FROM + 1..FROM + 2)[0];
    let expected: Vec<usize> = (first..observed.codes.len()).collect();
    assert_eq!(observed.windows_with(BAD), expected);
    assert_eq!(observed.stats.samples, 1024 + (1024 - FROM - 1));
    assert_eq!(
        u64::from(observed.stats.adc_status_bad),
        2 * (1024 - FROM - 1)
    );
}

#[test]
fn an_electrode_that_is_off_is_flagged_and_saturates() {
    let label = model::LABELS.split(' ').next_back().expect("a label");
    let observed = observe(&[&format!("lead-off@{AT}..1.0703125s:{label}")]);
    assert_eq!(
        observed.windows_with(Flags::LEAD_OFF),
        windows_of(FROM..FROM + 48)
    );
    assert_eq!(observed.windows_with(BAD), NO_WINDOW);
    // The lead-off current has no path through the electrode, so the input goes to the rail.
    assert_eq!(
        observed.windows_with(Flags::SATURATED),
        windows_of(FROM..FROM + 48)
    );
}

#[test]
fn a_chip_with_a_fault_from_power_on_is_flagged_in_every_code() {
    for kind in ["wrong-id", "forgets", "dead"] {
        let observed = observe(&[&format!("{kind}:chip5")]);
        assert_eq!(
            observed.windows_with(BAD),
            (0..31).collect::<Vec<_>>(),
            "{kind}"
        );
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
