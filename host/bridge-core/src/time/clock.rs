//! Fit of the device's clock to the host's.
//!
//! Every code carries the device time of its last sample. The host reads the code after a delay
//! that is never negative and is sometimes close to its minimum.
//!
//! * Drift: the slope of one edge of the lower convex hull of the points (device time, host time)
//!   of the last two minutes. The edge is the one that spans the mean device time: of all lines
//!   below the points, it has the least mean distance to them (Moon, Skelly and Towsley, INFOCOM
//!   1999).
//! * Offset: the minimum, over the last 10 s, of host time minus drift-corrected device time.
//!   Within these 10 s the offset follows a change of drift. The offset falls at once but rises no
//!   faster than a clock can drift.
//!
//! While a stalled host reads a backlog, every frame is late, by up to minutes. Such a frame is
//! later than any drift can explain; it shows nothing about the clocks and is left out of the fit.
//!
//! The fit uses the host's monotonic clock. The difference between wall clock and monotonic clock
//! is added to the fitted host time.
//!
//! Delays in one direction cannot show which part of the offset is the least delay. Every stamp is
//! therefore late by the least delay from a code's last sample to the reading of the code, which
//! includes encoding and transfer. This lateness is constant and shifts all frames of a recording
//! alike.

use std::collections::VecDeque;

use crate::time::HostTime;

/// Device time over which the offset's minimum is taken, microseconds. A change of drift by 20 ppm
/// shifts stamps by 0.2 ms within these 10 s. If the host reads every 16 ms, a code waits up to 16
/// ms to be read. This wait varies from code to code, because 62.5 ms is not a multiple of 16 ms;
/// within 2 s it is below 0.5 ms once.
const OFFSET_SPAN_US: f64 = 10e6;
/// Device time that one block spans, microseconds. A block is a group of frames; its frame with the
/// least delay is one point for the fit of the drift.
const BLOCK_US: f64 = 2e6;
/// Number of newest blocks from which the drift is fitted; they span 2 minutes.
const BLOCKS: usize = 60;
/// Least number of blocks from which the drift is fitted; they span 10 s. An error of 1 ms in one
/// of the times then makes an error of 100 ppm in the drift.
const MIN_BLOCKS: usize = 5;
/// Limit of the fitted drift, as a fraction, in both directions. The drift between two crystals is
/// always smaller.
const MAX_DRIFT: f64 = 500e-6;
/// Limit of the rate at which the offset may rise, host seconds per device second. It is the
/// largest error that is expected in the fitted drift.
const MAX_RISE: f64 = 200e-6;
/// Lag behind the fit, microseconds, above which a frame counts as part of a backlog: it has waited
/// in a buffer while the host did not read. A host that reads every 16 ms causes smaller lags.
const BACKLOG_LAG_US: f64 = 25_000.0;
/// Device time without a backlog, microseconds, after which the offset may rise at once by up to
/// `unseen_drift`, which it could not follow during backlogs.
const PROMPT_SPAN_US: f64 = 5e6;
/// Limit of the slew of the smoothed wall clock against the monotonic clock, seconds per second.
/// NTP slews the wall clock by at most 500 ppm, so the smoothed clock can follow.
const WALL_SLEW: f64 = 600e-6;
/// Difference between the wall clock and the smoothed one above which the wall clock counts as
/// stepped, nanoseconds.
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
/// Number of consecutive impossible device times after which the fit itself must be wrong and
/// restarts: half a second of codes.
const REFUSED_TO_RESTART: u32 = 8;

/// Fit of the device's clock to the host's monotonic clock, and the smoothed wall clock. Converts
/// device times to host times.
#[derive(Clone, Debug, Default)]
pub struct Clock {
    /// Device time and host time of the first frame, microseconds. All points are relative to them,
    /// so that they are small enough to be exact in f64.
    origin: Option<(u64, i64)>,
    recent: VecDeque<Point>,
    blocks: VecDeque<Point>,
    block: Option<Point>,
    /// Drift of the clocks: host seconds per device second, minus 1.
    drift: f64,
    /// Fitted host time at the device time of `origin`, microseconds relative to `origin`.
    offset: f64,
    /// Latest device time of all frames so far, microseconds relative to `origin`.
    newest: f64,
    /// Upper bound of the change of the offset during backlogs, when the fit could not follow it,
    /// microseconds. The offset may rise by it after [`PROMPT_SPAN_US`] without a backlog.
    unseen_drift: f64,
    /// Device time of the newest frame from a backlog, microseconds relative to `origin`.
    newest_backlog: f64,
    /// The newest frame with a possible device time, whether from a backlog or not.
    newest_frame: Option<Point>,
    /// Number of frames that were left out of the fit, because they were part of a backlog.
    backlog: u64,
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
    /// Discards the fit, but keeps the wall clock's state. Call this when the device was reset.
    pub fn restart(&mut self) {
        *self = Clock {
            wall: self.wall,
            wall_steps: self.wall_steps,
            wall_steps_back: self.wall_steps_back,
            refused: self.refused,
            backlog: self.backlog,
            ..Clock::default()
        };
    }

