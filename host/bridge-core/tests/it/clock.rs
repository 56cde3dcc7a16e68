//! The fit of the device's clock, in virtual time: reads can be delayed, bunched or stalled.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    reason = "times of minutes"
)]

use bridge_core::{Clock, HostTime};

use crate::board::{WALL_START_NS, at};

/// Time between codes, microseconds.
const HOP_US: f64 = 62_500.0;
/// Time that the host takes to read and handle one code when it reads a backlog, microseconds.
const BACKLOG_READ_US: f64 = 150.0;

/// Conditions of a simulated run: drift, reads, delays, stalls of the host, wall-clock steps.
struct Run {
    /// Drift in ppm (host seconds per device second minus 1), by host time in seconds.
    ppm: fn(f64) -> f64,
    /// Interval at which the host reads, microseconds; with 0 it reads each code when it arrives.
    bunch_us: f64,
    /// Smallest time from a code's last sample to its arrival, microseconds.
    least_delay_us: f64,
    /// Largest delay of an arrival in excess of `least_delay_us`, microseconds. For most arrivals
    /// the excess is less than a quarter of this limit.
    jitter_us: f64,
    /// Stalls of the host: times at which it stops reading and continues, seconds.
    stalls: &'static [[f64; 2]],
    /// Sum of all steps of the wall clock so far, nanoseconds, by host time in seconds.
    wall_step_ns: fn(f64) -> i64,
    seconds: f64,
}

const QUIET: Run = Run {
    ppm: |_| 40.0,
    bunch_us: 0.0,
    least_delay_us: 0.0,
    jitter_us: 4_000.0,
    stalls: &[],
    wall_step_ns: |_| 0,
    seconds: 300.0,
};

impl Run {
    /// Returns host time in seconds and error of the stamp in microseconds, for each code after the
    /// first minute. The stamp is taken right after its code was read, as when it is published.
    ///
    /// # Panics
    ///
    /// Panics if a stamp is not later than the one before.
    fn errors(&self) -> Vec<(f64, f64)> {
        let mut clock = Clock::default();
        let mut state = 5_u32;
        let (mut device_us, mut sent_us, mut read_us, mut last_ns) = (5e9, 0.0, 0.0, i64::MIN);
        let mut errors = Vec::new();
        while sent_us < self.seconds * 1e6 {
            device_us += HOP_US;
            sent_us += HOP_US * (1.0 + (self.ppm)(sent_us / 1e6) * 1e-6);
            // Noise, uniform in 0..1, from the linear congruential generator of Numerical Recipes.
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let noise = f64::from(state >> 8) / f64::from(1 << 24);
            let jitter_us = self.jitter_us * noise.powi(3);
            let mut arrival_us = sent_us + self.least_delay_us + jitter_us;
            if self.bunch_us > 0.0 {
                arrival_us = (arrival_us / self.bunch_us).ceil() * self.bunch_us;
            }
            let stalled = |[from, _]: &&[f64; 2]| arrival_us >= from * 1e6;
            let stall = self.stalls.iter().rfind(stalled);
            let free_us = stall.map_or(0.0, |[_, until]| until * 1e6);
            read_us = arrival_us.max(free_us).max(read_us + BACKLOG_READ_US);
            // A step of the wall clock shows in all codes that are read after it.
            let step_ns = (self.wall_step_ns)(read_us / 1e6);
            let wall_ns = |us: f64| WALL_START_NS + (us * 1000.0) as i64 + step_ns;
            let read = HostTime {
                monotonic_us: read_us as i64,
                wall_ns: wall_ns(read_us),
            };
            clock.observe(device_us as u64, read);
            let stamp_ns = clock.wall_ns(device_us as i128).unwrap();
            assert!(stamp_ns > last_ns, "a stamp went back at {sent_us} us");
            last_ns = stamp_ns;
            if sent_us > 60e6 {
                let error_us = (stamp_ns - wall_ns(sent_us)) as f64 / 1000.0;
                errors.push((read_us / 1e6, error_us));
            }
        }
        errors
    }

    /// Checks that all stamps after the first minute are as exact as required.
    fn check(&self, name: &str) {
        check(name, &self.errors());
    }
}

