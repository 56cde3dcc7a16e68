//! Fit of the device's clock to the host's.
//!
//! Every code carries the device time of its last sample. The code arrives after a delay that is
//! never negative and sometimes close to its minimum.
//!
//! * Drift: the slope of the lower convex hull of the points (device time, host time) of the last
//!   two minutes, at the edge that spans the middle. That edge is the line below all points with the
//!   least mean distance to them (Moon, Skelly, Towsley, INFOCOM 1999).
//! * Offset: the least lag of the last 10 s with the drift removed, so that a change of drift shows
//!   within seconds. The offset falls at once but rises no faster than a clock can drift, so that a
//!   stalled host does not shift it.
//!
//! The fit uses the host's monotonic clock. The difference between wall clock and monotonic clock
//! is added last.
//!
//! One-way delays cannot separate the least delay from an offset between the clocks. Every stamp is
//! therefore late by the least time from a code's last sample to its reading: the encoder's run and
//! the transfer. That delay is constant and shifts all frames of a recording alike.

use std::collections::VecDeque;

use crate::time::host_time::HostTime;
use crate::time::hull::{Point, slope_at_middle};

/// Device time over which the least lag is searched, microseconds. A change of drift by 20 ppm
/// shifts stamps by 0.2 ms within these 10 s. If the host reads every 16 ms, reads fall on every
/// phase of the 62.5 ms between codes within 2 s.
const OFFSET_SPAN_US: f64 = 10e6;
/// Device time of one block, microseconds. The earliest arrival of each block is one point of the
/// drift's fit.
const BLOCK_US: f64 = 2e6;
/// Number of blocks in the drift's fit: 2 minutes.
const BLOCKS: usize = 60;
/// Number of blocks before the drift is fitted: 10 s. An error of 1 ms over 10 s is 100 ppm.
const MIN_BLOCKS: usize = 5;
/// Largest drift, either way, that the fit accepts; dimensionless. Two crystals never differ by
/// more.
const MAX_DRIFT: f64 = 500e-6;
/// Fastest rise of the offset, host seconds per device second: the largest drift that can remain
/// after the fitted drift is removed.
const MAX_RISE: f64 = 200e-6;
/// Lag, microseconds, above which an arrival can be from a backlog: the host stalled, or read late,
/// and now reads what has waited. Hosts that read every 16 ms stay below it.
const BACKLOG_LAG_US: f64 = 25_000.0;
/// Device time without a backlog after which the least lag shows the offset again, microseconds.
const PROMPT_SPAN_US: f64 = 5e6;
/// Fastest change of the wall clock against the monotonic clock that counts as slewing, seconds per
/// second. NTP slews by at most 500 ppm.
const WALL_SLEW: f64 = 600e-6;
/// Jump of the wall clock against the monotonic clock above which the wall clock counts as stepped,
/// nanoseconds.
const WALL_STEP_NS: i64 = 20_000_000;
/// Fraction by which the time of stamps runs slower after the wall clock was stepped backwards,
/// until the wall clock has caught up. Stamps therefore never go backwards.
const WALL_CATCH_UP: f64 = 0.1;
/// Longest step backwards of the wall clock that is caught up by slowing time, nanoseconds. After a
/// longer step the stamps go back at once, because catching up would take more than 5 minutes.
const WALL_WAIT_NS: i64 = 30_000_000_000;
/// Longest time by which a frame can seem to be read before it was made, microseconds. The fitted
/// clocks agree to some milliseconds, so a frame that exceeds this limit has a wrong device time.
const MAX_EARLY_US: f64 = 1e6;
/// Number of impossible device times in a row after which the fit itself counts as wrong: half a
/// second of codes.
const REFUSED_TO_RESTART: u32 = 8;

/// Fit of the device's clock to the host's monotonic clock, and the smoothed wall clock.
#[derive(Clone, Debug, Default)]
pub struct Clock {
    /// Device time and host time, microseconds, that all points are relative to. Small differences
    /// keep their f64 values exact.
    origin: Option<(u64, i64)>,
    recent: VecDeque<Point>,
    blocks: VecDeque<Point>,
    block: Option<Point>,
    /// Host seconds per device second, minus 1; dimensionless.
    drift: f64,
    /// Host time minus device time times (1 + drift), at the origin, microseconds.
    offset: f64,
    /// Latest device time of any point, microseconds since the origin.
    newest: f64,
    /// Largest drift of the clocks since the last prompt arrival, microseconds: what the offset may
    /// rise by at once after a backlog.
    unseen_drift: f64,
    /// Device time of the first prompt arrival after the last backlog, microseconds since the origin.
    prompt_since: f64,
    /// The newest arrival, from a backlog or not.
    newest_arrival: Option<Point>,
    /// Number of arrivals that were not used for the fit, because they were from a backlog.
    backlog: u64,
    wall: Option<Wall>,
    wall_steps: u32,
    wall_steps_back: u32,
    refused: u64,
    refused_in_a_row: u32,
}

/// Smoothed offset of the wall clock from the monotonic clock.
#[derive(Clone, Copy, Debug)]
struct Wall {
    offset_ns: i64,
    read_at_us: i64,
    /// Whether a step backwards is being caught up.
    catching_up: bool,
}