    /// Returns whether a new frame that was read at `read` can have this device time: not before
    /// that of the newest frame so far, and not after `read`. False before the first observation.
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
        Some(host - device * (1.0 + self.drift) - self.offset)
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
        let is_first = self.origin.is_none();
        let (device_origin, host_origin) =
            *self.origin.get_or_insert((device_us, read.monotonic_us));
        let point = Point {
            device: difference(device_us, device_origin),
            host: to_f64(read.monotonic_us.saturating_sub(host_origin)),
        };
        let elapsed = (point.device - self.newest).max(0.0);
        self.newest = self.newest.max(point.device);
        self.newest_frame = Some(point);
        if !is_first && self.lag(point) > BACKLOG_LAG_US + self.unseen_drift {
            self.backlog += 1;
            self.unseen_drift += MAX_RISE * elapsed;
            self.newest_backlog = self.newest;
            return true;
        }
        self.recent.push_back(point);
        while self
            .recent
            .front()
            .is_some_and(|old| old.device < point.device - OFFSET_SPAN_US)
        {
            self.recent.pop_front();
        }
        self.add_to_block(point);
        self.update_offset(elapsed, is_first);
        true
    }

    /// Returns by how much a frame was read later than the fit predicts, microseconds.
    fn lag(&self, point: Point) -> f64 {
        point.host - point.device * (1.0 + self.drift) - self.offset
    }

    fn add_to_block(&mut self, point: Point) {
        let lag = |point: &Point| point.host - point.device * (1.0 + self.drift);
        match self.block {
            Some(block) if block_of(point) == block_of(block) => {
                if lag(&point) < lag(&block) {
                    self.block = Some(point);
                }
            }
            full => {
                self.block = Some(point);
                let Some(full) = full else { return };
                self.blocks.push_back(full);
                if self.blocks.len() > BLOCKS {
                    self.blocks.pop_front();
                }
                if self.blocks.len() >= MIN_BLOCKS {
                    let drift = slope_at_middle(self.blocks.make_contiguous()) - 1.0;
                    let drift = drift.clamp(-MAX_DRIFT, MAX_DRIFT);
                    // Rotate the fitted line about the newest frame, so that stamps do not jump.
                    self.offset += (self.drift - drift) * self.newest;
                    self.drift = drift;
                }
            }
        }
    }

    /// Sets the offset to the least lag of the recent frames, but limits its rise. `elapsed` is the
    /// device time since the newest frame before this one, microseconds.
    fn update_offset(&mut self, elapsed: f64, is_first: bool) {
        let lags = self
            .recent
            .iter()
            .map(|point| point.host - point.device * (1.0 + self.drift));
        let least = lags.fold(f64::INFINITY, f64::min);
        let mut rise = MAX_RISE * elapsed;
        if self.newest - self.newest_backlog >= PROMPT_SPAN_US {
            rise += std::mem::take(&mut self.unseen_drift);
        }
        self.offset = if is_first {
            least
        } else {
            least.min(self.offset + rise)
        };
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
            tracing::warn!(
                milliseconds = off / 1_000_000,
                "the host's clock was stepped"
            );
        }
        wall.catching_up = stepped_back && off >= -WALL_WAIT_NS;
        if !(-WALL_WAIT_NS..=WALL_STEP_NS).contains(&off) {
            self.wall_steps_back = self.wall_steps_back.wrapping_add(u32::from(stepped_back));
            wall.offset_ns = observed;
            return;
        }
        let speed = if stepped_back {
            WALL_CATCH_UP
        } else {
            WALL_SLEW
        };
        #[expect(
            clippy::cast_possible_truncation,
            reason = "at most a tenth of the time elapsed"
        )]
        let most = (to_f64(elapsed_us) * 1000.0 * speed) as i64;
        wall.offset_ns += off.clamp(-most, most);
    }

    /// Returns the fitted time on the host's monotonic clock at the device time `device_us`,
    /// microseconds; `None` before the first observation.
    pub fn host_us(&self, device_us: i128) -> Option<f64> {
        let (device_origin, host_origin) = self.origin?;
        #[expect(
            clippy::cast_precision_loss,
            reason = "within 2^53 us (285 years) of the origin"
        )]
        let device = (device_us - i128::from(device_origin)) as f64;
        Some(to_f64(host_origin) + self.offset + device * (1.0 + self.drift))
    }

    /// Returns the time on the smoothed wall clock at the device time `device_us`, nanoseconds
    /// since 1970; `None` before the first observation.
    pub fn wall_ns(&self, device_us: i128) -> Option<i64> {
        let (device_origin, host_origin) = self.origin?;
        let wall = self.wall?;
        #[expect(
            clippy::cast_precision_loss,
            reason = "within 2^53 us (285 years) of the origin"
        )]
        let device = (device_us - i128::from(device_origin)) as f64;
        let host_us = self.offset + device * (1.0 + self.drift);
        #[expect(clippy::cast_possible_truncation, reason = "saturates, and years fit")]
        let host_ns = (host_us * 1000.0).round() as i64;
        let host_ns = host_origin.saturating_mul(1000).saturating_add(host_ns);
        Some(host_ns.saturating_add(wall.offset_ns))
    }

    /// Returns the time on the smoothed wall clock at the host time `read`, nanoseconds since 1970.
    pub fn wall_of_host_ns(&self, read: HostTime) -> i64 {
        let offset_ns = self
            .wall
            .map_or(read.wall_offset_ns(), |wall| wall.offset_ns);
        let host_ns = read.monotonic_us.saturating_mul(1000);
        host_ns.saturating_add(offset_ns)
    }

    /// Returns the drift: rate of the host's clock divided by that of the device's clock, minus 1,
    /// in parts per million.
    pub fn drift_ppm(&self) -> f64 {
        self.drift * 1e6
    }

    /// Returns the median residual of the fit, microseconds. A block's residual is the time by
    /// which its least delayed frame was read later than the fit predicts.
    pub fn residual_us(&self) -> f64 {
        let mut residuals: Vec<f64> = self.blocks.iter().map(|point| self.lag(*point)).collect();
        residuals.sort_by(f64::total_cmp);
        residuals.get(residuals.len() / 2).copied().unwrap_or(0.0)
    }

    /// Returns by how much the newest frame was read later than the fit predicts, microseconds.
    pub fn newest_delay_us(&self) -> f64 {
        self.newest_frame.map_or(0.0, |point| self.lag(point))
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

    /// Returns the number of frames left out of the fit, because they had waited in a buffer.
    pub fn backlog(&self) -> u64 {
        self.backlog
    }

    /// Returns the number of observed frames with an impossible device time.
    pub fn refused(&self) -> u64 {
        self.refused
    }
}

