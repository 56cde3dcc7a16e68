//! Fit of the device's clock to the host's.
//!
//! Every code carries the device time of its last sample. The host reads the code after a delay
//! that is never negative and is sometimes close to its minimum. [`Fit`] finds the line through the
//! least delayed codes.
//!
//! The fit uses the host's monotonic clock. The difference between wall clock and monotonic clock
//! is added to the fitted host time.
//!
//! From delays in one direction, the least delay cannot be told apart from the offset between the
//! clocks. Every stamp is therefore late by the least delay from a code's last sample to the
//! reading of the code, which includes encoding and transfer. This lateness is constant and shifts
//! all frames of a recording alike.

use crate::time::HostTime;
use crate::time::fit::{Fit, Point};

/// Device time that the fit must span before its drift is reported as measured, microseconds. The
/// drift is then correct to 100 ppm if the host reads every 16 ms.
const SETTLED_SPAN_US: f64 = 15e6;
/// Limit of the slew of the smoothed wall clock against the monotonic clock, seconds per second.
/// NTP slews the wall clock by at most 500 ppm, so the smoothed clock can follow.
const WALL_SLEW: f64 = 600e-6;
/// Difference between the wall clock and the smoothed clock, nanoseconds, above which the wall
/// clock counts as stepped.
const WALL_STEP_NS: i64 = 20_000_000;
/// After a backward step of the wall clock, stamps advance more slowly by this fraction until the
/// wall clock has caught up. They therefore never go backwards.
const WALL_CATCH_UP: f64 = 0.1;
/// Longest backward step of the wall clock for which stamps advance more slowly, nanoseconds. After
/// a longer step the stamps go back at once, because catching up would take more than 5 minutes.
const WALL_WAIT_NS: i64 = 30_000_000_000;
/// Longest time by which a frame may seem to have been read before it was made, microseconds. The
/// fit is correct to some milliseconds, so a frame beyond this limit has a wrong device time.
const MAX_EARLY_US: f64 = 1e6;
/// Number of consecutive impossible device times, half a second of codes, after which the fit
/// restarts, because the fit itself must be wrong.
const REFUSED_TO_RESTART: u32 = 8;

/// Fit of the device's clock to the host's monotonic clock, and the smoothed wall clock. Converts
/// device times to host times.
#[derive(Clone, Debug, Default)]
pub struct Clock {
    /// Device time and host time of the first frame, microseconds. All points are relative to them,
    /// so that they are small enough to be exact in f64.
    origin: Option<(u64, i64)>,
    /// First point of the fit, set before the first frame arrives, microseconds: a device time, and
    /// the host time at which the bridge reads a frame that the device makes at that time, if
    /// nothing delays the frame.
    anchor: Option<(u64, i64)>,
    fit: Fit,
    /// Latest device time of all frames so far, microseconds relative to `origin`.
    newest: f64,
    /// The newest frame with a possible device time.
    newest_frame: Option<Point>,
    wall: Option<Wall>,
    wall_steps: u32,
    wall_steps_back: u32,
    refused: u64,
    refused_in_a_row: u32,
}

/// Wall-clock time minus monotonic time, smoothed.
#[derive(Clone, Copy, Debug)]
struct Wall {
    offset_ns: i64,
    read_at_us: i64,
    /// Whether stamps advance more slowly, because the wall clock was stepped backwards.
    catching_up: bool,
}

impl Clock {
    /// Discards the fit, but keeps the wall clock's state and the drift. Call this when the device
    /// was reset.
    pub fn restart(&mut self) {
        *self = Clock {
            wall: self.wall,
            wall_steps: self.wall_steps,
            wall_steps_back: self.wall_steps_back,
            refused: self.refused,
            fit: Fit::expecting(self.fit.line().drift),
            ..Clock::default()
        };
    }

    /// Returns whether a new frame that was read at `read` can have this device time: not before
    /// the newest frame so far, and not after `read`. False before the first observation.
    pub fn admits(&self, device_us: u64, read: HostTime) -> bool {
        let is_old = |(origin, _)| difference(device_us, origin) < self.newest;
        !self.origin.is_some_and(is_old) && self.is_possible(device_us, read)
    }

    /// Returns whether a frame that was read at `read` can have this device time: it was made
    /// before it was read. False before the first observation.
    pub fn is_possible(&self, device_us: u64, read: HostTime) -> bool {
        let lag_us = self.lag_us(device_us, read.monotonic_us);
        lag_us.is_some_and(|lag| lag >= -MAX_EARLY_US)
    }

