//! A host that changes the streams, resets the board and starts it again: each run starts at window 0, and a
//! refused command changes nothing.
#![forbid(unsafe_code)]

use emulated::board::{APPLICATION, boards};
use emulated::frames::{self, Boot};
use emulated::input::Input;
use emulated::script::{self, Script};
use link::{Ack, AckResult, ResetCause, ResetInto, Start, Streams, ToDevice, ToHost};
use serde_json::json;

const TEST: &str = "starts and resets";

/// Duration of the samples in seconds.
const SECONDS: usize = 3;

/// Time from an accepted `Reset` to the reset in microseconds, in which waiting frames are sent.
const DRAIN_US: u64 = 100_000;
/// Largest delay of the reset in microseconds, up to the next alarm of the board's clock.
const ALARM_US: u64 = 5_000;

/// Host's clock in `SyncTime`, in microseconds; the board returns it unchanged.
const HOST_US: u64 = 1 << 50;

/// Commands for the first boot and for the second: device time in microseconds, command, answer.
const COMMANDS: [&[(u64, ToDevice, AckResult)]; 2] = [
    &[
        (200_000, START_CODES, AckResult::Done),
        (600_000, ToDevice::SelfTest, AckResult::NotSupported),
        (610_000, RESET_TO_LOADER, AckResult::NotSupported),
        (620_000, RESET_UNKNOWN, AckResult::BadArgument),
        (630_000, SYNC_TIME, AckResult::Done),
        (800_000, START_CODES_AND_STEPS, AckResult::Done),
        (1_300_000, RESET, AckResult::Done),
    ],
    &[
        (200_000, START_CODES, AckResult::Done),
        (900_000, ToDevice::Stop, AckResult::Done),
    ],
];

const START_CODES: ToDevice = start(Streams::CODES);
const START_CODES_AND_STEPS: ToDevice = start(Streams::from_bits(
    Streams::CODES.bits() | Streams::FILTERED.bits(),
));
const RESET: ToDevice = ToDevice::Reset(ResetInto::Firmware);
const RESET_TO_LOADER: ToDevice = ToDevice::Reset(ResetInto::Bootloader);
const RESET_UNKNOWN: ToDevice = ToDevice::Reset(ResetInto::Newer(7));
const SYNC_TIME: ToDevice = ToDevice::SyncTime {
    host_time_us: HOST_US,
};

const fn start(streams: Streams) -> ToDevice {
    ToDevice::Start(Start {
        streams,
        mains_hz: 0,
    })
}

#[test]
fn each_run_starts_at_window_0_and_refused_commands_change_nothing() {
    let input = Input::from_environment();
    let script = script();
    for board in boards(TEST, APPLICATION) {
        let scenario = board.scenario("restart", input.first_seconds(SECONDS));
        scenario.write(script::FILE, &script.file);
        let sent = scenario.run(&["commands"], "uart").sent;
        let codes: Vec<usize> = runs(&sent).iter().map(|run| run.windows.len()).collect();
        let answers: usize = Boot::split(&sent).iter().map(|boot| boot.acks.len()).sum();
        board.record(&json!({"restart": {"codes": codes, "answers": answers}}));
        check(&sent, &script.answers);
    }
}

fn script() -> Script {
    let mut script = Script::default();
    for (boot, commands) in (1..).zip(COMMANDS) {
        for (at_us, command, result) in commands {
            script.add_command(boot, *at_us, command, *result);
        }
    }
    script
}

fn check(sent: &[u8], expected: &[Ack]) {
    let boots = Boot::split(sent);
    let [first, second] = &boots[..] else {
        panic!("{} boots, 2 expected", boots.len());
    };
    for (boot, cause) in [(first, ResetCause::PowerOn), (second, ResetCause::Software)] {
        let causes: Vec<_> = boot
            .hellos
            .iter()
            .map(|hello| (hello.cause, &hello.fault[..]))
            .collect();
        assert_eq!(causes, [(cause, "")], "causes and faults in Hello");
        assert_eq!(
            (boot.missing, boot.damaged),
            (0, 0),
            "missing and damaged frames"
        );
    }
    let acks = [&first.acks[..], &second.acks].concat();
    assert_eq!(acks, expected, "answers");
    let drained_us = first.latest_us - first.last_ack_us;
    assert!(
        drained_us > 0 && drained_us < DRAIN_US + ALARM_US,
        "the last frame before the reset is {drained_us} us after the answer to it"
    );
    let readings = boots.iter().flat_map(|boot| &boot.clock_readings);
    let clocks: Vec<u64> = readings.map(|(_, reading)| reading.host_time_us).collect();
    assert_eq!(clocks, [HOST_US], "readings of the clock");
    let runs = runs(sent);
    assert!(
        runs.len() == 3 && runs.iter().all(Run::is_whole),
        "three runs that start at 0 expected: {runs:?}"
    );
    let with_steps: Vec<bool> = runs.iter().map(|run| !run.steps.is_empty()).collect();
    assert_eq!(with_steps, [false, true, false], "runs with filtered steps");
    assert!(
        second
            .stats
            .last()
            .is_some_and(|stats| stats.streams.is_empty()),
        "streams after Stop: {:?}",
        second.stats.last()
    );
}