/// Checks that stamps are exact enough: 99 % of the errors are at most 0.5 ms, all at most 1 ms.
fn check(name: &str, errors: &[(f64, f64)]) {
    let mut sizes: Vec<f64> = errors.iter().map(|(_, error)| error.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let (p99, max) = (sizes[sizes.len() * 99 / 100], sizes[sizes.len() - 1]);
    let measured = format!("{name}: p99 {p99:.0} us, max {max:.0} us");
    println!("{measured}");
    assert!(p99 <= 500.0 && max <= 1000.0, "{measured}");
}

#[test]
fn a_constant_drift_is_followed_with_reads_at_any_interval() {
    let drifts: [fn(f64) -> f64; 5] = [|_| 100.0, |_| -100.0, |_| 0.0, |_| 40.0, |_| 3.0];
    // The host reads at each arrival, in USB frames of 1 ms, or every 16 ms.
    for (bunch_us, jitter_us) in [(0.0, 4_000.0), (1_000.0, 4_000.0), (16_000.0, 0.0)] {
        for ppm in drifts {
            let run = Run {
                ppm,
                bunch_us,
                jitter_us,
                ..QUIET
            };
            run.check(&format!("{} ppm, reads every {bunch_us} us", ppm(0.0)));
        }
    }
}

#[test]
fn a_change_of_drift_by_20_ppm_is_followed_also_before_and_after_a_backlog() {
    let up_and_down = |t| {
        if (150.0..500.0).contains(&t) {
            60.0
        } else {
            40.0
        }
    };
    let stalls: &'static [[f64; 2]] = &[[300.0, 420.0], [700.0, 760.0]];
    for stalls in [&[], stalls] {
        let run = Run {
            ppm: up_and_down,
            stalls,
            seconds: 900.0,
            ..QUIET
        };
        run.check(&format!("change of drift, stalls {stalls:?}"));
    }
}

#[test]
fn a_backlog_of_up_to_5_minutes_does_not_move_the_stamps() {
    let stalls: [&'static [[f64; 2]]; 6] = [
        &[[100.0, 105.0]],
        &[[100.0, 108.0]],
        &[[100.0, 112.0]],
        &[[100.0, 160.0]],
        &[[100.0, 400.0]],
        &[[100.0, 160.0], [165.0, 225.0], [226.0, 300.0]],
    ];
    for stalls in stalls {
        for ppm in [(|_| 40.0) as fn(f64) -> f64, |_| -100.0] {
            let run = Run {
                ppm,
                stalls,
                seconds: 900.0,
                ..QUIET
            };
            run.check(&format!("stalls {stalls:?}"));
        }
    }
    let bunches = Run {
        bunch_us: 16_000.0,
        jitter_us: 0.0,
        stalls: &[[100.0, 160.0], [400.0, 700.0]],
        seconds: 900.0,
        ..QUIET
    };
    bunches.check("stalls, reads every 16 ms");
}

#[test]
fn a_clock_that_drifted_during_an_hour_of_stall_is_followed_again() {
    // During the stall of 3,600 s the drift differs by 30 ppm, which adds up to 108 ms.
    let run = Run {
        ppm: |t| {
            if (100.0..3_700.0).contains(&t) {
                70.0
            } else {
                40.0
            }
        },
        stalls: &[[100.0, 3_700.0]],
        seconds: 4_500.0,
        ..QUIET
    };
    let mut errors = run.errors();
    errors.retain(|(t, _)| *t > 4_300.0);
    check("an hour later", &errors);
}

#[test]
fn a_step_of_the_wall_clock_is_followed_without_going_backwards() {
    for stalls in [&[] as &'static [[f64; 2]], &[[100.0, 160.0]]] {
        let forwards = Run {
            stalls,
            wall_step_ns: |t| if t < 130.0 { 0 } else { 2_000_000_000 },
            ..QUIET
        };
        forwards.check(&format!("step forwards, stalls {stalls:?}"));
    }
    let backwards = Run {
        wall_step_ns: |t| if t < 100.0 { 0 } else { -1_000_000_000 },
        ..QUIET
    };
    // After a backward step of 1 s, stamps catch up by 0.1 s per second within 10 s, except for the
    // last 20 ms: at the slew rate of 600 ppm these take 33 s. Check errors again after 45 s.
    let mut errors = backwards.errors();
    errors.retain(|(t, _)| !(100.0..145.0).contains(t));
    check("step backwards", &errors);
}

#[test]
fn stamps_are_late_by_the_least_delay() {
    // The encoder delays each frame by 3 ms and the link by at least 2 ms, so stamps are 5 ms late.
    let run = Run {
        least_delay_us: 5_000.0,
        ..QUIET
    };
    for (seconds, error) in run.errors() {
        let is_late = (4500.0..5500.0).contains(&error);
        assert!(is_late, "{error} us at {seconds} s");
    }
}

/// Returns a clock that has observed 10 s of codes, and the host time of the newest one.
fn settled() -> (Clock, i64) {
    let mut clock = Clock::default();
    for code in 1..=160 {
        assert!(clock.observe(code * 62_500, at(code.cast_signed() * 62_500)));
    }
    (clock, 10_000_000)
}

#[test]
fn a_restart_discards_the_fit_and_keeps_the_wall_clock() {
    let (mut clock, now) = settled();
    clock.restart();
    assert_eq!(clock.wall_ns(0), None);
    clock.observe(50_000, at(now + 62_500));
    assert_eq!(clock.wall_ns(50_000), Some(at(now + 62_500).wall_ns));
}

#[test]
fn the_drift_is_reported_in_ppm() {
    let mut clock = Clock::default();
    for index in 0..16 * 120_u32 {
        clock.observe(62_500 * u64::from(index), at(62_504 * i64::from(index)));
    }
    let ppm = clock.drift_ppm();
    assert!((ppm - 64.0).abs() < 1.0, "{ppm}");
    assert!(clock.residual_us().abs() < 10.0 && clock.newest_delay_us().abs() < 10.0);
}

#[test]
fn one_impossible_device_time_changes_nothing() {
    for wrong in [0, 9_000_000, 12_000_000, u64::MAX / 2, u64::MAX] {
        let (mut clock, now) = settled();
        let before = clock.wall_ns(10_000_000);
        assert!(!clock.observe(wrong, at(now + 62_500)), "{wrong}");
        assert_eq!(clock.wall_ns(10_000_000), before);
        assert_eq!(clock.refused(), 1);
        assert!(clock.observe(10_125_000, at(now + 125_000)));
        // Converting a refused device time must not overflow.
        clock.wall_ns(i128::from(wrong));
    }
}

#[test]
fn the_fit_restarts_half_a_second_after_the_device_clock_jumped() {
    let (mut clock, now) = settled();
    for code in 1..=8_i64 {
        let device_us = 3_600_000_000 + code.unsigned_abs() * 62_500;
        let taken = clock.observe(device_us, at(now + code * 62_500));
        assert_eq!(taken, code == 8);
    }
    assert_eq!(clock.wall_ns(3_600_500_000), Some(at(10_500_000).wall_ns));
}

#[test]
fn a_step_back_is_counted_and_one_beyond_30_s_is_followed_at_once() {
    for (step_s, back) in [(-1, 0), (-30, 0), (-31, 1), (-3600, 1)] {
        let (mut clock, now) = settled();
        let step_ns = step_s * 1_000_000_000;
        for code in 1..=16_i64 {
            let us = now + code * 62_500;
            let read = HostTime {
                wall_ns: at(us).wall_ns + step_ns,
                ..at(us)
            };
            clock.observe(us.unsigned_abs(), read);
        }
        assert_eq!((clock.wall_steps(), clock.wall_steps_back()), (1, back));
        let true_ns = at(11_000_000).wall_ns + step_ns;
        let error_ns = clock.wall_ns(11_000_000).unwrap() - true_ns;
        // After a step of up to 30 s, stamps have caught up by 0.1 s in the first second. After a
        // longer step they follow at once.
        let expected = if back == 1 { 0 } else { -step_ns - 100_000_000 };
        assert!((error_ns - expected).abs() < 1000, "{step_s} s: {error_ns}");
    }
}
