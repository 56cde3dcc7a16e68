//! The status `converters` in `/diagnostics`.

use link::{Converters, ToHost};
use neuro_ros::{DiagnosticLevel, DiagnosticStatus};

use crate::board::{Board, electrode};
use crate::recorder::{Harness, SETTINGS, state, value};

/// Sends a report about two chips without faults, as modified by `change`, and returns the status.
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
fn chips_in_order_are_no_warning() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    assert_eq!(harness.status("converters"), None);
    let status = report_status(&mut harness, |_| {});
    assert_eq!(state(&status), (DiagnosticLevel::Ok, "2 chips convert"));
    assert_eq!(
        value(&status, "DRDY"),
        "512.010 Hz, +20 ppm off the 512 Hz that were set"
    );
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
    // Bad frames that the first report contains already are not reported as new.
    assert_eq!(bad(2).level, DiagnosticLevel::Ok);
    let status = bad(5);
    assert_eq!(
        state(&status),
        (
            DiagnosticLevel::Warn,
            "frames bad since the last report: chip 1 (3)"
        )
    );
    assert_eq!(bad(5).level, DiagnosticLevel::Ok);
    assert!(bad(10).message.ends_with("chip 1 (5)"));
    // Without a new message, the next report does not repeat the warning.
    assert_eq!(
        harness.status("converters").unwrap().level,
        DiagnosticLevel::Ok
    );
}

#[test]
fn detached_electrodes_and_spare_channels_are_named() {
    let [first, second] = [0, 1].map(electrode);
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    let status = report_status(&mut harness, |converters| {
        converters.off_positive = 0b11;
        converters.off_negative = 1 | 1 << 63;
    });
    assert_eq!(
        state(&status),
        (
            DiagnosticLevel::Warn,
            &*format!("electrodes off: {first} {second} exg3")
        )
    );
    assert_eq!(
        value(&status, "positive electrodes off"),
        format!("{first} {second}")
    );
    assert_eq!(
        value(&status, "negative electrodes off"),
        format!("{first} exg3")
    );
}

#[test]
fn a_chain_that_does_not_run_is_an_error_until_it_runs() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    let fault = "chip 2: ID 0x00";
    let status = report_status(&mut harness, |converters| {
        converters.fault.push_str(fault).unwrap();
    });
    assert_eq!(state(&status), (DiagnosticLevel::Error, fault));
    assert_eq!(
        harness.status("converters").unwrap().level,
        DiagnosticLevel::Error
    );
    assert_eq!(
        report_status(&mut harness, |_| {}).level,
        DiagnosticLevel::Ok
    );
    harness.board.reboot();
    let hello = harness.board.hello();
    harness.receive(&hello);
    assert_eq!(
        harness.status("converters"),
        None,
        "the report belongs to the previous boot"
    );
}
