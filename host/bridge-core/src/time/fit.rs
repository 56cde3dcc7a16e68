//! Line through the earliest arrivals of a device's frames: host time as a function of device time.
//!
//! The host reads a frame some time after the device made it. This delay is never negative and is
//! sometimes close to its minimum, so the line lies below the points (device time, host time) and
//! touches some of them. Nothing is assumed about the size of the delays.
//!
//! * **Points.** The device time is divided into blocks of up to 1 s; the frame with the least
//!   delay stands for its block. The first frames are blocks of their own; as time passes, blocks
//!   are joined in pairs, so that 64 to 128 blocks cover the history, up to two minutes.
//! * **Backlogs.** Frames that follow each other faster than any device makes them have waited in a
//!   buffer. All of them except the newest are certainly late and are removed, so a backlog of any
//!   length leaves no points.
//! * **Line.** Of all lines below the points, the line with the least mean distance to them is the
//!   edge of their lower convex hull at the middle of the points (Moon, Skelly and Towsley, INFOCOM
//!   1999). It is computed for all blocks, and for those of the newest 64 s and 24 s.
//! * **Change of rate.** The longest history yields the most exact line while the clocks' rates are
//!   constant. After a change, the line of a shorter history lies higher at the newest points. If
//!   it lies higher by more than the spread of the points explains, the 64 s line replaces the
//!   longer line, whereas the 24 s line only raises the offset of the chosen line (O. Lepski's
//!   choice of a window, 1990).
//!
//! The work per frame and the memory are limited by the number of blocks.

use std::collections::VecDeque;

/// Largest rate error, as a fraction, that a device's clock can have. RC oscillators of
/// microcontrollers stay within 3 % (STM32H743 data sheet: HSI within 1 % from 0 to 85 degrees
/// Celsius, CSI within 3 %).
const MAX_DRIFT: f64 = 0.04;
/// Device time that a block spans in the long run, microseconds.
const BLOCK_US: f64 = 1e6;
/// Least device time that a block spans after blocks have been joined, microseconds. It is not 0,
/// so that frames with the same device time are joined too.
const LEAST_BLOCK_US: f64 = 1.0;
/// Largest number of blocks. With more, blocks are joined, or the oldest is dropped.
const BLOCKS: usize = 128;
/// Least number of blocks from which the drift is fitted: half a second of codes.
const MIN_BLOCKS: usize = 8;
/// Durations of the shorter histories, whose lines follow a change of rate, microseconds. If the
/// rate changes by 3.3 ppm/s (200 ppm a minute), a line over 24 s is off by up to 0.24 ms.
const SHORTER_US: [f64; 2] = [64e6, 24e6];
/// Shortest history whose line sets the drift, microseconds. If the host reads every 16 ms with 4
/// ms of jitter, a line over 64 s has the drift to within 12 ppm, a line over 24 s only to within
/// 65 ppm.
const DRIFT_SPAN_US: f64 = 64e6;
/// Duration of a group of blocks, microseconds. The spread is computed from the least delay of each
/// group.
const SPREAD_SPAN_US: f64 = 4e6;
/// Least distance between two lines that counts as a change of rate, microseconds.
const LEAST_ALLOWANCE_US: f64 = 50.0;
/// Divisor in the allowance's term s^2 / `SPREAD_US`, microseconds; s is the spread.
const SPREAD_US: f64 = 250.0;

/// Device time at which a frame was made, and host time at which it was read. Both are in
/// microseconds relative to an origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Point {
    pub(crate) device: f64,
    pub(crate) host: f64,
}

/// Host time as a function of device time: `device * (1 + drift) + offset`, microseconds.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Line {
    /// Host seconds per device second, minus 1.
    pub(crate) drift: f64,
    offset: f64,
}

impl Line {
    pub(crate) fn host_us(self, device: f64) -> f64 {
        device * (1.0 + self.drift) + self.offset
    }

    /// Returns by how much the host time of `point` is later than the line's, microseconds.
    pub(crate) fn lag_us(self, point: Point) -> f64 {
        point.host - self.host_us(point.device)
    }
}

/// A block of frames, represented by its least delayed frame.
#[derive(Clone, Copy, Debug)]
struct Block {
    /// Device time of the block's first frame, microseconds.
    start: f64,
    point: Point,
}