/// Indices of the windows and filtered steps from one start to the next.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
struct Run {
    windows: Vec<u32>,
    /// First step of each frame of filtered steps.
    steps: Vec<u64>,
}

impl Run {
    /// Returns whether there are windows, and whether windows and steps start at 0 and have no gap.
    fn is_whole(&self) -> bool {
        let steps = (0..).step_by(link::FILTERED_STEPS);
        !self.windows.is_empty()
            && (0..).zip(&self.windows).all(|(due, window)| due == *window)
            && steps.zip(&self.steps).all(|(due, step)| due == *step)
    }
}

/// Splits the outputs of all boots into runs. A run starts with window 0, or with step 0 where it has steps.
fn runs(sent: &[u8]) -> Vec<Run> {
    let mut runs: Vec<Run> = vec![Run::default()];
    frames::for_each(sent, |_, message| {
        let is_first = match message {
            ToHost::Code(code) => code.window == 0,
            ToHost::Filtered(steps) => steps.first_step == 0,
            _ => return,
        };
        if is_first && runs.last().is_some_and(|run| !run.windows.is_empty()) {
            runs.push(Run::default());
        }
        let run = runs.last_mut().expect("there is always one");
        match message {
            ToHost::Code(code) => run.windows.push(code.window),
            ToHost::Filtered(steps) => run.steps.push(steps.first_step),
            _ => {}
        }
    });
    runs
}

mod checks {
    use emulated::refusal;
    use link::{Code, Encoder, MAX_FRAME};

    use super::*;

    type Frames = Vec<(u64, ToHost<'static>)>;

    /// Messages of a correct board in both boots, with their device times in microseconds.
    fn boots() -> [Frames; 2] {
        let answers = script().answers;
        let hello = |reset_cause| {
            let hello = link::Hello {
                firmware: "",
                board: "",
                chip_uid: [0; 12],
                model_id: model::MODEL_ID,
                session_id: 1,
                reset_cause,
                fault: "",
            };
            (10, ToHost::Hello(hello))
        };
        let ack = |index: usize| (COMMANDS.concat()[index].0, ToHost::Ack(answers[index]));
        let steps = |at_us, first_step| {
            let filtered = link::Filtered {
                first_step,
                electrodes: 1,
                fraction_bits: 5,
                flags: link::Flags::empty(),
                values: &[],
            };
            (at_us, ToHost::Filtered(filtered))
        };
        let reading = link::ClockReading {
            host_time_us: HOST_US,
            received_us: 630_010,
        };
        let first = vec![
            hello(ResetCause::PowerOn),
            ack(0),
            code(350_000, 0),
            code(410_000, 1),
            ack(1),
            ack(2),
            ack(3),
            (630_020, ToHost::ClockReading(reading)),
            ack(4),
            ack(5),
            steps(840_000, 0),
            steps(870_000, 4),
            code(930_000, 0),
            code(990_000, 1),
            ack(6),
            code(1_350_000, 2),
        ];
        let second = vec![
            hello(ResetCause::Software),
            ack(7),
            code(350_000, 0),
            (900_000, ToHost::Stats(link::Stats::default())),
            ack(8),
        ];
        [first, second]
    }

    fn code(at_us: u64, window: u32) -> (u64, ToHost<'static>) {
        let code = Code {
            model_id: model::MODEL_ID,
            window,
            first_sample: 0,
            flags: link::Flags::empty(),
            clipped: 0,
            clipped_values: 0,
            saturated: 0,
            values: link::CodeValues::Int8([0; link::CODE_LEN]),
        };
        (at_us, ToHost::Code(code))
    }

    /// Checks a board that sends the frames of a correct one, after `change`.
    fn check_changed(change: impl FnOnce(&mut [Frames; 2])) {
        let mut boots = boots();
        change(&mut boots);
        let mut sent = Vec::new();
        for boot in &boots {
            let mut encoder = Encoder::starting_at(0);
            for (at_us, message) in boot {
                let mut buffer = [0; MAX_FRAME];
                let frame = encoder.encode(*at_us, message, &mut buffer);
                sent.extend(frame.expect("a frame"));
            }
        }
        check(&sent, &script().answers);
    }

    fn assert_refused(words: &str, change: impl FnOnce(&mut [Frames; 2])) {
        refusal::assert_refused(words, || check_changed(change));
    }

    #[test]
    fn a_board_that_does_not_reset_or_continues_the_run_before_is_refused() {
        check_changed(|_| ());
        assert_refused("1 boots, 2 expected", |boots| boots[1].clear());
        assert_refused("causes and faults in Hello", |boots| {
            boots[1][0] = boots[0][0].clone();
        });
        assert_refused("three runs that start at 0", |boots| {
            boots[0][12] = code(930_000, 2);
        });
        assert_refused("answers", |boots| boots[0][5] = boots[0][4].clone());
        assert_refused("150000 us after the answer", |boots| {
            boots[0][15].0 += DRAIN_US;
        });
        assert_refused("is 0 us after the answer", |boots| drop(boots[0].pop()));
    }
}