impl Clock {
    /// Discards the fit, because the device was reset. The wall clock's state stays.
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

    /// Returns whether a frame can have been made at this device time: not earlier than the newest
    /// frame in the fit, and not later than the frame was read. False before the first observation.
    pub fn admits(&self, device_us: u64, read: HostTime) -> bool {
        let is_old = |(origin, _)| difference(device_us, origin) < self.newest;
        !self.origin.is_some_and(is_old) && self.is_possible(device_us, read)
    }

    /// Returns whether a frame that was made at this device time can have been read at this host
    /// time: not before it was made. False before the first observation.
    pub fn is_possible(&self, device_us: u64, read: HostTime) -> bool {
        let lag_us = self.lag_us(device_us, read.monotonic_us);
        lag_us.is_some_and(|lag| lag >= -MAX_EARLY_US)
    }

    /// Returns whether any frame was observed since creation or the last restart.
    pub fn is_known(&self) -> bool {
        self.origin.is_some()
    }

    /// Returns by how much a host time is later than the fitted host time of a device time,
    /// microseconds; `None` before the first observation.
    pub(crate) fn lag_us(&self, device_us: u64, host_us: i64) -> Option<f64> {
        let (device_origin, host_origin) = self.origin?;
        let device = difference(device_us, device_origin);
        let host = to_f64(host_us.saturating_sub(host_origin));
        Some(host - device * (1.0 + self.drift) - self.offset)
    }

    /// Adds a frame that was made at this device time and read at this host time to the fit.
    /// Returns false and ignores the frame if its device time is impossible; the eighth impossible
    /// time in a row restarts the fit instead.
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
        self.newest_arrival = Some(point);
        if !is_first && self.lag(point) > BACKLOG_LAG_US + self.unseen_drift {
            self.backlog += 1;
            self.unseen_drift += MAX_RISE * elapsed;
            self.prompt_since = self.newest;
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

    /// Returns by how much a point is later than the fit, microseconds.
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
                    // Rotate the line about the newest point, so that stamps do not jump.
                    self.offset += (self.drift - drift) * self.newest;
                    self.drift = drift;
                }
            }
        }
    }

    /// Sets the offset to the least recent lag. `elapsed` is the device time since the arrival before,
    /// microseconds, which limits how far the offset rises.
    fn update_offset(&mut self, elapsed: f64, is_first: bool) {
        let lags = self
            .recent
            .iter()
            .map(|point| point.host - point.device * (1.0 + self.drift));
        let least = lags.fold(f64::INFINITY, f64::min);
        let mut rise = MAX_RISE * elapsed;
        if self.newest - self.prompt_since >= PROMPT_SPAN_US {
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

    /// Returns the host's monotonic clock at a device time, microseconds; `None` before the first
    /// observation.
    pub(crate) fn host_us(&self, device_us: i128) -> Option<f64> {
        let (device_origin, host_origin) = self.origin?;
        #[expect(
            clippy::cast_precision_loss,
            reason = "within 2^53 us (285 years) of the origin"
        )]
        let device = (device_us - i128::from(device_origin)) as f64;
        Some(to_f64(host_origin) + self.offset + device * (1.0 + self.drift))
    }

    /// Returns the wall clock at a device time, nanoseconds since 1970; `None` before the first
    /// observation.
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

    /// Returns the smoothed wall clock at a host time, nanoseconds since 1970.
    pub fn wall_of_host_ns(&self, read: HostTime) -> i64 {
        let offset_ns = self
            .wall
            .map_or(read.wall_offset_ns(), |wall| wall.offset_ns);
        let host_ns = read.monotonic_us.saturating_mul(1000);
        host_ns.saturating_add(offset_ns)
    }

    /// Rate of the host's clock relative to the device's, minus 1, in parts per million.
    pub fn drift_ppm(&self) -> f64 {
        self.drift * 1e6
    }

    /// Median over all blocks of the delay by which a block's earliest frame is later than the fit,
    /// microseconds.
    pub fn residual_us(&self) -> f64 {
        let mut residuals: Vec<f64> = self.blocks.iter().map(|point| self.lag(*point)).collect();
        residuals.sort_by(f64::total_cmp);
        residuals.get(residuals.len() / 2).copied().unwrap_or(0.0)
    }

    /// Delay by which the newest frame is later than the fit, microseconds.
    pub fn newest_delay_us(&self) -> f64 {
        self.newest_arrival.map_or(0.0, |point| self.lag(point))
    }

    /// Number of times the host's wall clock was stepped, in either direction.
    pub fn wall_steps(&self) -> u32 {
        self.wall_steps
    }

    /// Number of times the wall clock was set back by more than 30 s. Each time the stamps went
    /// back too.
    pub fn wall_steps_back(&self) -> u32 {
        self.wall_steps_back
    }

    /// Number of arrivals that the fit did not use, because they had waited in a buffer.
    pub fn backlog(&self) -> u64 {
        self.backlog
    }

    /// Number of frames whose device time was impossible.
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