/// Fit of a line to the points of a device's present run.
#[derive(Clone, Debug, Default)]
pub(crate) struct Fit {
    blocks: VecDeque<Block>,
    /// Device time that a block spans at present, microseconds; 0 while each frame is a block.
    block_us: f64,
    line: Line,
    /// Buffer for the vertices of the hull; reused to avoid allocations.
    hull: Vec<Point>,
}

impl Fit {
    /// Creates a fit without points. Its line has the drift `drift` until there are enough points.
    pub(crate) fn expecting(drift: f64) -> Fit {
        Fit { line: Line { drift, offset: 0.0 }, ..Fit::default() }
    }

    pub(crate) fn line(&self) -> Line {
        self.line
    }

    /// Returns the device time that the points span, microseconds.
    pub(crate) fn span_us(&self) -> f64 {
        let ends = self.blocks.front().zip(self.blocks.back());
        ends.map_or(0.0, |(first, last)| last.start - first.start)
    }

    /// Returns the median time by which the points lie above the line, microseconds.
    pub(crate) fn residual_us(&self) -> f64 {
        let mut lags = self.lags(0, self.line);
        lags.sort_by(f64::total_cmp);
        lags.get(lags.len() / 2).copied().unwrap_or(0.0)
    }

    /// Adds the point of a new frame. Points must come in the order of their device times.
    pub(crate) fn add(&mut self, point: Point) {
        let is_late = |block: &Block| {
            let least_us = (point.device - block.point.device) * (1.0 - MAX_DRIFT);
            point.host - block.point.host < least_us
        };
        let before = self.blocks.len();
        while self.blocks.back().is_some_and(is_late) {
            self.blocks.pop_back();
        }
        let start = point.device;
        let is_new = self.add_block(Block { start, point });
        if !is_new && self.blocks.len() == before && self.line.lag_us(point) >= 0.0 {
            return;
        }
        if self.blocks.len() > BLOCKS {
            if self.block_us < BLOCK_US {
                self.join_blocks();
            } else {
                self.blocks.pop_front();
            }
        }
        self.fit(point);
    }

    /// Appends a block, or adds its point to the newest block if that block is not complete.
    /// Returns whether the set of points has changed.
    fn add_block(&mut self, block: Block) -> bool {
        match self.blocks.back_mut() {
            Some(newest) if block.start - newest.start < self.block_us => {
                let is_less = self.line.lag_us(block.point) < self.line.lag_us(newest.point);
                if is_less {
                    newest.point = block.point;
                }
                is_less
            }
            _ => {
                self.blocks.push_back(block);
                true
            }
        }
    }

    /// Doubles the time that a block spans.
    fn join_blocks(&mut self) {
        #[expect(clippy::cast_precision_loss, reason = "128 blocks")]
        let mean_us = self.span_us() / self.blocks.len() as f64;
        self.block_us = (2.0 * mean_us.max(self.block_us)).clamp(LEAST_BLOCK_US, BLOCK_US);
        for block in std::mem::take(&mut self.blocks) {
            self.add_block(block);
        }
    }

    fn fit(&mut self, newest: Point) {
        let mut line = self.line_of(BLOCKS);
        // Compare lines at the last block but one: the newest point can still be part of a backlog.
        let at_us = self.blocks[self.blocks.len().saturating_sub(2)].point.device;
        let spread_us = self.spread_us(line);
        let allowance_us = LEAST_ALLOWANCE_US + spread_us * spread_us / SPREAD_US;
        for span_us in SHORTER_US {
            let blocks = self.blocks_in(span_us);
            if blocks >= self.blocks.len() {
                continue;
            }
            let mut shorter = self.line_of(blocks);
            let above_us = shorter.host_us(at_us) - allowance_us - line.host_us(at_us);
            if above_us > 0.0 {
                if span_us < DRIFT_SPAN_US {
                    line.offset += above_us;
                } else {
                    shorter.offset -= allowance_us;
                    line = shorter;
                }
            }
        }
        // Keep the line below the newest point: no frame is read before it is made.
        line.offset += line.lag_us(newest).min(0.0);
        self.line = line;
    }

    /// Returns the number of blocks in the device time `span_us`, at least 1; all blocks while each
    /// frame is a block of its own.
    fn blocks_in(&self, span_us: f64) -> usize {
        let blocks = span_us / self.block_us;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
        let blocks = blocks.round() as usize;
        blocks.clamp(1, self.blocks.len())
    }

