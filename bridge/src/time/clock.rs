//! The device's clock in terms of the host's.
//!
//! Every code carries the device's time of its last sample and arrives after some delay that is
//! never negative and sometimes close to its minimum. The drift of the device's clock is the slope
//! of the lower edge of all points (device time, host time) of the last two minutes: the edge of
//! their lower convex hull that spans the middle, which is the line under all points with the
//! least mean distance to them (Moon, Skelly, Towsley, INFOCOM 1999). The offset is the least
//! lag of the last 10 s once the drift is taken out, so that a change of drift shows within
//! seconds; it falls at once but rises no faster than a clock can drift, so that a stalled host
//! does not shift it. Host times are monotonic ones; the wall clock is added last.
//!
//! Delays of one direction alone cannot tell the least delay from an offset of the clocks, so every
//! stamp is late by the least time from a code's last sample to its reading: the encoder's run and
//! the link's transfer. That is a constant, which shifts all frames of a recording alike.

use std::collections::VecDeque;

use crate::time::host_time::HostTime;
use crate::time::hull::{Point, slope_at_middle};

/// Device time over which the least lag is taken, microseconds. A 20 ppm change of drift costs
/// 0.2 ms over it; bunching by 16 ms meets every phase of a 62.5 ms interval in 2 s.
const OFFSET_SPAN_US: f64 = 10e6;
/// Device time of one block; each gives the drift one point, its earliest arrival.
const BLOCK_US: f64 = 2e6;
/// Blocks that the drift is fitted over: 2 minutes.
const BLOCKS: usize = 60;
/// Blocks before the drift is believed: 10 s; 1 ms of jitter is 100 ppm over them.
const MIN_BLOCKS: usize = 5;
/// Two clocks that differ by more are not crystals: bound of the fitted drift.
const MAX_DRIFT: f64 = 500e-6;
/// How fast the offset may rise: the bound of what is left of the drift.
const MAX_RISE: f64 = 200e-6;
/// How fast the wall clock is followed while it is slewed; NTP slews by at most 500 ppm.
const WALL_SLEW: f64 = 600e-6;
/// A wall clock that is off by more was stepped, nanoseconds.
const WALL_STEP_NS: i64 = 20_000_000;
/// After a step backwards time goes on at 0.9 of its speed until it is caught up: monotone.
const WALL_CATCH_UP: f64 = 0.1;
/// A longer step backwards is followed at once, and stamps go back with it: waiting would make
/// them wrong for more than 5 minutes. Nanoseconds.
const WALL_WAIT_NS: i64 = 30_000_000_000;
/// A frame that was read so much before it was made has a wrong time, microseconds: the clocks
/// agree to some milliseconds.
const MAX_EARLY_US: f64 = 1e6;
/// So many refused times in a row are right, and what the fit knows is wrong: half a second.
const REFUSED_TO_RESTART: u32 = 8;

/// The device's clock in terms of the host's.
#[derive(Clone, Debug, Default)]
pub struct Clock {
    /// Where device time and host time are counted from; keeps the numbers small.
    origin: Option<(u64, i64)>,
    recent: VecDeque<Point>,
    blocks: VecDeque<Point>,
    block: Option<Point>,
    /// Host seconds per device second, minus 1.
    drift: f64,
    /// Host time minus device time times (1 + drift), at the origin, microseconds.
    offset: f64,
    /// Device time of the last point.
    newest: f64,
    wall: Option<Wall>,
    wall_steps: u32,
    wall_steps_back: u32,
    refused: u64,
    refused_in_a_row: u32,
}

/// Wall clock minus monotonic clock, as used.
#[derive(Clone, Copy, Debug)]
struct Wall {
    offset_ns: i64,
    read_at_us: i64,
    /// A step backwards is being caught up.
    catching_up: bool,
}

impl Clock {
    /// Forget the device's clock (it was reset); the wall clock stays known.
    pub fn restart(&mut self) {
        *self = Clock {
            wall: self.wall,
            wall_steps: self.wall_steps,
            wall_steps_back: self.wall_steps_back,
            refused: self.refused,
            ..Clock::default()
        };
    }

    /// Whether a frame can have been made at this device time: not before the newest one, and
    /// not after it was read. False also as long as nothing is known.
    pub fn admits(&self, device_us: u64, read: HostTime) -> bool {
        let behind = |(origin, _)| difference(device_us, origin) < self.newest;
        !self.origin.is_some_and(behind) && self.is_possible(device_us, read)
    }

    /// Whether a frame that was read at this host time can have been made at this device time: not
    /// after it was read. False also as long as nothing is known.
    pub fn is_possible(&self, device_us: u64, read: HostTime) -> bool {
        let lag_us = self.lag_us(device_us, read.monotonic_us);
        lag_us.is_some_and(|lag| lag >= -MAX_EARLY_US)
    }