    /// Returns whether a frame was observed since this clock was created or last restarted.
    pub fn is_known(&self) -> bool {
        self.origin.is_some()
    }

    /// Returns by how much the host time `host_us` is later than the fitted host time of
    /// `device_us`, microseconds; `None` before the first observation.
    pub(crate) fn lag_us(&self, device_us: u64, host_us: i64) -> Option<f64> {
        let (device_origin, host_origin) = self.origin?;
        let device = difference(device_us, device_origin);
        let host = to_f64(host_us.saturating_sub(host_origin));
        Some(self.fit.line().lag_us(Point { device, host }))
    }

    /// Gives the fit a first point, before any observation: a frame made at `device_us` is read no
    /// later than `late_us` microseconds after `host_us`, unless it is delayed. Of several such
    /// points, the one with the least delay counts.
    pub(crate) fn anchor(&mut self, device_us: u64, host_us: i64, late_us: f64) {
        #[expect(clippy::cast_possible_truncation, reason = "saturates")]
        let host_us = host_us.saturating_add(late_us.round() as i64);
        let delay = |(device, host): (u64, i64)| i128::from(host) - i128::from(device);
        let new = (device_us, host_us);
        if self.anchor.is_none_or(|known| delay(new) < delay(known)) {
            self.anchor = Some(new);
        }
    }

    /// Adds a frame to the fit, by its device time and the host time `read` at which it was read.
    /// If the device time is impossible, ignores the frame and returns false. The eighth
    /// consecutive impossible time restarts the fit instead.
    pub fn observe(&mut self, device_us: u64, read: HostTime) -> bool {
        self.follow_wall(read);
        if self.origin.is_some() && !self.admits(device_us, read) {
            self.refused += 1;
            self.refused_in_a_row += 1;
            if self.refused_in_a_row < REFUSED_TO_RESTART {
                return false;
            }
            tracing::warn!("the device's clock jumped; its fit restarts");
            self.restart();
        }
        self.refused_in_a_row = 0;
        let origin = *self.origin.get_or_insert((device_us, read.monotonic_us));
        let point_at = |(device_us, host_us): (u64, i64)| Point {
            device: difference(device_us, origin.0),
            host: to_f64(host_us.saturating_sub(origin.1)),
        };
        let point = point_at((device_us, read.monotonic_us));
        if let Some(anchor) = self.anchor.take().map(point_at)
            && anchor.device < point.device
        {
            self.fit.add(anchor);
        }
        self.newest = self.newest.max(point.device);
        self.newest_frame = Some(point);
        self.fit.add(point);
        true
    }

    /// Updates the smoothed wall clock at the present time `read`. Returns the smoothed wall-clock
    /// time minus the monotonic time, nanoseconds.
    pub(crate) fn follow(&mut self, read: HostTime) -> i64 {
        if self.wall.is_some() {
            self.follow_wall(read);
        }
        let offset_ns = self.wall.map(|wall| wall.offset_ns);
        offset_ns.unwrap_or_else(|| read.wall_offset_ns())
    }

    fn follow_wall(&mut self, read: HostTime) {
        let observed = read.wall_offset_ns();
        let Some(wall) = &mut self.wall else {
            self.wall = Some(Wall {
                offset_ns: observed,
                read_at_us: read.monotonic_us,
                catching_up: false,
            });
            return;
        };
        let elapsed_us = read.monotonic_us.saturating_sub(wall.read_at_us).max(0);
        wall.read_at_us = read.monotonic_us;
        let off = observed.saturating_sub(wall.offset_ns);
        let stepped_back = off < -WALL_STEP_NS;
        if off > WALL_STEP_NS || (stepped_back && !wall.catching_up) {
            self.wall_steps = self.wall_steps.wrapping_add(1);
            tracing::warn!(milliseconds = off / 1_000_000, "the host's clock was stepped");
        }
        wall.catching_up = stepped_back && off >= -WALL_WAIT_NS;
        if !(-WALL_WAIT_NS..=WALL_STEP_NS).contains(&off) {
            self.wall_steps_back = self.wall_steps_back.wrapping_add(u32::from(stepped_back));
            wall.offset_ns = observed;
            return;
        }
        let speed = if stepped_back { WALL_CATCH_UP } else { WALL_SLEW };
        #[expect(clippy::cast_possible_truncation, reason = "at most a tenth of the time elapsed")]
        let most = (to_f64(elapsed_us) * 1000.0 * speed) as i64;
        wall.offset_ns += off.clamp(-most, most);
    }

