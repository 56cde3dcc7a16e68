//! The statuses `clock`, `converters`, `signal quality` and `timing` of `/diagnostics`, and the
//! worst stage in the summary.

use link::{Converters, ElectrodeQuality, Quality, Stage, StageTiming, Timing, ToHost};
use neuro_ros::{DiagnosticLevel, DiagnosticStatus};

use crate::board::{Board, electrode};
use crate::recorder::{Harness, SETTINGS, state, value};

/// Sends a report about two chips without faults, modified by `change`, and returns the status
/// `converters` that results.
fn report_status(harness: &mut Harness, change: impl FnOnce(&mut Converters)) -> DiagnosticStatus {
    let mut converters = Converters {
        fault: heapless::String::new(),
        drdy_millihertz: 512_010,
        off_positive: 0,
        off_negative: 0,
        frames_bad: [0, 0].into_iter().collect(),
    };
    change(&mut converters);
    harness.send(0, &ToHost::Converters(converters));
    harness.status("converters").unwrap()
}

#[test]
fn a_clock_more_than_1000_ppm_off_is_a_warning_once_it_is_measured() {
    let ok = DiagnosticLevel::Ok;
    let warn = DiagnosticLevel::Warn;
    for (device_hop_us, codes, level, part) in [
        (62_500, 320, ok, "+0.0 ppm"),
        (62_560, 320, ok, "-959.1 ppm"),
        (61_875, 320, warn, "10101 ppm slow"),
        (64_375, 320, warn, "29126 ppm fast"),
        (64_375, 32, ok, "-29126.2 ppm"),
    ] {
        let mut harness = Harness::streaming(SETTINGS, Board::new());
        for code in 1..=codes {
            harness.now_us += 62_500;
            let bytes = harness.board.code(code * device_hop_us, 1);
            harness.receive(&bytes);
        }
        let status = harness.status("clock").unwrap();
        assert_eq!(status.level, level, "{}", status.message);
        assert!(status.message.contains(part), "{}", status.message);
        let has_remedy = status.message.contains("set to 8.33 MHz");
        assert_eq!(has_remedy, level == warn, "{}", status.message);
    }
}

#[test]
fn chips_in_order_are_no_warning() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    let status = report_status(&mut harness, |_| {});
    assert_eq!(state(&status), (DiagnosticLevel::Ok, "2 chips convert"));
    assert_eq!(value(&status, "DRDY"), "512.010 Hz, +20 ppm off the 512 Hz that were set");
    assert_eq!(value(&status, "positive electrodes off"), "none");
    assert_eq!(value(&status, "chip 1: frames bad"), "0");
    let status = report_status(&mut harness, |converters| converters.drdy_millihertz = 0);
    assert_eq!(value(&status, "DRDY"), "not known");
}

#[test]
fn bad_frames_are_a_warning_that_names_the_chip_until_there_are_no_new_ones() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    let mut bad =
        |count| report_status(&mut harness, |converters| converters.frames_bad[1] = count);
    // Bad frames that the first report already contains do not count as new.
    assert_eq!(bad(2).level, DiagnosticLevel::Ok);
    let status = bad(5);
    let message = "frames bad since the last report: chip 1 (3)";
    assert_eq!(state(&status), (DiagnosticLevel::Warn, message));
    assert_eq!(bad(5).level, DiagnosticLevel::Ok);
    assert!(bad(10).message.ends_with("chip 1 (5)"));
    // Without a new message from the device, the warning is not repeated.
    let status = harness.status("converters").unwrap();
    assert_eq!(status.level, DiagnosticLevel::Ok);
}

#[test]
fn detached_electrodes_and_spare_channels_are_named() {
    let [first, second] = [0, 1].map(electrode);
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    let status = report_status(&mut harness, |converters| {
        converters.off_positive = 0b11;
        converters.off_negative = 1 | 1 << 63;
    });
    let message = format!("electrodes off: {first} {second} exg3");
    assert_eq!(state(&status), (DiagnosticLevel::Warn, &*message));
    let [positive, negative] = ["positive", "negative"]
        .map(|side| value(&status, &format!("{side} electrodes off")).to_owned());
    assert_eq!(positive, format!("{first} {second}"));
    assert_eq!(negative, format!("{first} exg3"));
}