    /// Whether the clock has seen any frame since it was made or restarted.
    pub fn is_known(&self) -> bool {
        self.origin.is_some()
    }

    /// Host time minus what the fit says for a device time, microseconds; `None` before the first
    /// observation.
    pub(crate) fn lag_us(&self, device_us: u64, host_us: i64) -> Option<f64> {
        let (device_origin, host_origin) = self.origin?;
        let device = difference(device_us, device_origin);
        let host = to_f64(host_us.saturating_sub(host_origin));
        Some(host - device * (1.0 + self.drift) - self.offset)
    }

    /// A frame of this device time was read at this host time. Returns false if the time cannot
    /// be right; then it is not used, unless several in a row agree that the fit is wrong.
    pub fn observe(&mut self, device_us: u64, read: HostTime) -> bool {
        self.follow_wall(read);
        if self.origin.is_some() && !self.admits(device_us, read) {
            self.refused += 1;
            self.refused_in_a_row += 1;
            if self.refused_in_a_row < REFUSED_TO_RESTART {
                return false;
            }
            tracing::warn!("the device's clock jumped; it is fitted anew");
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
        self.recent.push_back(point);
        while self
            .recent
            .front()
            .is_some_and(|old| old.device < point.device - OFFSET_SPAN_US)
        {
            self.recent.pop_front();
        }
        self.add_to_block(point);
        self.update_offset(point, is_first);
        true
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
                    // The line turns about the newest point, so that stamps do not jump.
                    self.offset += (self.drift - drift) * self.newest;
                    self.drift = drift;
                }
            }
        }
    }

    fn update_offset(&mut self, point: Point, is_first: bool) {
        let lags = self
            .recent
            .iter()
            .map(|point| point.host - point.device * (1.0 + self.drift));
        let least = lags.fold(f64::INFINITY, f64::min);
        let elapsed = (point.device - self.newest).max(0.0);
        self.offset = if is_first {
            least
        } else {
            least.min(self.offset + MAX_RISE * elapsed)
        };
        self.newest = self.newest.max(point.device);
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
        let behind = off < -WALL_STEP_NS;
        if off > WALL_STEP_NS || (behind && !wall.catching_up) {
            self.wall_steps = self.wall_steps.wrapping_add(1);
            tracing::warn!(
                milliseconds = off / 1_000_000,
                "the host's clock was stepped"
            );
        }
        wall.catching_up = behind && off >= -WALL_WAIT_NS;
        if !(-WALL_WAIT_NS..=WALL_STEP_NS).contains(&off) {
            self.wall_steps_back = self.wall_steps_back.wrapping_add(u32::from(behind));
            wall.offset_ns = observed;
            return;
        }
        let speed = if behind { WALL_CATCH_UP } else { WALL_SLEW };
        #[expect(
            clippy::cast_possible_truncation,
            reason = "at most a tenth of the time elapsed"
        )]
        let most = (to_f64(elapsed_us) * 1000.0 * speed) as i64;
        wall.offset_ns += off.clamp(-most, most);
    }

    /// Wall clock at a device time, nanoseconds since 1970; `None` before the first observation.
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

    /// Wall clock at a host time, nanoseconds since 1970: as read, but followed smoothly.
    pub fn wall_of_host_ns(&self, read: HostTime) -> i64 {
        let offset_ns = self
            .wall
            .map_or(read.wall_offset_ns(), |wall| wall.offset_ns);
        let host_ns = read.monotonic_us.saturating_mul(1000);
        host_ns.saturating_add(offset_ns)
    }

    /// How much faster the host's clock runs than the device's, parts per million.
    pub fn drift_ppm(&self) -> f64 {
        self.drift * 1e6
    }

    /// Median of what the blocks' earliest arrivals lie above the fit, microseconds.
    pub fn residual_us(&self) -> f64 {
        let mut residuals: Vec<f64> = self
            .blocks
            .iter()
            .map(|point| point.host - point.device * (1.0 + self.drift) - self.offset)
            .collect();
        residuals.sort_by(f64::total_cmp);
        residuals.get(residuals.len() / 2).copied().unwrap_or(0.0)
    }

    /// How much later than the fit the newest frame came, microseconds.
    pub fn newest_delay_us(&self) -> f64 {
        let newest = self.recent.back();
        newest.map_or(0.0, |point| {
            point.host - point.device * (1.0 + self.drift) - self.offset
        })
    }

    /// How often the host's wall clock was stepped, either way.
    pub fn wall_steps(&self) -> u32 {
        self.wall_steps
    }

    /// How often it was stepped back by more than is waited for, so that time went backwards.
    pub fn wall_steps_back(&self) -> u32 {
        self.wall_steps_back
    }

    /// Frames whose device time could not be right.
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