    /// Returns the device time at which the host's monotonic clock shows `host_us`, microseconds;
    /// `None` before the first observation. The result is most exact near the newest frame.
    pub(crate) fn device_us_at(&self, host_us: i64) -> Option<i64> {
        let (device_origin, _) = self.origin?;
        #[expect(clippy::cast_possible_truncation, reason = "saturates")]
        let newest_us = i64::try_from(device_origin).ok()? + self.newest.round() as i64;
        let lag_us = self.lag_us(u64::try_from(newest_us).ok()?, host_us)?;
        #[expect(clippy::cast_possible_truncation, reason = "saturates")]
        Some(newest_us + lag_us.round() as i64)
    }

    /// Returns the fitted time on the host's monotonic clock at the device time `device_us`,
    /// microseconds; `None` before the first observation.
    pub fn host_us(&self, device_us: i128) -> Option<f64> {
        let (device_origin, host_origin) = self.origin?;
        #[expect(clippy::cast_precision_loss, reason = "within 2^53 us (285 years) of the origin")]
        let device = (device_us - i128::from(device_origin)) as f64;
        Some(to_f64(host_origin) + self.fit.line().host_us(device))
    }

    /// Returns the time on the smoothed wall clock at the device time `device_us`, nanoseconds
    /// since 1970; `None` before the first observation.
    pub fn wall_ns(&self, device_us: i128) -> Option<i64> {
        let (device_origin, host_origin) = self.origin?;
        let wall = self.wall?;
        #[expect(clippy::cast_precision_loss, reason = "within 2^53 us (285 years) of the origin")]
        let device = (device_us - i128::from(device_origin)) as f64;
        let host_us = self.fit.line().host_us(device);
        #[expect(clippy::cast_possible_truncation, reason = "saturates, and years fit")]
        let host_ns = (host_us * 1000.0).round() as i64;
        let host_ns = host_origin.saturating_mul(1000).saturating_add(host_ns);
        Some(host_ns.saturating_add(wall.offset_ns))
    }

    /// Converts the monotonic host time `host_us`, microseconds, to the smoothed wall clock,
    /// nanoseconds since 1970.
    pub(crate) fn wall_of_host_us(&self, host_us: f64) -> i64 {
        #[expect(clippy::cast_possible_truncation, reason = "saturates, and years fit")]
        let host_ns = (host_us * 1000.0).round() as i64;
        host_ns.saturating_add(self.wall.map_or(0, |wall| wall.offset_ns))
    }

    /// Returns the time on the smoothed wall clock at the host time `read`, nanoseconds since 1970.
    pub fn wall_of_host_ns(&self, read: HostTime) -> i64 {
        let offset_ns = self.wall.map_or(read.wall_offset_ns(), |wall| wall.offset_ns);
        let host_ns = read.monotonic_us.saturating_mul(1000);
        host_ns.saturating_add(offset_ns)
    }

    /// Returns the drift: host seconds per device second, minus 1, in parts per million. It is
    /// positive if the device's clock is slow.
    pub fn drift_ppm(&self) -> f64 {
        self.fit.line().drift * 1e6
    }

    /// Returns whether the drift is measured, which takes about 15 s of codes.
    pub fn is_settled(&self) -> bool {
        self.fit.span_us() >= SETTLED_SPAN_US
    }

    /// Returns the median residual of the fit, microseconds. The fit divides frames into blocks of
    /// up to 1 s; a block's residual is the lag of its least delayed frame behind the fitted line.
    pub fn residual_us(&self) -> f64 {
        self.fit.residual_us()
    }

    /// Returns by how much the newest frame was read later than the fit predicts, microseconds.
    pub fn newest_delay_us(&self) -> f64 {
        let line = self.fit.line();
        self.newest_frame.map_or(0.0, |point| line.lag_us(point))
    }

    /// Returns how often the host's wall clock was stepped, in either direction.
    pub fn wall_steps(&self) -> u32 {
        self.wall_steps
    }

    /// Returns how often the host's wall clock was set back by more than 30 s. The stamps went back
    /// each time.
    pub fn wall_steps_back(&self) -> u32 {
        self.wall_steps_back
    }

    /// Returns the number of observed frames with an impossible device time.
    pub fn refused(&self) -> u64 {
        self.refused
    }
}

fn difference(later: u64, earlier: u64) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "within 2^53 us (285 years)")]
    let difference = (i128::from(later) - i128::from(earlier)) as f64;
    difference
}

fn to_f64(microseconds: i64) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "within 2^53 us (285 years)")]
    let microseconds = microseconds as f64;
    microseconds
}
