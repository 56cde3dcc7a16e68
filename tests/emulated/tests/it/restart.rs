//! Scenario with a host that changes the streams, resets the board and starts it again: each run
//! starts at window 0, and a refused command has no effect.

use emulated::board::boards;
use emulated::frames::{self, Boot};
use emulated::input::Input;
use emulated::script::{self, Script, start};
use link::{Ack, AckResult, ResetCause, ResetInto, Streams, ToDevice, ToHost};
use serde_json::json;

/// Duration of the samples of the scenario, seconds.
const SECONDS: usize = 3;

/// Time from an accepted `Reset` command to the reset, microseconds, in which the board sends its
/// waiting frames.
const DRAIN_US: u64 = 100_000;
/// Largest delay of the reset beyond [`DRAIN_US`], microseconds: the time until the next alarm of
/// the board's clock.
const ALARM_US: u64 = 5_000;

/// Host time in the command `SyncTime`, microseconds; the board must return it unchanged.
const HOST_US: u64 = 1 << 50;

/// Device times in the first boot at which the host sends `Start` with filtered steps, and `Reset`,
/// microseconds.
const STEPS_US: u64 = 800_000;
const RESET_US: u64 = 1_300_000;

/// Returns the commands for two boots, with the results that the board must return.
fn script() -> Script {
    let mut script = Script::default();
    let mut add = |boot, at_us, command, result| script.add_command(boot, at_us, &command, result);
    let (done, bad) = (AckResult::Done, AckResult::BadArgument);
    let not_here = AckResult::NotSupported;
    let codes = start(Streams::CODES, 0);
    let steps = Streams::from_bits(Streams::CODES.bits() | Streams::FILTERED.bits());
    let clock = ToDevice::SyncTime { host_time_us: HOST_US };
    add(1, 200_000, codes, done);
    add(1, 600_000, ToDevice::SelfTest, not_here);
    add(1, 610_000, ToDevice::Reset(ResetInto::Bootloader), not_here);
    add(1, 620_000, ToDevice::Reset(ResetInto::Newer(7)), bad);
    add(1, 630_000, clock, done);
    add(1, STEPS_US, start(steps, 0), done);
    add(1, RESET_US, ToDevice::Reset(ResetInto::Firmware), done);
    add(2, 200_000, codes, done);
    add(2, 900_000, ToDevice::Stop, done);
    script
}

#[test]
fn each_run_starts_at_window_0_and_refused_commands_change_nothing() {
    let input = Input::from_environment();
    let script = script();
    for board in boards("restart", input.first_seconds(SECONDS)) {
        board.write(script::FILE, &script.file);
        let sent = board.run(&["commands"], "uart").sent;
        let boots = Boot::split(&sent);
        let answers: Vec<Ack> = boots.iter().flat_map(|boot| boot.acks.clone()).collect();
        let codes = boots.iter().flat_map(Boot::codes);
        let windows: Vec<u32> = codes.map(|code| code.window).collect();
        // Windows of a run are consecutive, so a missing window would split its run into two.
        let runs: Vec<&[u32]> = windows.chunk_by(|before, after| before + 1 == *after).collect();
        let codes: Vec<usize> = runs.iter().map(|run| run.len()).collect();
        board.record(&json!({"restart": {"codes": codes, "answers": answers.len()}}));
        let starts: Vec<u32> = runs.iter().map(|run| run[0]).collect();
        assert_eq!(starts, [0; 3], "the first window of each run");
        check_steps(&sent);
        assert_eq!(answers, script.answers, "answers");
        check_boots(&boots);
    }
}

/// Checks that filtered steps are sent only in the run that requests them, from step 0 and without
/// a gap.
fn check_steps(sent: &[u8]) {
    let steps = frames::filter_map(sent, |header, message| match message {
        ToHost::Filtered(steps) => Some((header.device_time_us, steps.first_step)),
        _ => None,
    });
    let due = (0..).step_by(link::FILTERED_STEPS);
    let is_whole = due.zip(&steps).all(|(due, (_, step))| due == *step);
    let run = STEPS_US..RESET_US + DRAIN_US + ALARM_US;
    assert!(
        !steps.is_empty() && is_whole && steps.iter().all(|(at_us, _)| run.contains(at_us)),
        "steps from 0 between {run:?} us expected, with their times: {steps:?}"
    );
}

fn check_boots(boots: &[Boot]) {
    let [first, second] = boots else {
        panic!("{} boots, 2 expected", boots.len());
    };
    for (boot, cause) in [(first, ResetCause::PowerOn), (second, ResetCause::Software)] {
        assert_eq!(boot.hellos, [(cause, String::new())], "causes and faults in Hello");
        assert_eq!(boot.missing, 0, "missing frames");
        assert_eq!(boot.damaged, [], "damaged frames");
    }
    let drained_us = first.latest_us - first.last_ack_us;
    assert!(
        drained_us > 0 && drained_us < DRAIN_US + ALARM_US,
        "the last frame before the reset is {drained_us} us after the answer to it"
    );
    let readings = boots.iter().flat_map(|boot| &boot.clock_readings);
    let clocks: Vec<u64> = readings.map(|(_, reading)| reading.host_time_us).collect();
    assert_eq!(clocks, [HOST_US], "readings of the clock");
    let last = second.stats.last().map(|stats| stats.streams);
    assert_eq!(last, Some(Streams::empty()), "streams after Stop");
}
