//! The fit of the device's clock while the host reads a backlog, in virtual time.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    reason = "times of minutes"
)]

use bridge_core::{Clock, HostTime};

use crate::board::WALL_START_NS;

/// Time between codes, microseconds.
const HOP_US: f64 = 62_500.0;
/// Time that the host takes to read and handle one code of a backlog, microseconds.
const BACKLOG_READ_US: f64 = 150.0;

/// One run of device and host: drift, stalls of the host, reads in bunches, steps of the wall
/// clock.
struct Run {
    /// Drift (host seconds per device second minus 1), ppm, at a host time in seconds.
    ppm: fn(f64) -> f64,
    /// Times at which the host stops reading, and at which it continues, seconds.
    stalls: &'static [[f64; 2]],
    /// Interval at which the host reads, microseconds; 0 for a read at each arrival, up to 4 ms
    /// after it was sent.
    bunch_us: f64,
    /// Sum of all steps of the wall clock until a host time in seconds, nanoseconds.
    wall_step_ns: fn(f64) -> i64,
    seconds: f64,
}

const QUIET: Run = Run {
    ppm: |_| 40.0,
    stalls: &[],
    bunch_us: 0.0,
    wall_step_ns: |_| 0,
    seconds: 900.0,
};

impl Run {
    /// Returns the host time, seconds, and the error of the stamp, microseconds, of each code after
    /// the first minute. A stamp is judged right after its code was read, as it is published then.
    ///
    /// # Panics
    ///
    /// Panics if a stamp is earlier than the one before.
    fn errors(&self) -> Vec<(f64, f64)> {
        let mut clock = Clock::default();
        let mut state = 5_u32;
        let (mut device_us, mut sent_us, mut read_us, mut last_ns) = (5e9, 0.0, 0.0, i64::MIN);
        let mut errors = Vec::new();
        while sent_us < self.seconds * 1e6 {
            device_us += HOP_US;
            sent_us += HOP_US * (1.0 + (self.ppm)(sent_us / 1e6) * 1e-6);
            // Transfers take up to 4 ms, most of them less than 1 ms (noise: Numerical Recipes).
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let noise = f64::from(state >> 8) / f64::from(1 << 24);
            let arrival_us = if self.bunch_us > 0.0 {
                (sent_us / self.bunch_us).ceil() * self.bunch_us
            } else {
                sent_us + 4000.0 * noise.powi(3)
            };
            let stalled = |[from, _]: &&[f64; 2]| arrival_us >= from * 1e6;
            let stall = self.stalls.iter().rfind(stalled);
            let free_us = stall.map_or(0.0, |[_, until]| until * 1e6);
            read_us = arrival_us.max(free_us).max(read_us + BACKLOG_READ_US);
            let wall_ns =
                |us: f64| WALL_START_NS + (us * 1000.0) as i64 + (self.wall_step_ns)(us / 1e6);
            let read = HostTime {
                monotonic_us: read_us as i64,
                wall_ns: wall_ns(read_us),
            };
            clock.observe(device_us as u64, read);
            let stamp_ns = clock.wall_ns(device_us as i128).unwrap();
            assert!(stamp_ns > last_ns, "a stamp went back at {sent_us} us");
            last_ns = stamp_ns;
            if sent_us > 60e6 {
                // The wall clock's steps are applied to what is read after them.
                let step_ns = (self.wall_step_ns)(read_us / 1e6);
                let true_ns = WALL_START_NS + (sent_us * 1000.0) as i64 + step_ns;
                errors.push((read_us / 1e6, (stamp_ns - true_ns) as f64 / 1000.0));
            }
        }
        errors
    }
}

/// Checks the requirement on stamps: 99 % are at most 0.5 ms wrong, and all at most 1 ms.
fn check(name: &str, errors: &[(f64, f64)]) {
    let mut sizes: Vec<f64> = errors.iter().map(|(_, error)| error.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let (p99, max) = (sizes[sizes.len() * 99 / 100], sizes[sizes.len() - 1]);
    println!("{name}: p99 {p99:.0} us, max {max:.0} us");
    assert!(
        p99 <= 500.0 && max <= 1000.0,
        "{name}: p99 {p99:.0} us, max {max:.0} us"
    );
}

#[test]
fn a_backlog_of_up_to_5_minutes_does_not_move_the_stamps() {
    let stalls: [&'static [[f64; 2]]; 5] = [
        &[[100.0, 108.0]],
        &[[100.0, 112.0]],
        &[[100.0, 160.0]],
        &[[100.0, 400.0]],
        &[[100.0, 160.0], [165.0, 225.0], [226.0, 300.0]],
    ];
    for stalls in stalls {
        for ppm in [(|_| 40.0) as fn(f64) -> f64, |_| -100.0] {
            check(
                &format!("stalls {stalls:?}"),
                &Run {
                    ppm,
                    stalls,
                    ..QUIET
                }
                .errors(),
            );
        }
    }
}

#[test]
fn a_backlog_in_bunches_of_16_ms_does_not_move_the_stamps() {
    let stalls: &'static [[f64; 2]] = &[[100.0, 160.0], [400.0, 700.0]];
    for stalls in [&[] as &'static [[f64; 2]], stalls] {
        check(
            "bunches",
            &Run {
                stalls,
                bunch_us: 16_000.0,
                ..QUIET
            }
            .errors(),
        );
    }
}

#[test]
fn a_drift_that_changes_by_20_ppm_is_followed_before_and_after_a_backlog() {
    let ppm = |t| {
        if (150.0..500.0).contains(&t) {
            60.0
        } else {
            40.0
        }
    };
    let stalls = &[[300.0, 420.0], [700.0, 760.0]];
    check(
        "drift steps",
        &Run {
            ppm,
            stalls,
            ..QUIET
        }
        .errors(),
    );
}

#[test]
fn a_step_of_the_wall_clock_during_a_stall_moves_all_stamps_alike() {
    let wall_step_ns = |t| if t < 130.0 { 0 } else { 2_000_000_000 };
    check(
        "NTP step",
        &Run {
            stalls: &[[100.0, 160.0]],
            wall_step_ns,
            ..QUIET
        }
        .errors(),
    );
}

#[test]
fn a_clock_that_drifted_during_an_hour_of_stall_is_followed_again() {
    // During an hour of stall the drift differs by 30 ppm from the one before, which adds up to 108
    // ms.
    let ppm = |t| {
        if (100.0..3_700.0).contains(&t) {
            70.0
        } else {
            40.0
        }
    };
    let stalls = &[[100.0, 3_700.0]];
    let run = Run {
        ppm,
        stalls,
        seconds: 4_500.0,
        ..QUIET
    };
    let errors = run.errors();
    let last: Vec<_> = errors
        .iter()
        .filter(|(t, _)| *t > 4_300.0)
        .copied()
        .collect();
    check("an hour later", &last);
}