fn block_of(point: Point) -> i64 {
    #[expect(clippy::cast_possible_truncation, reason = "2^53 us over 2 s")]
    let block = (point.device / BLOCK_US).floor() as i64;
    block
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

/// Device time at which a frame was made, and host time at which it was read. Both are in
/// microseconds relative to an origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Point {
    pub(crate) device: f64,
    pub(crate) host: f64,
}

/// Returns the slope of one line: of all lines below the points, the one that has the least mean
/// distance to them. It is the edge of the lower convex hull that spans the mean device time.
///
/// `points` must be sorted by device time, for Andrew's monotone chain algorithm. Returns 1 if
/// there are fewer than two distinct device times.
pub(crate) fn slope_at_middle(points: &[Point]) -> f64 {
    let mut hull: Vec<Point> = Vec::with_capacity(points.len());
    for &point in points {
        while let [.., a, b] = hull.as_slice() {
            let turns_up = (b.device - a.device) * (point.host - a.host)
                > (b.host - a.host) * (point.device - a.device);
            if turns_up {
                break;
            }
            hull.pop();
        }
        hull.push(point);
    }
    #[expect(clippy::cast_precision_loss, reason = "a hundred points")]
    let middle = points.iter().map(|point| point.device).sum::<f64>() / points.len() as f64;
    let edges = hull.iter().zip(hull.iter().skip(1));
    let mut edges = edges.filter(|(a, b)| b.device > a.device);
    let edge = edges
        .clone()
        .find(|(_, b)| b.device >= middle)
        .or_else(|| edges.next_back());
    edge.map_or(1.0, |(a, b)| (b.host - a.host) / (b.device - a.device))
}

#[cfg(test)]
mod tests {
    use super::{Point, slope_at_middle};

    fn slope(points: &[(f64, f64)]) -> f64 {
        let points: Vec<Point> = points
            .iter()
            .map(|&(device, host)| Point { device, host })
            .collect();
        slope_at_middle(&points)
    }

    #[test]
    fn points_above_the_hull_do_not_change_the_slope() {
        let cloud = [
            (0.0, 0.0),
            (1.0, 9.0),
            (2.0, 4.0),
            (3.0, 3.9),
            (4.0, 8.0),
            (5.0, 9.0),
        ];
        assert!((slope(&cloud) - 1.3).abs() < 1e-12);
    }

    #[test]
    fn too_few_points_have_the_slope_of_equal_clocks() {
        for points in [&[][..], &[(3.0, 7.0)], &[(3.0, 7.0), (3.0, 8.0)]] {
            assert!((slope(points) - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_bent_hull_has_the_slope_of_its_middle() {
        let bend = [(0.0, 0.0), (1.0, 1.0), (2.0, 3.0), (3.0, 5.0), (4.0, 7.0)];
        assert!((slope(&bend) - 2.0).abs() < 1e-12);
    }
}