#[test]
fn a_chain_that_does_not_run_is_an_error_until_it_runs() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    let fault = "chip 2: ID 0x00";
    let status = report_status(&mut harness, |converters| {
        converters.fault.push_str(fault).unwrap();
    });
    assert_eq!(state(&status), (DiagnosticLevel::Error, fault));
    let again = harness.status("converters").unwrap();
    assert_eq!(again.level, DiagnosticLevel::Error);
    let status = report_status(&mut harness, |_| {});
    assert_eq!(status.level, DiagnosticLevel::Ok);
    harness.reboot(0);
    let status = harness.status("converters");
    assert_eq!(status, None, "the report belongs to the previous boot");
}

const GOOD: ElectrodeQuality = ElectrodeQuality {
    rms_uv: 12.34,
    mains_uv: 20.0,
    mains_residual_uv: 0.125,
    samples_at_rail: 0,
    flat: false,
};

/// Returns a signal-quality report about 61 good electrodes, modified by `change`.
fn quality(change: impl FnOnce(&mut Quality)) -> ToHost<'static> {
    let mut quality = Quality {
        first_sample: 5120,
        settling: false,
        electrodes: core::iter::repeat_n(GOOD, 61).collect(),
    };
    change(&mut quality);
    ToHost::Quality(quality)
}

#[test]
fn electrodes_that_are_flat_at_the_rail_or_with_strong_mains_are_named() {
    let [first, third, fourth, last] = [0, 2, 3, 60].map(electrode);
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    let message = quality(|quality| {
        quality.electrodes[0].flat = true;
        quality.electrodes[2].samples_at_rail = 7;
        quality.electrodes[3].mains_uv = 100.5;
        quality.electrodes[60].mains_uv = 3000.0;
    });
    harness.send(0, &message);
    let faults = harness.core.electrode_faults();
    let status = harness.status("signal quality").unwrap();
    assert_eq!(faults.as_ref(), Some(&status.message));
    assert_eq!(status.level, DiagnosticLevel::Warn);
    assert_eq!(
        status.message,
        format!("flat: {first}; at the rail: {third}; mains above 100 uV: {fourth} {last}")
    );
    assert_eq!(status.values.len(), 61);
    assert!(status.hardware_id.starts_with("board "));
    let figures = |index: usize| value(&status, &electrode(index));
    let good = "rms 12.3 uV, mains 20.0 uV, 0.12 uV after the filters";
    assert_eq!(figures(1), good);
    assert!(figures(0).ends_with(", flat"));
    assert!(figures(2).ends_with(", 7 samples at the rail"));
}

#[test]
fn good_electrodes_are_no_warning_and_settling_is_reported() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    harness.send(0, &quality(|_| {}));
    assert_eq!(harness.core.electrode_faults(), None);
    let status = harness.status("signal quality").unwrap();
    assert_eq!(state(&status), (DiagnosticLevel::Ok, "61 electrodes in order"));
    let status =
        harness.status_after(&quality(|quality| quality.settling = true), "signal quality");
    assert_eq!(state(&status), (DiagnosticLevel::Ok, "the filters are settling"));
}

#[test]
fn impossible_figures_and_missing_labels_are_handled() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    let message = quality(|quality| {
        quality.electrodes[0].mains_uv = f32::NAN;
        quality.electrodes[1].mains_uv = f32::INFINITY;
        for _ in 61..64 {
            quality.electrodes.push(GOOD).unwrap();
        }
    });
    let status = harness.status_after(&message, "signal quality");
    assert_eq!(status.message, format!("mains above 100 uV: {}", electrode(1)));
    assert_eq!(status.values[63].key, "electrode 63");
    let none = quality(|quality| quality.electrodes.clear());
    let status = harness.status_after(&none, "signal quality");
    assert_eq!(status.values.len(), 0);
}

const ACQUIRE: StageTiming = StageTiming {
    stage: Stage::Acquire,
    deadline_ns: 1_953_125,
    worst_ns: 122_500,
    histogram: [512, 0, 0, 0, 0, 0, 0, 0, 0],
};

/// A stage whose worst time is its deadline; the worst time of `ACQUIRE` is far below its deadline.
const CODE: StageTiming = StageTiming {
    stage: Stage::Code,
    deadline_ns: 7_812_500,
    worst_ns: 7_812_500,
    histogram: [0, 9, 0, 0, 0, 0, 0, 1, 0],
};

