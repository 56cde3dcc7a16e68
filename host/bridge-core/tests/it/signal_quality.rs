//! The status `signal quality` in `/diagnostics`.

use link::{ElectrodeQuality, Quality, ToHost};
use neuro_ros::DiagnosticLevel;

use crate::board::{Board, electrode};
use crate::recorder::{Harness, SETTINGS, state};

const GOOD: ElectrodeQuality = ElectrodeQuality {
    rms_uv: 12.34,
    mains_uv: 20.0,
    mains_residual_uv: 0.125,
    samples_at_rail: 0,
    flat: false,
};

/// Returns a report about 61 good electrodes, as modified by `change`.
fn report(change: impl FnOnce(&mut Quality)) -> ToHost<'static> {
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
    let message = report(|quality| {
        quality.electrodes[0].flat = true;
        quality.electrodes[2].samples_at_rail = 7;
        quality.electrodes[3].mains_uv = 100.5;
        quality.electrodes[60].mains_uv = 3000.0;
    });
    let status = harness.status_after(&message, "signal quality").unwrap();
    assert_eq!(status.level, DiagnosticLevel::Warn);
    assert_eq!(
        status.message,
        format!("flat: {first}; at the rail: {third}; mains above 100 uV: {fourth} {last}")
    );
    assert_eq!(status.values.len(), 61);
    assert!(status.hardware_id.starts_with("board "));
    let value = |index: usize| (&*status.values[index].key, &*status.values[index].value);
    assert_eq!(
        value(1),
        (
            &*electrode(1),
            "rms 12.3 uV, mains 20.0 uV, 0.12 uV after the filters"
        )
    );
    assert!(value(0).1.ends_with(", flat"));
    assert!(value(2).1.ends_with(", 7 samples at the rail"));
}

#[test]
fn good_electrodes_are_no_warning_and_settling_is_reported() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    let status = harness
        .status_after(&report(|_| {}), "signal quality")
        .unwrap();
    assert_eq!(
        state(&status),
        (DiagnosticLevel::Ok, "61 electrodes in order")
    );
    let status = harness
        .status_after(&report(|quality| quality.settling = true), "signal quality")
        .unwrap();
    assert_eq!(
        state(&status),
        (DiagnosticLevel::Ok, "the filters are settling")
    );
}

#[test]
fn the_newest_report_is_shown_once() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    assert_eq!(harness.status("signal quality"), None);
    let older = report(|quality| quality.electrodes[0].flat = true);
    harness.send(0, &older);
    let status = harness
        .status_after(&report(|_| {}), "signal quality")
        .unwrap();
    assert_eq!(status.level, DiagnosticLevel::Ok);
    assert_eq!(harness.status("signal quality"), None);
}

#[test]
fn a_report_from_before_a_reset_is_discarded() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    harness.send(0, &report(|_| {}));
    harness.board.reboot();
    let hello = harness.board.hello();
    harness.receive(&hello);
    assert_eq!(harness.status("signal quality"), None);
}

#[test]
fn impossible_figures_and_missing_labels_are_handled() {
    let mut harness = Harness::streaming(SETTINGS, Board::new());
    let message = report(|quality| {
        quality.electrodes[0].mains_uv = f32::NAN;
        quality.electrodes[1].mains_uv = f32::INFINITY;
        for _ in 61..64 {
            quality.electrodes.push(GOOD).unwrap();
        }
    });
    let status = harness.status_after(&message, "signal quality").unwrap();
    assert_eq!(
        status.message,
        format!("mains above 100 uV: {}", electrode(1))
    );
    assert_eq!(status.values[63].key, "electrode 63");
    let none = report(|quality| quality.electrodes.clear());
    assert_eq!(
        harness
            .status_after(&none, "signal quality")
            .unwrap()
            .values
            .len(),
        0
    );
}