    /// Returns the line below the newest `count` blocks. If these are fewer than [`MIN_BLOCKS`],
    /// the line takes its drift from the present line.
    fn line_of(&mut self, count: usize) -> Line {
        let first = self.blocks.len().saturating_sub(count);
        let points = self.blocks.range(first..).map(|block| block.point);
        let drift = if points.len() < MIN_BLOCKS {
            self.line.drift
        } else {
            let middle = self.blocks[first + points.len() / 2].point.device;
            slope_at(middle, points, &mut self.hull) - 1.0
        };
        let drift = drift.clamp(-MAX_DRIFT, MAX_DRIFT);
        let through_origin = Line { drift, offset: 0.0 };
        let lags = self.lags(first, through_origin).into_iter();
        Line { drift, offset: lags.fold(f64::INFINITY, f64::min) }
    }

    /// Returns the spread of the least delays, microseconds: the upper quartile of the absolute
    /// differences between the least delay of a group of blocks and the mean of the least delays of
    /// the two neighbouring groups. A change of rate hardly changes the spread.
    fn spread_us(&self, line: Line) -> f64 {
        let blocks = self.blocks_in(SPREAD_SPAN_US);
        let lags = self.lags(self.blocks.len() % blocks, line);
        let least = |lags: &[f64]| lags.iter().copied().fold(f64::INFINITY, f64::min);
        let least: Vec<f64> = lags.chunks(blocks).map(least).collect();
        let bends = least.windows(3);
        let mut bends: Vec<f64> = bends.map(|w| (w[1] - 0.5 * (w[0] + w[2])).abs()).collect();
        bends.sort_by(f64::total_cmp);
        bends.get(bends.len() * 3 / 4).copied().unwrap_or(0.0)
    }

    /// Returns by how much each block from index `first` on is later than `line`, microseconds.
    fn lags(&self, first: usize, line: Line) -> Vec<f64> {
        let blocks = self.blocks.range(first..);
        blocks.map(|block| line.lag_us(block.point)).collect()
    }
}

/// Returns the slope of the edge of the points' lower convex hull at the device time `middle`.
/// `points` must be sorted by device time, for Andrew's monotone chain algorithm. Returns 1 if all
/// device times are equal.
fn slope_at(middle: f64, points: impl Iterator<Item = Point>, hull: &mut Vec<Point>) -> f64 {
    hull.clear();
    for point in points {
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
    let mut edges = hull.windows(2).filter(|edge| edge[1].device > edge[0].device);
    let edge = edges.find(|edge| edge[1].device >= middle);
    edge.map_or(1.0, |edge| (edge[1].host - edge[0].host) / (edge[1].device - edge[0].device))
}

#[cfg(test)]
mod tests {
    use super::{BLOCKS, Fit, Point, slope_at};

    #[test]
    fn frames_of_one_device_time_take_no_more_blocks_than_others() {
        let mut fit = Fit::default();
        for host in 0..1000 {
            let (device, host) = (7.0, f64::from(host));
            fit.add(Point { device, host });
        }
        assert!(fit.blocks.len() <= BLOCKS);
    }

    #[test]
    fn the_slope_is_that_of_the_hull_s_edge_at_the_middle() {
        let slope = |middle, points: &[(f64, f64)]| {
            let points = points.iter().map(|&(device, host)| Point { device, host });
            slope_at(middle, points, &mut Vec::new())
        };
        let above = [(0.0, 0.0), (1.0, 9.0), (2.0, 4.0), (3.0, 3.9), (4.0, 8.0), (5.0, 9.0)];
        let bent = [(0.0, 0.0), (1.0, 1.0), (2.0, 3.0), (3.0, 5.0), (4.0, 7.0)];
        let found = [
            slope(3.0, &above),
            slope(2.0, &bent),
            slope(3.0, &[(3.0, 7.0)]),
            slope(3.0, &[(3.0, 7.0), (3.0, 8.0)]),
        ];
        for (found, expected) in found.iter().zip([1.3, 2.0, 1.0, 1.0]) {
            assert!((found - expected).abs() < 1e-12, "{found}, not {expected}");
        }
    }
}