/// Returns a timing report about two stages that met their deadlines and a stack of which 3/4 was
/// used, the most that causes no warning. `change` modifies the report.
fn timing(change: impl FnOnce(&mut Timing)) -> ToHost<'static> {
    let mut timing = Timing {
        stages: [ACQUIRE, CODE].into_iter().collect(),
        stack_used: 6144,
        stack_size: 8192,
    };
    change(&mut timing);
    ToHost::Timing(timing)
}

fn values(status: &DiagnosticStatus) -> Vec<(&str, &str)> {
    let values = status.values.iter();
    values.map(|pair| (&*pair.key, &*pair.value)).collect()
}

#[test]
fn stages_in_time_and_a_sufficient_stack_are_no_warning() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    let status = harness.status_after(&timing(|_| {}), "timing");
    assert_eq!(state(&status), (DiagnosticLevel::Ok, "2 stages within their deadlines"));
    assert!(status.hardware_id.starts_with("board "));
    assert_eq!(
        values(&status),
        [
            ("acquire", "worst 122.5 us of 1953.125 us"),
            ("acquire: times per eighth of it", "512 0 0 0 0 0 0 0, late 0"),
            ("code", "worst 7812.5 us of 7812.5 us"),
            ("code: times per eighth of it", "0 9 0 0 0 0 0 1, late 0"),
            ("stack", "6144 of 8192 bytes"),
        ]
    );
}

#[test]
fn a_stage_late_by_a_nanosecond_and_a_stack_more_than_three_quarters_full_are_named() {
    let late = timing(|timing| {
        timing.stages[1].worst_ns += 1;
        timing.stages[1].histogram[8] = 1;
        let newer = StageTiming {
            stage: Stage::Newer(9),
            deadline_ns: 1_000,
            worst_ns: 5_000,
            histogram: [0, 0, 0, 0, 0, 0, 0, 0, 3],
        };
        timing.stages.push(newer).unwrap();
    });
    let full = timing(|timing| timing.stack_used += 1);
    let both = timing(|timing| {
        timing.stages[0].worst_ns = u32::MAX;
        timing.stack_used = u32::MAX;
    });
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    for (message, expected) in [
        (&full, "stack nearly used up: 6145 of 8192 bytes"),
        (&both, "late since boot: acquire; stack nearly used up: 4294967295 of 8192 bytes"),
        (&late, "late since boot: code stage 9"),
    ] {
        let status = harness.status_after(message, "timing");
        assert_eq!(state(&status), (DiagnosticLevel::Warn, expected));
    }
    let status = harness.status_after(&late, "timing");
    for pair in [
        ("stage 9", "worst 5 us of 1 us"),
        ("stage 9: times per eighth of it", "0 0 0 0 0 0 0 0, late 3"),
    ] {
        assert!(values(&status).contains(&pair), "{status:?}");
    }
}

#[test]
fn a_device_that_measures_nothing_is_no_warning() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    let status = harness.status_after(&ToHost::Timing(Timing::default()), "timing");
    assert_eq!(status.level, DiagnosticLevel::Ok);
    assert!(status.values.is_empty(), "{status:?}");
    assert_eq!(harness.core.summary().worst_stage, None);
    assert!(!harness.core.summary().to_string().contains("stage"));
}

#[test]
fn the_summary_names_the_stage_closest_to_its_deadline_across_resets() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    harness.status_after(&timing(|timing| timing.stages[0].worst_ns *= 2), "timing");
    assert_eq!(harness.core.summary().worst_stage, Some(CODE));
    let late = timing(|timing| timing.stages[0].worst_ns = 4_000_000);
    harness.status_after(&late, "timing");
    harness.reboot(0);
    harness.status_after(&timing(|_| {}), "timing");
    let line = harness.core.summary().to_string();
    assert!(line.ends_with("; stage acquire: worst 4000 us of 1953.125 us"), "{line}");
}

#[test]
fn a_report_is_shown_once_and_never_after_a_reset() {
    let flat = quality(|quality| quality.electrodes[0].flat = true);
    let full = timing(|timing| timing.stack_used = 8192);
    for (part, older, newer) in
        [("signal quality", flat, quality(|_| {})), ("timing", full, timing(|_| {}))]
    {
        let mut harness = Harness::streaming(SETTINGS, Board::new());
        assert_eq!(harness.status(part), None);
        harness.send(0, &older);
        assert_eq!(harness.status_after(&newer, part).level, DiagnosticLevel::Ok);
        assert_eq!(harness.status(part), None, "shown again");
        harness.send(0, &newer);
        harness.reboot(0);
        assert_eq!(harness.status(part), None, "from before the reset");
    }
}
